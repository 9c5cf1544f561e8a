//! People in the pictures of one camera: HOG features and a linear classifier, as in section 3 of Okada et al.
//!
//! * [`Detector`] — boxes with a score in one picture; [`Detector::read`] takes a camera's own weights;
//! * [`suppress`] — of boxes that overlap, only the surest stays;
//! * [`train`] — a camera's own weights, from labelled boxes and its background;
//! * [`svm`] — the classifier's training.

mod model;
pub mod suppress;
pub mod svm;
pub mod train;

use std::fmt::Write;

use calib::vision::people::{DetectionWindow, PERSON_HEIGHT_PX, PeopleClassifier, WINDOW_PX};
use image::RgbImage;

use crate::tracks::rows::PixelBox;
use crate::{Error, Result};

/// A box's width over its height: of people who walk, arms and legs included.
const ASPECT: f64 = 0.41;

/// How people are looked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectOptions {
    /// The smallest person that is looked for, pixels high. Smaller ones cost more time: twice as small, four times.
    pub min_height_px: f64,
    /// The tallest person that is kept.
    pub max_height_px: Option<f64>,
    /// The least score that is kept.
    pub min_score: f64,
    /// Ratio of one size that is tried to the next.
    pub scale_step: f64,
    /// Of boxes with more overlap (IoU) than this, only the surest is kept.
    pub max_overlap: f64,
}

impl Default for DetectOptions {
    fn default() -> Self {
        Self { min_height_px: 60.0, max_height_px: None, min_score: 0.0, scale_step: 1.05, max_overlap: 0.4 }
    }
}

impl DetectOptions {
    /// Refuses numbers that mean nothing.
    ///
    /// # Errors
    /// Naming the option.
    pub fn check(&self) -> Result<()> {
        if !(self.min_height_px >= 12.0 && self.min_height_px.is_finite()) {
            return Err(Error::option(
                "--min-height",
                format!("is {}; give pixels from 12", self.min_height_px),
            ));
        }
        if self.max_height_px.is_some_and(|max| max.is_nan() || max < self.min_height_px) {
            return Err(Error::option("--max-height", "is less than --min-height"));
        }
        if !(self.scale_step > 1.0 && self.scale_step <= 2.0) {
            return Err(Error::option(
                "--scale-step",
                format!("is {}; give a ratio from 1.01 to 2", self.scale_step),
            ));
        }
        if !self.min_score.is_finite() {
            return Err(Error::option("--min-score", format!("is {}; give a number", self.min_score)));
        }
        if !(0.0..=1.0).contains(&self.max_overlap) {
            return Err(Error::option("--max-overlap", format!("is {}; give 0 to 1", self.max_overlap)));
        }
        Ok(())
    }
}

/// A person in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Where.
    pub pixel_box: PixelBox,
    /// Distance from the classifier's boundary; more is surer.
    pub score: f64,
}

/// Looks for people.
pub struct Detector {
    classifier: PeopleClassifier,
    options: DetectOptions,
}

impl Detector {
    /// A detector by its weights.
    ///
    /// # Errors
    /// Options that mean nothing, a wrong number of weights.
    pub fn new(weights: &[f32], options: DetectOptions) -> Result<Self> {
        options.check()?;
        Ok(Self { classifier: PeopleClassifier::new(weights)?, options })
    }

    /// The people in a picture, the surest first.
    ///
    /// # Errors
    /// When OpenCV refuses.
    pub fn look(&self, image: &RgbImage) -> Result<Vec<Found>> {
        let zoom = f64::from(PERSON_HEIGHT_PX) / self.options.min_height_px;
        let windows =
            self.classifier.windows(image, zoom, self.options.scale_step, self.options.min_score)?;
        let tallest = self.options.max_height_px.unwrap_or(f64::INFINITY);
        let found = windows.into_iter().map(|(window, score)| Found { pixel_box: person_in(&window), score });
        let fitting: Vec<Found> = found.filter(|f| f.pixel_box.height <= tallest).collect();
        Ok(suppress::keep_surest(&fitting, self.options.max_overlap))
    }
}

/// The person whom a window is made for.
fn person_in(window: &DetectionWindow) -> PixelBox {
    let height = window.height * f64::from(PERSON_HEIGHT_PX) / f64::from(WINDOW_PX.1);
    let width = ASPECT * height;
    PixelBox {
        left: window.left + 0.5 * (window.width - width),
        top: window.top + 0.5 * (window.height - height),
        width,
        height,
    }
}

/// The window that is made for a person: as high as they are, whatever their width.
fn window_of(person: &PixelBox) -> DetectionWindow {
    let height = person.height * f64::from(WINDOW_PX.1) / f64::from(PERSON_HEIGHT_PX);
    let width = height * f64::from(WINDOW_PX.0) / f64::from(WINDOW_PX.1);
    DetectionWindow {
        left: person.left + 0.5 * (person.width - width),
        top: person.top + 0.5 * (person.height - height),
        width,
        height,
    }
}

/// MOTChallenge rows of one frame.
pub fn rows(frame: u32, found: &[Found]) -> String {
    found.iter().fold(String::new(), |mut text, f| {
        let b = f.pixel_box;
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{frame},-1,{:.2},{:.2},{:.2},{:.2},{:.4},-1,-1,-1",
            b.left, b.top, b.width, b.height, f.score
        );
        text
    })
}

#[cfg(test)]
mod tests;
