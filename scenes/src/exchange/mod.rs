//! Cameras (and points) of other programs: COLMAP's sparse models in and out, nerfstudio's `transforms.json` out.
//!
//! Both count pixels from the top-left pixel's corner, so their principal points are half a pixel larger than ours.

mod binary;
pub mod colmap;
pub mod nerfstudio;
mod text;

/// From our pixels, counted from a pixel's centre, to pixels counted from its corner.
const CORNER_PX: f64 = 0.5;
