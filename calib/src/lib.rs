//! Camera models, intrinsic and extrinsic calibration, absolute orientation.
//!
//! The lowest crate of the field's work: everything here speaks `f64` `nalgebra`, and nothing here knows of rooms or
//! people.
//!
//! * [`Camera`] — a camera's pose ([`nalgebra::Isometry3`], `camera_from_world`) and its mapping of
//!   directions to pixels ([`Intrinsics`], with OpenCV's [`Distortion`] by one of three models). Start here.
//! * [`absolute_orientation`] — Horn's closed form: the similarity that takes one set of points to another.
//! * [`least_squares`] — damped nonlinear least squares: the trait of a problem, and the one loop that minimises it.
//! * [`resection`] — a camera's pose, and its lens where that is unknown, from known points and their pixels.
//! * [`relocation`] — a camera's pose from one picture and pictures taken at known poses.
//! * [`picture`] — pictures in files: photographs upright, drawings replaced in one step.
//! * [`photograph`] — the lens stated by a photograph's EXIF block.
//! * [`ray_uncertainty`] — standard deviation of a calibrated camera's rays, over its picture.
//! * [`undistort`] — lookup maps between a distorted image and its pinhole twin ([`Intrinsics::pinhole`]).
//! * [`vision`] — the only module that calls OpenCV: optical flow, background models, chessboards.
//! * [`video`] — the only module that calls FFmpeg: frames in, films out. The rest of the crate builds and tests
//!   without these two (feature `vision`).
//! * [`cli`] — the command line: one file a subcommand.
//!
//! # Conventions
//!
//! OpenCV's camera: x right, y down, z forward; `X_camera = R · X_world + t`. Pixel (0, 0) is the **centre** of
//! the top-left pixel, so an image of width `w` covers `-0.5 ..= w - 0.5`. Transforms are named `a_from_b`, so
//! that `camera_from_world * world_from_room` reads itself. Rigid transforms are [`nalgebra::Isometry3`],
//! similarities [`nalgebra::Similarity3`].
#![forbid(unsafe_code)]

pub mod absolute_orientation;
mod board_adjustment;
mod camera;
#[cfg(feature = "vision")]
pub mod cli;
mod distortion;
mod error;
mod exact_length;
pub mod files;
pub mod least_squares;
mod lens_fold;
pub mod photograph;
pub mod picture;
mod pinhole_twin;
pub mod ray_uncertainty;
#[cfg(feature = "vision")]
pub mod relocation;
pub mod resection;
pub mod rotation;
pub mod undistort;
#[cfg(feature = "vision")]
pub mod video;
#[cfg(feature = "vision")]
pub mod vision;

pub use camera::{Camera, Intrinsics};
pub use distortion::{BrownConrady, Distortion, Fisheye, LensModel, Rational};
pub use error::{Error, Result};
pub use lens_fold::LensFold;
