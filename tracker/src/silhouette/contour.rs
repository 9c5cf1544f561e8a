//! Outline of a body as points in space, and the box around the whole body: for films and files.
//!
//! Seen from a point outside it, an ellipsoid's outline touches it along a planar curve. Scaled to the unit sphere with
//! the camera at `e`, that curve is the circle of points `p` with `p·e = 1`. Its points in space can be projected
//! through any lens, so outlines and boxes in real pixels are exact with distortion, too.

use calib::Camera;
use mot::rows::PixelBox;
use nalgebra::{Point2, Point3, Vector3};

use super::{Body, Ellipsoid};

/// Number of outline points: enough for a smooth outline, and for a box with an error of 1/3000 of its size.
const POINTS: usize = 128;

/// Outline of `body` seen from `eye` (world frame), as ordered points in space, implicitly closed. Empty when the eye
/// is inside the body.
pub fn points(body: &Body, eye: &Point3<f64>) -> Vec<Point3<f64>> {
    let Ellipsoid { center, semi_axes: axes } = body.ellipsoid();
    let e: Vector3<f64> = (eye - center).component_div(&axes);
    let distance_squared = e.norm_squared();
    if distance_squared <= 1.0 || !distance_squared.is_finite() {
        return Vec::new();
    }
    let middle = e / distance_squared;
    let radius = (1.0 - 1.0 / distance_squared).sqrt();
    // Two directions perpendicular to `e`; the axis least along it gives the best conditioned cross product.
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
            center + (middle + (across * cos + up * sin) * radius).component_mul(&axes)
        })
        .collect()
}

/// Box around the whole body, hidden and cut-off parts included, in the image of `camera` with its distortion.
///
/// `None` when no part of it falls into the image. A body that reaches behind the camera or out of the lens's range
/// gets the box of its projectable points, cut at the image's edges.
pub fn bounding_box(body: &Body, camera: &Camera) -> Option<PixelBox> {
    let outline = points(body, &camera.center());
    let pixels: Vec<Point2<f64>> = outline.iter().filter_map(|p| camera.project(p)).collect();
    let first = pixels.first()?;
    let (mut low, mut high) =
        pixels.iter().fold((*first, *first), |(low, high), p| (low.inf(p), high.sup(p)));
    let k = &camera.intrinsics;
    let corner = Point2::new(-0.5, -0.5);
    let edge = Point2::new(f64::from(k.width) - 0.5, f64::from(k.height) - 0.5);
    if high.x < corner.x || high.y < corner.y || low.x > edge.x || low.y > edge.y {
        return None;
    }
    if pixels.len() < outline.len() {
        (low, high) = (low.sup(&corner), high.inf(&edge));
    }
    let size = high - low;
    (size.min() > 0.0).then_some(PixelBox { left: low.x, top: low.y, width: size.x, height: size.y })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use calib::Intrinsics;
    use nalgebra::{Isometry3, Matrix4};
    use proptest::prelude::*;

    fn looking(eye: [f64; 3], target: [f64; 3], distortion: [f64; 5]) -> Camera {
        let pose = Isometry3::face_towards(&Point3::from(eye), &Point3::from(target), &-Vector3::z());
        let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 75.0);
        intrinsics.distortion = distortion.into();
        Camera { intrinsics, camera_from_world: pose.inverse() }
    }

    /// Closed form for a pinhole: the dual conic P Q* Pᵀ of the ellipsoid's dual quadric touches the box's sides.
    fn dual_conic_box(body: &Body, camera: &Camera) -> PixelBox {
        let half = 0.5 * body.height_m;
        let r2 = body.radius_m * body.radius_m;
        let mut shift = Matrix4::identity();
        shift.fixed_view_mut::<3, 1>(0, 3).copy_from(&(body.ellipsoid().center.coords));
        let quadric = shift * Matrix4::from_diagonal(&[r2, r2, half * half, -1.0].into()) * shift.transpose();
        let pose = camera.camera_from_world.to_homogeneous();
        let p = camera.intrinsics.matrix() * pose.fixed_view::<3, 4>(0, 0);
        let c = p * quadric * p.transpose();
        let side = |i: usize, sign: f64| {
            (c[(i, 2)] + sign * (c[(i, 2)] * c[(i, 2)] - c[(i, i)] * c[(2, 2)]).sqrt()) / c[(2, 2)]
        };
        // C33 is negative in front of the camera, so the positive root is the smaller one.
        let (left, right, top, bottom) = (side(0, 1.0), side(0, -1.0), side(1, 1.0), side(1, -1.0));
        PixelBox { left, top, width: right - left, height: bottom - top }
    }

    proptest! {
        #[test]
        fn the_box_is_the_dual_conics(x in 1.5..6.0f64, y in -2.0..2.0f64, r in 0.15..0.4f64, h in 1.2..2.0f64) {
            let camera = looking([0.0, 0.3, 2.2], [4.0, 0.0, 0.8], [0.0; 5]);
            let body = Body { x_m: x, y_m: y, radius_m: r, height_m: h };
            let exact = dual_conic_box(&body, &camera);
            let allowed = exact.height * 1e-3;
            let Some(found) = bounding_box(&body, &camera) else {
                // Outside the image, or at its border as far as the polygon is inexact.
                let is_beyond = |start: f64, length: f64, size: f64| {
                    start > size - 0.5 - allowed || start + length < allowed - 0.5
                };
                let (beside, above) = (is_beyond(exact.left, exact.width, 640.0), is_beyond(exact.top, exact.height, 480.0));
                prop_assert!(beside || above, "{exact:?} has no box");
                return Ok(());
            };
            prop_assert!((found.left - exact.left).abs() < allowed && (found.top - exact.top).abs() < allowed);
            prop_assert!((found.width - exact.width).abs() < allowed && (found.height - exact.height).abs() < allowed);
        }
    }

    #[test]
    fn distortion_moves_the_box_to_where_the_lens_shows_it() {
        let (eye, target) = ([0.0, 0.0, 1.5], [5.0, 0.0, 1.0]);
        let body = Body { x_m: 4.0, y_m: 1.9, radius_m: 0.25, height_m: 1.75 };
        let straight = bounding_box(&body, &looking(eye, target, [0.0; 5])).unwrap();
        let barrel = looking(eye, target, [-0.25, 0.05, 0.0, 0.0, 0.0]);
        let bent = bounding_box(&body, &barrel).unwrap();
        // A barrel pulls things towards the middle; each side agrees with a densely sampled surface.
        assert!(bent.left > straight.left + 5.0);
        let mut left = f64::INFINITY;
        for i in 0..400 {
            for j in 0..400 {
                let (theta, phi) = (
                    i as f64 / 400.0 * std::f64::consts::TAU,
                    (j as f64 / 399.0 - 0.5) * std::f64::consts::PI,
                );
                let p = Point3::new(
                    4.0 + 0.25 * phi.cos() * theta.cos(),
                    1.9 + 0.25 * phi.cos() * theta.sin(),
                    0.875 + 0.875 * phi.sin(),
                );
                left = left.min(barrel.project(&p).unwrap().x);
            }
        }
        assert_relative_eq!(bent.left, left, epsilon = 0.05);
    }

    #[test]
    fn a_body_outside_the_image_has_no_box() {
        let camera = looking([0.0, 0.0, 2.0], [4.0, 0.0, 1.0], [0.0; 5]);
        let at = |x: f64, y: f64, r: f64| {
            bounding_box(&Body { x_m: x, y_m: y, radius_m: r, height_m: 1.7 }, &camera)
        };
        assert!(at(4.0, 0.0, 0.25).is_some());
        assert_eq!(at(-4.0, 0.0, 0.25), None);
        assert_eq!(at(1.0, 30.0, 0.25), None);
        assert_eq!(at(4.0, 0.0, 0.0), None);
        assert_eq!(at(f64::NAN, 0.0, 0.25), None);
        // Around the camera itself, and reaching behind it.
        let inside = Body { x_m: 0.0, y_m: 0.0, radius_m: 1.0, height_m: 4.0 };
        assert_eq!(bounding_box(&inside, &camera), None);
        let around = Body { x_m: 0.6, y_m: 0.0, radius_m: 0.55, height_m: 4.0 };
        if let Some(cut) = bounding_box(&around, &camera) {
            assert!(cut.left >= -0.5 && cut.left + cut.width <= 639.5);
        }
    }
}
