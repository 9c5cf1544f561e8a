//! The chain against the truth and against damaged input: one test binary, one module a subject.
#![forbid(unsafe_code)]
// All callers of a test's helpers are tests: a failure there is the test's.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod agents;
mod capture_motion;
mod check;
mod clocks;
mod events;
mod failing_cameras;
mod folder;
mod front_door;
mod guide;
mod kept_files;
mod kills;
mod link_refusals;
mod live_cameras;
mod live_view;
mod mqtt;
mod office;
mod pages;
mod parsers;
mod recon_board;
mod recon_picks;
mod recon_refusals;
mod recon_relocate;
mod recon_resume;
mod refusal;
mod run_refusals;
mod scenes_refusals;
mod serve;
mod untrusted;
mod wide_masks;
