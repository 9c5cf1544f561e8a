//! Where a body lies in a real image: the outline of its ellipsoid, and the box around that.
//!
//! The rays from the camera's centre that touch an ellipsoid do so along a plane curve. Where the ellipsoid
//! becomes the unit sphere and the camera the point e outside it, that curve is the circle `s · e = 1` on the
//! sphere (the polar of e), so its points are exact; each is projected with distortion.

use calib::Camera;
use nalgebra::{Matrix3, Point2, Point3, Vector3};

use super::rows::PixelBox;
use crate::PersonEstimate;

/// Points around the outline: the box is then exact to a thirteen-thousandth of its size.
const OUTLINE_POINTS: usize = 256;

/// An upright ellipsoid that stands on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Where it stands, metres.
    pub foot: Point3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
    /// Height, metres.
    pub height_m: f64,
}

impl From<&PersonEstimate> for Body {
    fn from(person: &PersonEstimate) -> Self {
        // Methods that follow a head say how high it is; the body still stands on the floor.
        let foot = Point3::new(person.x_m, person.y_m, 0.0);
        Self { foot, radius_m: person.radius_m, height_m: person.height_m }
    }
}

impl Body {
    /// Its outline in the camera's image, in order; the points that do not project (behind the camera, beyond the
    /// lens) are left out. Empty when the camera stands inside the body, or the body has no size.
    pub fn outline(&self, camera: &Camera, points: usize) -> Vec<Point2<f64>> {
        let half_height = 0.5 * self.height_m;
        let center = self.foot + Vector3::z() * half_height;
        let axes = Vector3::new(self.radius_m, self.radius_m, half_height);
        if !(axes.min() > 0.0 && axes.iter().all(|a| a.is_finite())) {
            return Vec::new();
        }
        let eye = (camera.center() - center).component_div(&axes);
        let distance = eye.norm();
        if !(distance > 1.0 && distance.is_finite()) {
            return Vec::new();
        }
        let towards_eye = eye / distance;
        // Any two directions across the line of sight will do.
        let across = towards_eye.cross(&Vector3::z()).try_normalize(1e-9).unwrap_or_else(Vector3::x);
        let up = across.cross(&towards_eye);
        let radius = (1.0 - 1.0 / (distance * distance)).sqrt();
        let stretch = Matrix3::from_diagonal(&axes);
        (0..points)
            .filter_map(|i| {
                let (sine, cosine) = (std::f64::consts::TAU * i as f64 / points as f64).sin_cos();
                let on_sphere = towards_eye / distance + radius * (cosine * across + sine * up);
                camera.project(&(center + stretch * on_sphere))
            })
            .collect()
    }

    /// The box around the whole body, hidden or not, in the camera's pixels; it may reach beyond the image.
    ///
    /// `None` when nothing of it is in the image. A body that reaches behind the camera is cut at the image's edge.
    pub fn pixel_box(&self, camera: &Camera) -> Option<PixelBox> {
        let outline = self.outline(camera, OUTLINE_POINTS);
        let first = *outline.first()?;
        let (mut low, mut high) =
            outline.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        let k = &camera.intrinsics;
        let edge = Point2::new(k.width as f64 - 0.5, k.height as f64 - 0.5);
        let is_in_image = low.x < edge.x && low.y < edge.y && high.x > -0.5 && high.y > -0.5;
        if !is_in_image {
            return None;
        }
        if outline.len() < OUTLINE_POINTS {
            (low, high) = (low.sup(&Point2::new(-0.5, -0.5)), high.inf(&edge));
        }
        let size = high - low;
        (size.min() > 0.0).then_some(PixelBox { left: low.x, top: low.y, width: size.x, height: size.y })
    }
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
        shift.fixed_view_mut::<3, 1>(0, 3).copy_from(&(body.foot.coords + Vector3::z() * half));
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
            let body = Body { foot: Point3::new(x, y, 0.0), radius_m: r, height_m: h };
            let exact = dual_conic_box(&body, &camera);
            if let Some(found) = body.pixel_box(&camera) {
                let allowed = exact.height * 1e-3;
                prop_assert!((found.left - exact.left).abs() < allowed && (found.top - exact.top).abs() < allowed);
                prop_assert!((found.width - exact.width).abs() < allowed && (found.height - exact.height).abs() < allowed);
            }
        }
    }

    #[test]
    fn distortion_moves_the_box_to_where_the_lens_shows_it() {
        let (eye, target) = ([0.0, 0.0, 1.5], [5.0, 0.0, 1.0]);
        let body = Body { foot: Point3::new(4.0, 1.9, 0.0), radius_m: 0.25, height_m: 1.75 };
        let straight = body.pixel_box(&looking(eye, target, [0.0; 5])).unwrap();
        let barrel = looking(eye, target, [-0.25, 0.05, 0.0, 0.0, 0.0]);
        let bent = body.pixel_box(&barrel).unwrap();
        // A barrel pulls things towards the middle; each side lies where a densely sampled surface says.
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
    fn what_is_not_in_the_image_has_no_box() {
        let camera = looking([0.0, 0.0, 2.0], [4.0, 0.0, 1.0], [0.0; 5]);
        let at = |x: f64, y: f64, r: f64| {
            Body { foot: Point3::new(x, y, 0.0), radius_m: r, height_m: 1.7 }.pixel_box(&camera)
        };
        assert!(at(4.0, 0.0, 0.25).is_some());
        assert_eq!(at(-4.0, 0.0, 0.25), None);
        assert_eq!(at(1.0, 30.0, 0.25), None);
        assert_eq!(at(4.0, 0.0, 0.0), None);
        assert_eq!(at(f64::NAN, 0.0, 0.25), None);
        // Around the camera itself, and reaching behind it.
        let inside = Body { foot: Point3::new(0.0, 0.0, 0.0), radius_m: 1.0, height_m: 4.0 };
        assert_eq!(inside.pixel_box(&camera), None);
        let around = Body { foot: Point3::new(0.6, 0.0, 0.0), radius_m: 0.55, height_m: 4.0 };
        if let Some(cut) = around.pixel_box(&camera) {
            assert!(cut.left >= -0.5 && cut.left + cut.width <= 639.5);
        }
    }
}
