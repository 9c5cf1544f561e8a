//! The only module that calls OpenCV: pixels in, pixels out.
//!
//! Pictures cross this boundary as the `image` crate's [`image::RgbImage`] and [`image::GrayImage`], points as
//! `nalgebra`'s; no OpenCV type appears in any signature, so the estimators build and test without it.

mod adapter;
pub mod background;
pub mod chessboard;
pub mod flow;
mod keypoints;
mod morphology;
pub mod people;

pub use background::{AdaptiveBackground, AdaptiveKind};
pub use keypoints::Keypoints;
pub use morphology::Morphology;
pub use people::PeopleClassifier;

/// Limits the threads OpenCV uses for its own loops; results do not depend on it.
///
/// # Errors
/// [`crate::Error::OpenCv`] when OpenCV refuses.
pub fn set_threads(threads: usize) -> crate::Result<()> {
    opencv::core::set_num_threads(threads as i32).map_err(adapter::refused("setting its number of threads"))
}
