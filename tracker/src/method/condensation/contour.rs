//! Contour of a head in a camera (section 4.2, figures 10 and 11): an exact projection of a spheroid.
//!
//! Scale space so that the spheroid becomes the unit sphere and its centre the origin; the camera's centre goes to `o`.
//! The points of the sphere with tangent rays are a circle around `o / |o|²` of radius `√(1 − 1/|o|²)`,
//!
//! ```text
//! q(φ) = ô / |o| + √(1 − 1/|o|²) (cos φ e₁ + sin φ e₂)        e₁: upwards, e₁ ⊥ e₂ ⊥ ô
//! ```
//!
//! and their images are the contour. Pixel and normal of a point are linear in `(1, cos φ, sin φ)` before the division,
//! so a contour costs two dozen products for the head and a dozen for each point. The tangent plane at `q` contains the
//! camera, so its image is a line: the tangent of the contour, with normal `N`.

use glam::{Mat3A, Vec3A};
use nalgebra::{Matrix3, Point3, Vector3};

use super::edges::OutlinePoints;
use super::options::HeadModel;
use crate::prepared_room::PreparedCamera;

/// Number of contour points of a head: a head of five pixels' radius has one every pixel of its upper part.
pub const POINTS: usize = 16;

/// A camera prepared for contours of heads of one shape. Its results are single precision, because nothing is estimated
/// from them beyond a weight.
#[derive(Debug, Clone)]
pub struct HeadCamera {
    /// Centre of the camera, metres.
    pub center: Point3<f64>,
    shape: HeadShape,
    /// Matrix from directions, scaled so that the head is the unit sphere, to homogeneous pixels.
    projection: Mat3A,
    /// Matrix from normals of the unit sphere to normals in the image (x and y matter).
    image_from_normal: Mat3A,
    /// The image's upward direction, scaled likewise.
    up: Vec3A,
}

/// Shape of the heads whose contours are computed.
#[derive(Debug, Clone)]
pub struct HeadShape {
    semi_axes: Vector3<f64>,
    cosines: [f32; POINTS],
    sines: [f32; POINTS],
}

/// Contour points in the image of one camera, from one side over the top to the other, with their outward normals (N).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contour {
    /// Pixel of the contour's centre.
    pub middle: [f32; 2],
    /// Contour points.
    pub outline: OutlinePoints<POINTS>,
}

impl Contour {
    /// Distance from the centre to the top, pixels.
    pub fn half_height_px(&self) -> f32 {
        let OutlinePoints { u, v, .. } = &self.outline;
        length(u[POINTS / 2] - self.middle[0], v[POINTS / 2] - self.middle[1])
    }
}

impl HeadCamera {
    /// Prepares the pinhole camera of a camera of the room.
    pub fn new(camera: &PreparedCamera, shape: &HeadShape) -> Self {
        let k = &camera.pinhole.intrinsics;
        let rotation = camera.pinhole.camera_from_world.rotation.to_rotation_matrix();
        let focal = Matrix3::from_diagonal(&Vector3::new(1.0 / k.fx, 1.0 / k.fy, 1.0));
        let axes = Matrix3::from_diagonal(&shape.semi_axes);
        let per_axis = Matrix3::from_diagonal(&shape.semi_axes.map(f64::recip));
        Self {
            center: camera.pinhole.center(),
            projection: single(&(k.matrix() * rotation.matrix() * axes)),
            image_from_normal: single(&(focal * rotation.matrix() * per_axis)),
            up: -single(&(per_axis * rotation.matrix().transpose())).y_axis,
            shape: shape.clone(),
        }
    }

    /// Contour of a head with centre `head`; `None` where the camera is inside it, or part of it is not in front of the
    /// camera.
    pub fn contour(&self, head: &Vector3<f64>) -> Option<Contour> {
        /// Sine of the angle to the vertical below which the image's upward direction replaces the world's.
        const STEEP: f32 = 0.1;
        let o = (self.center.coords - head).component_div(&self.shape.semi_axes);
        let o = Vec3A::new(o.x as f32, o.y as f32, o.z as f32);
        let squared = o.length_squared();
        if squared.is_nan() || squared <= 1.0 {
            return None;
        }
        let per_squared = squared.recip();
        let towards = o * per_squared.sqrt();
        let upwards = Vec3A::Z - towards * towards.z;
        let e1 = if upwards.length_squared() > STEEP * STEEP {
            upwards.normalize()
        } else {
            (self.up - towards * towards.dot(self.up)).try_normalize()?
        };
        let radius = (1.0 - per_squared).sqrt();
        let [q0, q1, q2] = [o * per_squared, e1 * radius, towards.cross(e1) * radius];
        // The camera's centre is the origin of homogeneous pixels.
        let p = [q0 - o, q1, q2].map(|q| self.projection * q);
        let n = [q0, q1, q2].map(|q| self.image_from_normal * q);
        // The nearest point of the circle.
        if p[0].z <= length(p[1].z, p[2].z) + f32::EPSILON {
            return None;
        }
        let mut outline = OutlinePoints::default();
        for i in 0..POINTS {
            let (c, s) = (self.shape.cosines[i], self.shape.sines[i]);
            let per_depth = 1.0 / (p[0].z + c * p[1].z + s * p[2].z);
            outline.u[i] = (p[0].x + c * p[1].x + s * p[2].x) * per_depth;
            outline.v[i] = (p[0].y + c * p[1].y + s * p[2].y) * per_depth;
            let (nu, nv) = (n[0].x + c * n[1].x + s * n[2].x, n[0].y + c * n[1].y + s * n[2].y);
            let per_length = 1.0 / (nu * nu + nv * nv).sqrt();
            outline.normal_u[i] = nu * per_length;
            outline.normal_v[i] = nv * per_length;
        }
        Some(Contour { middle: [p[0].x / p[0].z, p[0].y / p[0].z], outline })
    }
}

fn single(m: &Matrix3<f64>) -> Mat3A {
    let column = |i: usize| Vec3A::new(m[(0, i)] as f32, m[(1, i)] as f32, m[(2, i)] as f32);
    Mat3A::from_cols(column(0), column(1), column(2))
}

/// Unlike `hypot`, this needs no call: pixels and metres neither overflow nor vanish when squared.
fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

impl HeadShape {
    /// Contour points of a head model, evenly spaced over its arc.
    pub fn new(model: &HeadModel) -> Self {
        let angle = |i: usize| {
            let share = (i as f64 + 0.5) / POINTS as f64;
            ((2.0 * share - 1.0) * model.arc_deg).to_radians()
        };
        Self {
            semi_axes: Vector3::new(model.radius_m, model.radius_m, model.half_height_m),
            cosines: std::array::from_fn(|i| angle(i).cos() as f32),
            sines: std::array::from_fn(|i| angle(i).sin() as f32),
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // zeros and ones that are set, not computed
mod tests {
    use super::*;
    use crate::silhouette::{Ellipsoid, ImageConic, View};
    use calib::{Camera, Intrinsics};
    use nalgebra::Isometry3;

    fn camera(eye: [f64; 3], aim: [f64; 3]) -> PreparedCamera {
        let up = if eye[0] == aim[0] && eye[1] == aim[1] { Vector3::y() } else { -Vector3::z() };
        let pose = Isometry3::face_towards(&Point3::from(eye), &Point3::from(aim), &up).inverse();
        PreparedCamera::new(
            "a",
            &Camera { intrinsics: Intrinsics::from_horizontal_fov(640, 480, 60.0), camera_from_world: pose },
        )
    }

    /// The spans of `ImageConic` solve the ray–quadric equation: an independent computation of the same outline.
    #[test]
    fn points_lie_on_the_conic_and_normals_point_out_of_it() {
        let model = HeadModel { arc_deg: 180.0, ..HeadModel::default() };
        let shape = HeadShape::new(&model);
        for (eye, aim) in [
            ([0.0, 0.0, 2.5], [4.0, 1.0, 1.5]),
            ([6.0, -3.0, 1.2], [1.0, 1.0, 1.7]),
            ([2.0, 1.0, 4.0], [2.0, 1.0, 0.0]),
            ([1.2, 1.2, 1.9], [2.0, 1.0, 1.6]),
        ] {
            let camera = camera(eye, aim);
            let head = Vector3::new(2.0, 1.0, 1.6);
            let contour = HeadCamera::new(&camera, &shape).contour(&head).unwrap().outline;
            let ellipsoid = Ellipsoid {
                center: head.into(),
                semi_axes: Vector3::new(model.radius_m, model.radius_m, model.half_height_m),
            };
            let view = View::new(&camera);
            let conic = ImageConic::new(&view, &ellipsoid);
            let is_inside = |u: f64, v: f64| {
                // The ray through a pixel meets the ellipsoid.
                let (w, o) =
                    (view.ray(u, v).component_div(&ellipsoid.semi_axes), view.center - ellipsoid.center);
                let o = o.component_div(&ellipsoid.semi_axes);
                o.dot(&w).powi(2) >= (o.norm_squared() - 1.0) * w.norm_squared()
            };
            assert!(!conic.holds_camera());
            for i in 0..POINTS {
                let (u, v) = (f64::from(contour.u[i]), f64::from(contour.v[i]));
                let (nu, nv) = (f64::from(contour.normal_u[i]), f64::from(contour.normal_v[i]));
                assert!((nu.hypot(nv) - 1.0).abs() < 1e-5);
                assert!(!is_inside(u + 0.02 * nu, v + 0.02 * nv), "{eye:?} point {i}: outwards is inside");
                assert!(is_inside(u - 0.02 * nu, v - 0.02 * nv), "{eye:?} point {i}: inwards is outside");
                // The tangent of a convex outline lies outside it.
                for side in [-1.0, 1.0] {
                    assert!(!is_inside(u - 1.5 * side * nv, v + 1.5 * side * nu), "{eye:?} point {i}");
                }
            }
        }
    }

    #[test]
    fn the_arc_is_the_upper_part_of_a_head_seen_from_the_side() {
        let shape = HeadShape::new(&HeadModel { arc_deg: 90.0, ..HeadModel::default() });
        let camera = HeadCamera::new(&camera([0.0, 0.0, 1.6], [5.0, 0.0, 1.6]), &shape);
        let contour = camera.contour(&Vector3::new(5.0, 0.3, 1.6)).unwrap().outline;
        let middle = 0.5 * (480.0 - 1.0);
        assert!(contour.v.iter().all(|v| f64::from(*v) < middle + 1e-3), "{:?}", contour.v);
        let top = contour.v.iter().copied().fold(f32::MAX, f32::min);
        let focal = 320.0 / 30_f64.to_radians().tan();
        // The crown of a spheroid 0.12 m above its centre at 5 m; the outermost points are half a step off it.
        assert!((f64::from(top) - (middle - focal * 0.12 / 5.0)).abs() < 0.15, "{top}");
    }

    #[test]
    fn no_contour_where_there_is_none() {
        let shape = HeadShape::new(&HeadModel::default());
        let camera = HeadCamera::new(&camera([0.0, 0.0, 1.6], [5.0, 0.0, 1.6]), &shape);
        for head in [[0.0, 0.0, 1.6], [-3.0, 0.0, 1.6], [0.05, 0.3, 1.6], [f64::NAN, 0.0, 1.6]] {
            assert_eq!(camera.contour(&Vector3::from(head)), None, "{head:?}");
        }
    }
}
