//! The outline of a body as points in space, and the box around the whole body: for film and files.
//!
//! Seen from a point outside it, an ellipsoid's outline touches it along a planar curve. Scaled to the unit sphere with
//! the camera at `e`, that curve is the circle of points `p` with `p·e = 1`. Its points in space project through any lens,
//! so outlines and boxes in real pixels are exact with distortion too.

use calib::Camera;
use nalgebra::{Point2, Point3, Vector3};

use super::Body;

/// Enough for a smooth outline, and for a box that is right to a thousandth of its size.
const POINTS: usize = 64;

/// The outline of `body` seen from `eye` (world frame), as points in space, in order, implicitly closed. Empty when the
/// eye is inside the body.
pub fn points(body: &Body, eye: &Point3<f64>) -> Vec<Point3<f64>> {
    let axes = body.semi_axes();
    let e: Vector3<f64> = (eye - body.center()).component_div(&axes);
    let distance_squared = e.norm_squared();
    if distance_squared <= 1.0 || !distance_squared.is_finite() {
        return Vec::new();
    }
    let middle = e / distance_squared;
    let radius = (1.0 - 1.0 / distance_squared).sqrt();
    // Any two directions across `e`; the one least along it makes the best start.
    let start = if e.x.abs() < e.y.abs().min(e.z.abs()) {
        Vector3::x()
    } else if e.y.abs() < e.z.abs() {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let across = e.cross(&start).normalize();
    let up = e.cross(&across).normalize();
    (0..POINTS)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / POINTS as f64).sin_cos();
            body.center() + (middle + (across * cos + up * sin) * radius).component_mul(&axes)
        })
        .collect()
}

/// The box around the whole body in a camera's (real) image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageBox {
    /// Left edge, pixels; may lie outside the image.
    pub left: f64,
    /// Top edge, pixels.
    pub top: f64,
    /// Width, pixels.
    pub width: f64,
    /// Height, pixels.
    pub height: f64,
}

/// The box around the whole body, hidden and cut-off parts included, in the image of `camera` with its distortion.
///
/// `None` when nothing of it falls into the image. A body that reaches behind the camera or out of the lens's range gets
/// the box of what can be projected.
pub fn bounding_box(body: &Body, camera: &Camera) -> Option<ImageBox> {
    let outline = points(body, &camera.center());
    let pixels: Vec<Point2<f64>> = outline.iter().filter_map(|p| camera.project(p)).collect();
    let first = pixels.first()?;
    let (low, high) = pixels.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    let k = &camera.intrinsics;
    let outside = high.x < -0.5
        || high.y < -0.5
        || low.x > f64::from(k.width) - 0.5
        || low.y > f64::from(k.height) - 0.5;
    (!outside).then(|| ImageBox { left: low.x, top: low.y, width: high.x - low.x, height: high.y - low.y })
}
