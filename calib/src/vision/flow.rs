//! Sparse optical flow: corners worth following, and pyramidal Lucas–Kanade (Bouguet 2000) from one image to the next.

use image::GrayImage;
use nalgebra::Point2;
use opencv::core::{self, Mat, Point2f, Size, TermCriteria, Vector};
use opencv::{imgproc, video};

use super::adapter;
use crate::{Error, Result};

/// Smallest eigenvalue of the window's gradient matrix (per pixel, OpenCV's scale) with which a point can be followed.
const MIN_EIGENVALUE: f64 = 1e-4;
/// Lucas–Kanade steps a level, and the step in pixels at which they end.
const MAX_STEPS: i32 = 30;
const STEP_END_PX: f64 = 0.01;

/// An image at all scales, ready for [`follow`].
pub struct FlowPyramid {
    levels: Vector<Mat>,
    window: i32,
    depth: i32,
    size: (u32, u32),
}

impl FlowPyramid {
    /// Builds the pyramid: halves the image up to `depth` times; `window_px` is the odd side of the square that is
    /// compared.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`] when OpenCV refuses, for example for an image smaller than the window.
    pub fn new(image: &GrayImage, window_px: u32, depth: u32) -> Result<Self> {
        let window = window_px.max(3) as i32;
        let mut levels = Vector::new();
        let depth = video::build_optical_flow_pyramid(
            &adapter::gray(image)?,
            &mut levels,
            Size::new(window, window),
            depth as i32,
            true,
            core::BORDER_REFLECT_101,
            core::BORDER_CONSTANT,
            false, // The pyramid outlives the picture: copy it.
        )
        .map_err(adapter::refused("building an image pyramid"))?;
        Ok(Self { levels, window, depth, size: image.dimensions() })
    }
}

/// Follows each of `points` from one image to the next, starting the search at the same index of `guesses`.
///
/// `None` where the point was lost: too little texture, or outside the next image.
///
/// # Errors
/// [`Error::Invalid`] when the counts or image sizes differ; or OpenCV refuses.
pub fn follow(
    from: &FlowPyramid,
    to: &FlowPyramid,
    points: &[Point2<f64>],
    guesses: &[Point2<f64>],
) -> Result<Vec<Option<Point2<f64>>>> {
    if points.len() != guesses.len() || from.size != to.size {
        return Err(Error::Invalid(format!(
            "optical flow: {} points with {} guesses, images of {:?} and {:?} pixels",
            points.len(),
            guesses.len(),
            from.size,
            to.size
        )));
    }
    if points.is_empty() {
        return Ok(Vec::new());
    }
    let refused = adapter::refused("following points");
    let single = |p: &Point2<f64>| Point2f::new(p.x as f32, p.y as f32);
    let starts: Vector<Point2f> = points.iter().map(single).collect();
    let mut ends: Vector<Point2f> = guesses.iter().map(single).collect();
    let (mut status, mut error) = (Vector::<u8>::new(), Vector::<f32>::new());
    let criteria =
        TermCriteria::new(core::TermCriteria_COUNT + core::TermCriteria_EPS, MAX_STEPS, STEP_END_PX)
            .map_err(&refused)?;
    video::calc_optical_flow_pyr_lk(
        &from.levels,
        &to.levels,
        &starts,
        &mut ends,
        &mut status,
        &mut error,
        Size::new(from.window, from.window),
        from.depth.min(to.depth),
        criteria,
        video::OPTFLOW_USE_INITIAL_FLOW,
        MIN_EIGENVALUE,
    )
    .map_err(&refused)?;
    let (width, height) = (to.size.0 as f32, to.size.1 as f32);
    let inside = |p: &Point2f| (0.0..width).contains(&p.x) && (0.0..height).contains(&p.y);
    Ok(ends
        .iter()
        .zip(status.iter())
        .map(|(end, found)| {
            (found == 1 && inside(&end)).then(|| Point2::new(f64::from(end.x), f64::from(end.y)))
        })
        .collect())
}

/// Finds corners after Shi and Tomasi (1994), the strongest first, at whole pixels.
///
/// `block_px` is the window of the gradient matrix; corners weaker than `quality` times the strongest are left out.
///
/// # Errors
/// [`crate::Error::OpenCv`] when OpenCV refuses.
pub fn corners(
    image: &GrayImage,
    at_most: usize,
    quality: f64,
    min_distance_px: f64,
    block_px: u32,
) -> Result<Vec<Point2<f64>>> {
    let mut found = Vector::<Point2f>::new();
    imgproc::good_features_to_track(
        &adapter::gray(image)?,
        &mut found,
        at_most as i32,
        quality,
        min_distance_px,
        &Mat::default(),
        block_px as i32,
        false,
        0.04,
    )
    .map_err(adapter::refused("finding corners"))?;
    Ok(found.iter().map(|p| Point2::new(f64::from(p.x), f64::from(p.y))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    /// A smooth pattern without repeats nearby, moved by (dx, dy).
    fn pattern(dx: f64, dy: f64) -> GrayImage {
        GrayImage::from_fn(160, 120, |u, v| {
            let (x, y) = (f64::from(u) - dx, f64::from(v) - dy);
            let waves =
                (0.21 * x + 0.07 * y).sin() + (0.05 * x - 0.26 * y).cos() + (0.11 * x * y / 40.0).sin();
            Luma([(128.0 + 40.0 * waves) as u8])
        })
    }

    #[test]
    fn a_known_shift_is_found() {
        let (first, second) = (pattern(0.0, 0.0), pattern(3.4, -2.6));
        let points = corners(&first, 50, 0.01, 8.0, 5).unwrap();
        assert!(points.len() > 10, "{}", points.len());
        let pyramids = [&first, &second].map(|image| FlowPyramid::new(image, 21, 3).unwrap());
        let inner: Vec<_> = points
            .into_iter()
            .filter(|p| (20.0..140.0).contains(&p.x) && (20.0..100.0).contains(&p.y))
            .collect();
        let ends = follow(&pyramids[0], &pyramids[1], &inner, &inner).unwrap();
        for (start, end) in inner.iter().zip(ends) {
            let shift = end.unwrap() - start;
            assert!((shift.x - 3.4).abs() < 0.1 && (shift.y + 2.6).abs() < 0.1, "{start} moved by {shift}");
        }
    }

    #[test]
    fn a_blank_image_has_no_corners_and_loses_points() {
        let blank = GrayImage::from_pixel(64, 48, Luma([90]));
        assert!(corners(&blank, 10, 0.01, 5.0, 5).unwrap().is_empty());
        let pyramid = FlowPyramid::new(&blank, 15, 2).unwrap();
        let point = [Point2::new(30.0, 20.0)];
        assert_eq!(follow(&pyramid, &pyramid, &point, &point).unwrap(), [None]);
        assert_eq!(follow(&pyramid, &pyramid, &[], &[]).unwrap(), []);
        assert!(follow(&pyramid, &pyramid, &point, &[]).is_err());
    }
}
