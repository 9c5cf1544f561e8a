//! The contour of a head in a camera (section 4.2, figures 10 and 11): a spheroid projected exactly.
//!
//! Scale space so that the spheroid becomes the unit sphere and its middle the origin; the camera's centre goes to `o`. The
//! points of the sphere where the sight is tangent are a circle around `o / |o|²` of radius `√(1 − 1/|o|²)`,
//!
//! ```text
//! q(φ) = ô / |o| + √(1 − 1/|o|²) (cos φ e₁ + sin φ e₂)        e₁: upwards, e₁ ⊥ e₂ ⊥ ô
//! ```
//!
//! and their images are the contour. Pixel and normal of a point are linear in `(1, cos φ, sin φ)` before the division, so a
//! contour costs two dozen products for the head and a dozen for each point. The plane that is tangent at `q` holds the
//! camera, so its image is a line: the tangent of the contour, with normal `N`.

use nalgebra::{Matrix3, Matrix3x4, Point3, Vector3};

use super::options::HeadModel;
use crate::stage::StageCamera;

/// Contour points of a head: a head of five pixels' radius has one every pixel of its upper part.
pub const POINTS: usize = 16;

/// A camera, made ready for contours.
#[derive(Debug, Clone)]
pub struct HeadCamera {
    /// The camera's centre.
    pub center: Point3<f64>,
    /// From the world to homogeneous pixels.
    projection: Matrix3x4<f64>,
    /// From normals in the world to normals in the image (the first two rows matter).
    image_from_normal: Matrix3<f64>,
    /// The image's upwards, in the world.
    up: Vector3<f64>,
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
}

/// The shape that contours are made of.
#[derive(Debug, Clone)]
pub struct HeadShape {
    semi_axes: Vector3<f64>,
    cosines: [f32; POINTS],
    sines: [f32; POINTS],
}

/// Contour points in the image of one camera, from one side over the top to the other: pixels and unit normals outwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contour {
    /// The pixel of the contour's middle.
    pub middle: [f32; 2],
    /// Columns.
    pub u: [f32; POINTS],
    /// Rows.
    pub v: [f32; POINTS],
    /// N, along u.
    pub normal_u: [f32; POINTS],
    /// N, along v.
    pub normal_v: [f32; POINTS],
}

impl Contour {
    /// From the middle to the top, pixels.
    pub fn half_height_px(&self) -> f32 {
        length(self.u[POINTS / 2] - self.middle[0], self.v[POINTS / 2] - self.middle[1])
    }
}

impl HeadCamera {
    /// The pinhole twin of a camera of the stage.
    pub fn new(camera: &StageCamera) -> Self {
        let k = &camera.pinhole.intrinsics;
        let pose = &camera.pinhole.camera_from_world;
        let rotation = pose.rotation.to_rotation_matrix();
        let matrix = k.matrix();
        let scale = Matrix3::from_diagonal(&Vector3::new(1.0 / k.fx, 1.0 / k.fy, 1.0));
        Self {
            center: camera.pinhole.center(),
            projection: matrix * pose.to_homogeneous().fixed_view::<3, 4>(0, 0),
            image_from_normal: scale * rotation.matrix(),
            up: -(rotation.inverse() * Vector3::y()),
            width: k.width,
            height: k.height,
        }
    }

    /// The contour of a head whose middle is at `head`; `None` where the camera is inside it, or some of it is not in front of
    /// the camera.
    pub fn contour(&self, shape: &HeadShape, head: &Vector3<f64>) -> Option<Contour> {
        /// Seen from so straight above (the sine of the angle), the image's upwards is as good as the world's.
        const STEEP: f64 = 0.1;
        let axes = &shape.semi_axes;
        let o = (self.center.coords - head).component_div(axes);
        let distance = o.norm();
        if distance.is_nan() || distance <= 1.0 {
            return None;
        }
        let towards = o / distance;
        let across = |v: Vector3<f64>| v - towards * towards.dot(&v);
        let upwards = across(Vector3::z());
        let e1 = if upwards.norm_squared() > STEEP * STEEP {
            upwards.normalize()
        } else {
            across(self.up.component_div(axes)).try_normalize(1e-9)?
        };
        let e2 = towards.cross(&e1);
        let radius = (1.0 - 1.0 / (distance * distance)).sqrt();
        let [q0, q1, q2] = [towards / distance, e1 * radius, e2 * radius];
        let linear = self.projection.fixed_view::<3, 3>(0, 0);
        let single = |v: Vector3<f64>| [v.x as f32, v.y as f32, v.z as f32];
        let middle = head + q0.component_mul(axes);
        let p = [
            single(linear * middle + self.projection.column(3)),
            single(linear * q1.component_mul(axes)),
            single(linear * q2.component_mul(axes)),
        ];
        let n = [q0, q1, q2].map(|q| single(self.image_from_normal * q.component_div(axes)));
        // The nearest point of the circle.
        if p[0][2] <= length(p[1][2], p[2][2]) + f32::EPSILON {
            return None;
        }
        let mut contour = Contour {
            middle: [p[0][0] / p[0][2], p[0][1] / p[0][2]],
            u: [0.0; POINTS],
            v: [0.0; POINTS],
            normal_u: [0.0; POINTS],
            normal_v: [0.0; POINTS],
        };
        for i in 0..POINTS {
            let (c, s) = (shape.cosines[i], shape.sines[i]);
            let per_depth = 1.0 / (p[0][2] + c * p[1][2] + s * p[2][2]);
            contour.u[i] = (p[0][0] + c * p[1][0] + s * p[2][0]) * per_depth;
            contour.v[i] = (p[0][1] + c * p[1][1] + s * p[2][1]) * per_depth;
            let (nu, nv) = (n[0][0] + c * n[1][0] + s * n[2][0], n[0][1] + c * n[1][1] + s * n[2][1]);
            let per_length = 1.0 / (nu * nu + nv * nv).sqrt();
            contour.normal_u[i] = nu * per_length;
            contour.normal_v[i] = nv * per_length;
        }
        Some(contour)
    }
}

/// Unlike `hypot`, no call: pixels and metres neither overflow nor vanish when squared.
fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

impl HeadShape {
    /// The contour points of a model, evenly over its arc.
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

    fn camera(eye: [f64; 3], aim: [f64; 3]) -> StageCamera {
        let up = if eye[0] == aim[0] && eye[1] == aim[1] { Vector3::y() } else { -Vector3::z() };
        let pose = Isometry3::face_towards(&Point3::from(eye), &Point3::from(aim), &up).inverse();
        StageCamera::new(
            "a",
            &Camera { intrinsics: Intrinsics::from_horizontal_fov(640, 480, 60.0), camera_from_world: pose },
        )
    }

    /// The spans of `ImageConic` solve the ray–quadric equation: another way to the same outline.
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
            let contour = HeadCamera::new(&camera).contour(&shape, &head).unwrap();
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
                // Along the tangent one leaves a convex outline.
                for side in [-1.0, 1.0] {
                    assert!(!is_inside(u - 1.5 * side * nv, v + 1.5 * side * nu), "{eye:?} point {i}");
                }
            }
        }
    }

    #[test]
    fn the_arc_is_the_upper_part_of_a_head_seen_from_the_side() {
        let shape = HeadShape::new(&HeadModel { arc_deg: 90.0, ..HeadModel::default() });
        let camera = HeadCamera::new(&camera([0.0, 0.0, 1.6], [5.0, 0.0, 1.6]));
        let contour = camera.contour(&shape, &Vector3::new(5.0, 0.3, 1.6)).unwrap();
        let middle = 0.5 * (f64::from(camera.height) - 1.0);
        assert!(contour.v.iter().all(|v| f64::from(*v) < middle + 1e-3), "{:?}", contour.v);
        let top = contour.v.iter().copied().fold(f32::MAX, f32::min);
        let focal = 320.0 / 30_f64.to_radians().tan();
        // The crown of a spheroid 0.12 m above its middle at 5 m; the outermost points are half a step off it.
        assert!((f64::from(top) - (middle - focal * 0.12 / 5.0)).abs() < 0.15, "{top}");
    }

    #[test]
    fn no_contour_where_there_is_none() {
        let shape = HeadShape::new(&HeadModel::default());
        let camera = HeadCamera::new(&camera([0.0, 0.0, 1.6], [5.0, 0.0, 1.6]));
        for head in [[0.0, 0.0, 1.6], [-3.0, 0.0, 1.6], [0.05, 0.3, 1.6], [f64::NAN, 0.0, 1.6]] {
            assert_eq!(camera.contour(&shape, &Vector3::from(head)), None, "{head:?}");
        }
    }
}
