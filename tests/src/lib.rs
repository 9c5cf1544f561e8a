//! What the end-to-end tests and the benchmarks share: where the data is, and how far a result is from the truth.
//!
//! * [`data`] — the office shipped beside this crate, the larger data sets where they are at hand, the binaries.
//! * [`chain`] — the programs, run as a person runs them, with what they measure.
//! * [`hall`] — a synthetic hall with true heads, for the head tracker's experiments.
//! * [`project`] — a synthetic room's captures, as `recon build` takes them.
//! * [`network_camera`] — a fake network camera with a clock, losses and faults of its own.
//! * [`live`] — scenarios of live input: what a run makes of such cameras, as figures.
//! * [`accuracy`] — errors of camera motion, of a finished room and of its depth, against ground truth.
#![forbid(unsafe_code)]

pub mod accuracy;
pub mod chain;
pub mod data;
pub mod hall;
pub mod live;
pub mod network_camera;
pub mod project;
