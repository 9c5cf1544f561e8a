//! Detection of people in the pictures of one camera: HOG features and a linear classifier, as in section 3 of Okada et
//! al. (cited in [`mot::link`]); HOG: N. Dalal and B. Triggs, "Histograms of oriented gradients for human detection",
//! CVPR 2005.
//!
//! * [`Detector`] — boxes with a score in one picture; [`Detector::read`] loads a camera's own weights;
//! * [`suppress`] — non-maximum suppression: of overlapping boxes only the one with the highest score stays;
//! * [`train`] — training of a camera's own weights, from labelled boxes and its background;
//! * [`svm`] — training of the classifier.

mod model;
pub mod suppress;
pub mod svm;
pub mod train;

use std::fmt::Write;

use calib::vision::people::{DetectionWindow, PERSON_HEIGHT_PX, PeopleClassifier, WINDOW_PX};
use image::RgbImage;
use mot::rows::PixelBox;
use shell::options::{check_numbers, check_ranges};
use shell::ranges::{COST, SIDE_PX};

use crate::{Error, Result};

/// Ratio of a box's width to its height, for walking people with arms and legs.
const ASPECT: f64 = 0.41;

/// Options of the detector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectOptions {
    /// Height of the smallest detected person, pixels. Half the height costs four times the time. Default 60.
    pub min_height_px: f64,
    /// Height of the tallest detected person, pixels. Default: no limit.
    pub max_height_px: Option<f64>,
    /// Least score. Default 0.
    pub min_score: f64,
    /// Ratio of consecutive scales of the image pyramid. Default 1.05.
    pub scale_step: f64,
    /// Overlap (IoU) of two boxes above which only the one with the higher score is kept. Default 0.4.
    pub max_overlap: f64,
}

impl Default for DetectOptions {
    fn default() -> Self {
        Self { min_height_px: 60.0, max_height_px: None, min_score: 0.0, scale_step: 1.05, max_overlap: 0.4 }
    }
}

impl DetectOptions {
    /// Checks the options.
    ///
    /// # Errors
    /// Names the first invalid option.
    pub fn check(&self) -> Result<()> {
        check_numbers(
            [("min_height_px", self.min_height_px)],
            |px| (12.0..=SIDE_PX.most).contains(&px),
            &format!("pixels from 12 to {}", SIDE_PX.most),
        )?;
        if self.max_height_px.is_some_and(|max| max.is_nan() || max < self.min_height_px) {
            return Err(Error::option(
                "max_height_px",
                format!("is less than the least height, {} pixels", self.min_height_px),
            ));
        }
        if !(self.scale_step > 1.0 && self.scale_step <= 2.0) {
            return Err(Error::option(
                "scale_step",
                format!("is {}; give a ratio from 1.01 to 2", self.scale_step),
            ));
        }
        check_ranges([("min_score", self.min_score, COST)])?;
        if !(0.0..=1.0).contains(&self.max_overlap) {
            return Err(Error::option("max_overlap", format!("is {}; give 0 to 1", self.max_overlap)));
        }
        Ok(())
    }
}

/// A detection of a person in a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectedPerson {
    /// Box of the person.
    pub pixel_box: PixelBox,
    /// Distance from the classifier's boundary; higher is more certain.
    pub score: f64,
}

/// Detector of people.
pub struct Detector {
    classifier: PeopleClassifier,
    options: DetectOptions,
}

impl Detector {
    /// Detector with these weights.
    ///
    /// # Errors
    /// Invalid options, or a wrong number of weights.
    pub fn new(weights: &[f32], options: DetectOptions) -> Result<Self> {
        options.check()?;
        Ok(Self { classifier: PeopleClassifier::new(weights)?, options })
    }

    /// Detections in a picture, the highest score first.
    ///
    /// # Errors
    /// An error of OpenCV.
    pub fn look(&self, image: &RgbImage) -> Result<Vec<DetectedPerson>> {
        let zoom = f64::from(PERSON_HEIGHT_PX) / self.options.min_height_px;
        let windows =
            self.classifier.windows(image, zoom, self.options.scale_step, self.options.min_score)?;
        let tallest = self.options.max_height_px.unwrap_or(f64::INFINITY);
        let found = windows
            .into_iter()
            .map(|(window, score)| DetectedPerson { pixel_box: person_in(&window), score });
        let fitting: Vec<DetectedPerson> = found.filter(|f| f.pixel_box.height <= tallest).collect();
        Ok(suppress::keep_surest(&fitting, self.options.max_overlap))
    }
}

/// Box of the person in a window of the classifier.
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

/// Window of the classifier for a person, which has their height whatever their width.
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
pub fn rows(frame: u32, found: &[DetectedPerson]) -> String {
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
