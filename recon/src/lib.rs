//! Reconstruction of a metric room whose floor is z = 0 from captured image sequences.
//!
//! One camera is filmed while it is moved to its final pose; the frame at that pose is its *reference image*. Data
//! flows down this list, a module a stage:
//!
//! * [`pipeline`] — `recon build`: from `room.toml` to the room directory. Start here.
//! * [`project`] — `room.toml`, checked.
//! * [`capture`] — the frames of one camera and its reference image.
//! * [`features`] — corners followed from frame to frame: tracks.
//! * [`motion`] — camera motion and sparse points: start, growth, adjustment, diagnosis.
//! * [`bundle`] — least squares over poses, points and lens.
//! * [`schur`] — normal equations of cameras and points, the points eliminated.
//! * [`dense`] — depth and normal for each pixel of the reference view, by PatchMatch stereo.
//! * [`surface`] — depth, normal and origin of each pixel of a reference view.
//! * [`ray_depth`] — the depth of single, picked pixels, from all frames.
//! * [`rolling_shutter`] — correction of frames whose rows were read one after the other.
//! * [`plumb`] — the vertical, estimated from edges in the pictures.
//! * [`planes`] — the room's planes: measured depths made exact on them, holes filled from them.
//! * [`assemble`] — one room from all surfaces: [`merge`] (picked points, one adjustment of all
//!   captures), [`floor`] (Hough transform, world frame), [`scale`] (metres), [`fusion`] (oriented discs).
//! * [`verdict`] — green, amber or red, with reasons: whether a built room is to be believed.
//! * [`proposals`] — `recon picks`: corresponding points of cameras, proposed for a person to confirm.
//! * [`picks_page`] — the same in the browser, with the scale, the build and its verdict.
//! * [`relocation`] — `recon relocate`: where a camera of a finished room stands now, from one picture.
//! * [`working_size`], [`memory`] — large pictures are worked on at a smaller size; the memory that captures take.
//! * [`error`] — the error type: each line names file, place and what to do.
//! * [`cli`] — the command line: one file a subcommand.
#![forbid(unsafe_code)]

pub mod assemble;
pub mod bundle;
pub mod capture;
pub mod cli;
pub mod dense;
pub mod error;
mod factorization;
pub mod features;
pub mod floor;
pub mod fusion;
pub mod memory;
pub mod merge;
pub mod motion;
pub mod picks_page;
pub mod pipeline;
pub mod planes;
pub mod plumb;
pub mod project;
pub mod proposals;
pub mod ray_depth;
pub mod relocation;
pub mod rolling_shutter;
pub mod scale;
pub mod schur;
pub mod surface;
pub mod verdict;
pub mod working_size;

pub use error::{Error, Result};
