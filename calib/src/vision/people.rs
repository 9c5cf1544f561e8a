//! People by histograms of oriented gradients and a linear classifier (N. Dalal, B. Triggs, "Histograms of oriented
//! gradients for human detection", CVPR 2005), with the weights that OpenCV brings or with one's own.

use image::RgbImage;
use opencv::core::{self, Mat, Point2f, Scalar, Size, Vector};
use opencv::imgproc;
use opencv::objdetect::HOGDescriptor;
use opencv::prelude::*;

use super::adapter;
use crate::{Error, Result};

/// The window that is classified, pixels.
pub const WINDOW_PX: (u32, u32) = (64, 128);
/// A person's height in it: the rest is margin above and below, the same on both sides.
pub const PERSON_HEIGHT_PX: u32 = 96;
/// Windows are tried every so many pixels.
const STRIDE_PX: i32 = 8;

/// A rectangle of an image, pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
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
}

impl PeopleClassifier {
    /// A classifier by its weights, one for each feature and the bias behind them.
    ///
    /// # Errors
    /// A wrong number of weights; when OpenCV refuses.
    pub fn new(weights: &[f32]) -> Result<Self> {
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
        Ok(Self { hog })
    }

    /// OpenCV's weights for people, trained on the INRIA Person Dataset.
    ///
    /// # Errors
    /// When OpenCV refuses.
    pub fn inria_weights() -> Result<Vec<f32>> {
        let weights = HOGDescriptor::get_default_people_detector();
        Ok(weights.map_err(adapter::refused("looking for OpenCV's detector"))?.to_vec())
    }

    /// The features of a window of an image, brought to [`WINDOW_PX`]; beyond the image's rim its edge is repeated.
    ///
    /// # Errors
    /// When OpenCV refuses.
    pub fn features(&self, image: &RgbImage, window: &Window) -> Result<Vec<f32>> {
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

    /// Every window of the image, enlarged `zoom` times and reduced by `scale_step` again and again, that is classified
    /// above `least`: with its score, the surest first, in the image's own pixels.
    ///
    /// # Errors
    /// When OpenCV refuses.
    pub fn windows(
        &self,
        image: &RgbImage,
        zoom: f64,
        scale_step: f64,
        least: f64,
    ) -> Result<Vec<(Window, f64)>> {
        let refused = adapter::refused("looking for people");
        let mut zoomed = Mat::default();
        let kind = if zoom < 1.0 { imgproc::INTER_AREA } else { imgproc::INTER_LINEAR };
        imgproc::resize(&adapter::rgb(image)?, &mut zoomed, Size::default(), zoom, zoom, kind)
            .map_err(&refused)?;
        let (mut places, mut scores) = (Vector::new(), Vector::<f64>::new());
        if zoomed.cols() < WINDOW_PX.0 as i32 || zoomed.rows() < WINDOW_PX.1 as i32 {
            return Ok(Vec::new());
        }
        self.hog
            .detect_multi_scale_weights(
                &zoomed,
                &mut places,
                &mut scores,
                least,
                Size::new(STRIDE_PX, STRIDE_PX),
                Size::default(),
                scale_step,
                0.0, // What overlaps is sorted out by whoever asks.
                false,
            )
            .map_err(&refused)?;
        let real = |pixels: i32| f64::from(pixels) / zoom;
        let mut found: Vec<(Window, f64)> = places
            .iter()
            .zip(scores.iter())
            .map(|(r, score)| {
                let window =
                    Window { left: real(r.x), top: real(r.y), width: real(r.width), height: real(r.height) };
                (window, score)
            })
            .collect();
        // OpenCV's threads leave them in any order.
        let key = |(w, s): &(Window, f64)| [-*s, w.top, w.left, w.height];
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
        let window = Window { left: 128.0, top: 48.0, width: 64.0, height: 128.0 };
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
