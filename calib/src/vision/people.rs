//! People by histograms of oriented gradients and a linear classifier (N. Dalal, B. Triggs, "Histograms of oriented
//! gradients for human detection", CVPR 2005), with the weights that OpenCV brings or with one's own.

use image::RgbImage;
use opencv::core::{self, Mat, Point2f, Scalar, Size, Vector};
use opencv::imgproc;
use opencv::objdetect::HOGDescriptor;
use opencv::prelude::*;
use rayon::prelude::*;

use super::adapter;
use crate::{Error, Result};

/// Size of the window that is classified, pixels.
pub const WINDOW_PX: (u32, u32) = (64, 128);
/// Height of a person in the window: the rest is margin above and below, the same on both sides.
pub const PERSON_HEIGHT_PX: u32 = 96;
/// Step between windows, pixels.
const STRIDE_PX: i32 = 8;
/// Largest number of sizes of an image that are searched.
const MOST_LEVELS: usize = 64;

/// A rectangle of an image, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectionWindow {
    /// Left edge.
    pub left: f64,
    /// Top edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

/// A classifier of windows.
pub struct PeopleClassifier {
    hog: HOGDescriptor,
    weights: Vec<f32>,
}

impl PeopleClassifier {
    /// Builds a classifier from its weights, one for each feature and the bias after them.
    ///
    /// # Errors
    /// [`crate::Error`] for a wrong number of weights, or when OpenCV refuses.
    pub fn new(weights: &[f32]) -> Result<Self> {
        Ok(Self { hog: hog(weights)?, weights: weights.to_vec() })
    }

    /// OpenCV's weights for people, trained on the INRIA Person Dataset.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn inria_weights() -> Result<Vec<f32>> {
        let weights = HOGDescriptor::get_default_people_detector();
        Ok(weights.map_err(adapter::refused("looking for OpenCV's detector"))?.to_vec())
    }

    /// Features of a window of an image, resized to [`WINDOW_PX`]; beyond the image's rim its edge is repeated.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn features(&self, image: &RgbImage, window: &DetectionWindow) -> Result<Vec<f32>> {
        let refused = adapter::refused("computing gradients");
        let (width, height) = (WINDOW_PX.0 as f32, WINDOW_PX.1 as f32);
        let corner = |u: f64, v: f64| {
            Point2f::new((window.left + u * window.width) as f32, (window.top + v * window.height) as f32)
        };
        let from: Vector<Point2f> =
            [corner(0.0, 0.0), corner(1.0, 0.0), corner(0.0, 1.0)].into_iter().collect();
        let to: Vector<Point2f> =
            [Point2f::new(0.0, 0.0), Point2f::new(width, 0.0), Point2f::new(0.0, height)]
                .into_iter()
                .collect();
        let transform = imgproc::get_affine_transform(&from, &to).map_err(&refused)?;
        let mut crop = Mat::default();
        imgproc::warp_affine(
            &adapter::rgb(image)?,
            &mut crop,
            &transform,
            Size::new(WINDOW_PX.0 as i32, WINDOW_PX.1 as i32),
            imgproc::INTER_LINEAR,
            core::BORDER_REPLICATE,
            Scalar::default(),
        )
        .map_err(&refused)?;
        let mut features = Vector::<f32>::new();
        self.hog.compute_def(&crop, &mut features).map_err(&refused)?;
        Ok(features.to_vec())
    }

    /// Windows classified above `least`, with their scores, the highest first, in the image's own pixels; the image is
    /// enlarged `zoom` times and reduced by `scale_step` repeatedly.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses.
    pub fn windows(
        &self,
        image: &RgbImage,
        zoom: f64,
        scale_step: f64,
        least: f64,
    ) -> Result<Vec<(DetectionWindow, f64)>> {
        let refused = adapter::refused("looking for people");
        let mut zoomed = Mat::default();
        let kind = if zoom < 1.0 { imgproc::INTER_AREA } else { imgproc::INTER_LINEAR };
        imgproc::resize(&adapter::rgb(image)?, &mut zoomed, Size::default(), zoom, zoom, kind)
            .map_err(&refused)?;
        if zoomed.cols() < WINDOW_PX.0 as i32 || zoomed.rows() < WINDOW_PX.1 as i32 {
            return Ok(Vec::new());
        }
        let size = (zoomed.cols() as u32, zoomed.rows() as u32);
        let bytes = zoomed.data_bytes().map_err(&refused)?.to_vec();
        let Some(zoomed) = RgbImage::from_raw(size.0, size.1, bytes) else { return Ok(Vec::new()) };
        // OpenCV's detectMultiScale is not used: its threads mix up the scores of different windows.
        let weights = &self.weights;
        let levels: Result<Vec<Vec<(core::Rect, f64)>>> = levels(size, scale_step)
            .into_par_iter()
            .map(|scale| level(&hog(weights)?, &zoomed, scale, least))
            .collect();
        let real = |pixels: i32| f64::from(pixels) / zoom;
        let mut found: Vec<(DetectionWindow, f64)> = levels?
            .into_iter()
            .flatten()
            .map(|(r, score)| {
                let window = DetectionWindow {
                    left: real(r.x),
                    top: real(r.y),
                    width: real(r.width),
                    height: real(r.height),
                };
                (window, score)
            })
            .collect();
        let key = |(w, s): &(DetectionWindow, f64)| [-*s, w.top, w.left, w.height];
        found.sort_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.iter()
                .zip(b)
                .map(|(a, b)| a.total_cmp(&b))
                .find(|o| o.is_ne())
                .unwrap_or(std::cmp::Ordering::Equal)
        });
        Ok(found)
    }
}

/// OpenCV's classifier with these weights.
fn hog(weights: &[f32]) -> Result<HOGDescriptor> {
    let refused = adapter::refused("making a detector");
    let mut hog = HOGDescriptor::default().map_err(&refused)?;
    let expected = hog.get_descriptor_size().map_err(&refused)? + 1;
    if weights.len() != expected {
        return Err(Error::Invalid(format!(
            "a detector of people has {expected} weights, but these are {}",
            weights.len()
        )));
    }
    let weights = Mat::from_slice(weights).map_err(&refused)?.try_clone().map_err(&refused)?;
    hog.set_svm_detector_input_array(&weights).map_err(&refused)?;
    Ok(hog)
}

/// Factors by which an image of this width and height is reduced, as long as a window fits.
fn levels((width, height): (u32, u32), step: f64) -> Vec<f64> {
    let scales = std::iter::successors(Some(1.0), |scale| (step > 1.0).then_some(scale * step));
    let fits = |scale: &f64| reduced(width, *scale) >= WINDOW_PX.0 && reduced(height, *scale) >= WINDOW_PX.1;
    scales.take_while(fits).take(MOST_LEVELS).collect()
}

/// Length in the image reduced by this factor, pixels.
fn reduced(pixels: u32, scale: f64) -> u32 {
    (f64::from(pixels) / scale).round_ties_even() as u32
}

/// Windows of an image reduced by this factor that are classified above `least`, in pixels of the image, with their
/// scores.
fn level(hog: &HOGDescriptor, image: &RgbImage, scale: f64, least: f64) -> Result<Vec<(core::Rect, f64)>> {
    let refused = adapter::refused("looking for people");
    let (width, height) = (image.width() as i32, image.height() as i32);
    let size = [width, height].map(|pixels| reduced(pixels as u32, scale) as i32);
    let mut smaller = Mat::default();
    imgproc::resize(
        &adapter::rgb(image)?,
        &mut smaller,
        Size::new(size[0], size[1]),
        0.0,
        0.0,
        imgproc::INTER_LINEAR_EXACT,
    )
    .map_err(&refused)?;
    let (mut places, mut scores) = (Vector::new(), Vector::<f64>::new());
    let stride = Size::new(STRIDE_PX, STRIDE_PX);
    hog.detect_weights(
        &smaller,
        &mut places,
        &mut scores,
        least,
        stride,
        Size::default(),
        &Vector::<core::Point>::new(),
    )
    .map_err(&refused)?;
    let enlarged = |pixels: i32| (f64::from(pixels) * scale).round_ties_even() as i32;
    let rectangle = |place: core::Point| {
        let (left, top) = (enlarged(place.x), enlarged(place.y));
        let [window_width, window_height] = [WINDOW_PX.0, WINDOW_PX.1].map(|pixels| enlarged(pixels as i32));
        core::Rect::new(left, top, window_width.min(width - left), window_height.min(height - top))
    };
    Ok(places.iter().map(rectangle).zip(scores.iter()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// A bright upright figure on dark ground, with its head at (x, top).
    fn figure(x: i64, top: i64) -> RgbImage {
        RgbImage::from_fn(320, 240, |u, v| {
            let (du, dv) = (i64::from(u) - x, i64::from(v) - top);
            let inside = (0..16).contains(&dv) && du.abs() < 8 || (16..96).contains(&dv) && du.abs() < 15;
            if inside { Rgb([230, 225, 220]) } else { Rgb([40, 45, 50]) }
        })
    }

    #[test]
    fn a_classifier_finds_the_window_it_was_made_for() {
        let inria = PeopleClassifier::new(&PeopleClassifier::inria_weights().unwrap()).unwrap();
        let window = DetectionWindow { left: 128.0, top: 48.0, width: 64.0, height: 128.0 };
        let wanted = inria.features(&figure(160, 64), &window).unwrap();
        let other = inria.features(&figure(40, 64), &window).unwrap();
        // The direction from the empty window to the figure's.
        let mut weights: Vec<f32> = wanted.iter().zip(&other).map(|(a, b)| a - b).collect();
        let dot = |f: &[f32]| f.iter().zip(&weights).map(|(a, b)| a * b).sum::<f32>();
        let middle = 0.5 * (dot(&wanted) + dot(&other));
        weights.push(-middle);
        let made = PeopleClassifier::new(&weights).unwrap();
        let found = made.windows(&figure(160, 64), 1.0, 1.1, 0.0).unwrap();
        assert_eq!(found[0].0, window);
        assert!(found.windows(2).all(|w| w[0].1 >= w[1].1));
        // Seen at twice the size, it is where it was.
        let zoomed = made.windows(&figure(160, 64), 2.0, 1.1, 0.0).unwrap();
        assert!((zoomed[0].0.left - 128.0).abs() <= 8.0 && (zoomed[0].0.height - 128.0).abs() <= 16.0);
    }

    #[test]
    fn small_images_hold_nobody_and_wrong_weights_are_refused() {
        let inria = PeopleClassifier::new(&PeopleClassifier::inria_weights().unwrap()).unwrap();
        assert!(inria.windows(&RgbImage::new(20, 20), 1.0, 1.05, -9.0).unwrap().is_empty());
        let error = PeopleClassifier::new(&[1.0, 2.0]).err().unwrap().to_string();
        assert!(error.contains("3781"), "{error}");
    }
}
