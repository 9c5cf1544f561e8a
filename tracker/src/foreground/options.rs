//! Options of the foreground masks.

use super::pixels::PixelOptions;
use super::shadow::ShadowOptions;

/// Options of the foreground masks.
#[derive(Debug, Clone, PartialEq)]
pub struct ForegroundOptions {
    /// Comparison of pixels with the background.
    pub pixels: PixelOptions,
    /// Detection of shadows; `None` leaves them in the mask.
    pub shadows: Option<ShadowOptions>,
    /// Whether changes of exposure and white balance are compensated (default).
    pub exposure: bool,
    /// Least area of a region, as a fraction of the image; smaller ones are noise. Default 0.0004.
    pub least_area: f64,
    /// Largest area of a hole that is filled, as a fraction of the image. Default 0.003.
    pub largest_hole: f64,
    /// Largest fraction of foreground in a usable frame. Default 0.6.
    pub most_foreground: f64,
    /// Increase of foreground between two frames, as a fraction of the image, that means a switched light. Default 0.3.
    pub sudden_foreground: f64,
    /// Time for which the background is learnt after a switched light, seconds. Default 2.
    pub relearn_s: f64,
}

impl Default for ForegroundOptions {
    fn default() -> Self {
        Self {
            pixels: PixelOptions::default(),
            shadows: Some(ShadowOptions::default()),
            exposure: true,
            least_area: 0.0004,
            largest_hole: 0.003,
            most_foreground: 0.6,
            sudden_foreground: 0.3,
            relearn_s: 2.0,
        }
    }
}
