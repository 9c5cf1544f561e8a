//! A camera prepared for simulation: the rays of its pixels, and the static depth along them.

use nalgebra::{Point3, Vector3};

use super::Ellipsoid;
#[cfg(doc)]
use super::conic::Ellipse;
use super::depth::StaticDepth;
use crate::prepared_room::PreparedCamera;

/// A pinhole camera with the static room in front of it.
///
/// The pixel `(u, v)` looks along `ray_0 + u·ray_u + v·ray_v` (world frame), scaled to length 1 along the camera's z,
/// so that a multiple of it *is* a depth.
#[derive(Debug, Clone)]
pub struct View {
    /// Image width, pixels of this view.
    pub width: u32,
    /// Image height, pixels of this view.
    pub height: u32,
    /// Side of the block of the camera's pixels that is one pixel of this view.
    pub block: u8,
    /// Centre of the camera, world frame, metres.
    pub center: Point3<f64>,
    /// z axis of the camera, world frame.
    pub forward: Vector3<f64>,
    pub(super) ray_0: Vector3<f64>,
    pub(super) ray_u: Vector3<f64>,
    pub(super) ray_v: Vector3<f64>,
    /// Row vector: a point `d` from the centre is in row `d · down / d · forward`.
    down: Vector3<f64>,
    /// Whether the static depth never reaches below the floor.
    is_floor_opaque: bool,
    /// Number of 64-pixel words in a row of the image; the last may be partly used.
    pub(crate) words_per_row: usize,
    /// Static depth, as in [`PreparedCamera::static_z_m`].
    pub(super) depth: StaticDepth,
}

impl View {
    /// Prepares a camera of the room.
    pub fn new(camera: &PreparedCamera) -> Self {
        Self::coarse(camera, 1)
    }

    /// Prepares a camera with `block` × `block` of its pixels as one. Each ray goes through its block's middle, and has
    /// the static depth of the pixel there.
    pub fn coarse(camera: &PreparedCamera, block: u8) -> Self {
        let side = u32::from(block);
        let k = &camera.pinhole.intrinsics;
        let (width, height) = (k.width.div_ceil(side), k.height.div_ceil(side));
        let step = f64::from(side);
        let world_from_camera = camera.pinhole.camera_from_world.rotation.inverse();
        let ray =
            |u: f64, v: f64| world_from_camera * Vector3::new((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0);
        let middle = 0.5 * (step - 1.0);
        let ray_0 = ray(middle, middle);
        let pixel = |i: u32, size: u32| (i * side + side / 2).min(size - 1) as usize;
        let depth =
            |u: u32, v: u32| camera.static_z_m[pixel(v, k.height) * k.width as usize + pixel(u, k.width)];
        Self {
            width,
            height,
            block,
            center: camera.pinhole.center(),
            forward: world_from_camera * Vector3::z(),
            ray_0,
            ray_u: world_from_camera * Vector3::new(step / k.fx, 0.0, 0.0),
            ray_v: world_from_camera * Vector3::new(0.0, step / k.fy, 0.0),
            down: world_from_camera * Vector3::new(0.0, k.fy, k.cy - middle) / step,
            is_floor_opaque: camera.is_floor_opaque(),
            words_per_row: (width as usize).div_ceil(64),
            depth: StaticDepth::new(width, height, depth),
        }
    }

    /// Ray of a pixel, of length 1 along the camera's z; world frame.
    pub fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        self.ray_0 + self.ray_u * u + self.ray_v * v
    }

    /// First row from which on no part of a body is above the floor, which hides everything below it; `i32::MAX` where
    /// that is unknown. `last_row` is the body's own ([`Ellipse::last_row`]).
    ///
    /// A body whose last row shows a point below the floor has the last row of its part above the floor on the circle
    /// in which it meets the floor. For a camera that looks straight down, or hangs upside down, the last row may show
    /// the head instead.
    pub(super) fn first_row_below_floor(&self, body: &Ellipsoid, last_row: f64) -> i32 {
        let axes = &body.semi_axes;
        let part = body.center.z / axes.z;
        if !(part < 1.0 && self.center.z > 0.0 && self.is_floor_opaque) {
            return i32::MAX;
        }
        // Tangent point of the plane of that row.
        let across = (self.down - self.forward * last_row).component_mul(axes);
        if body.center.z + axes.z * across.z / across.norm() >= 0.0 {
            return i32::MAX;
        }
        let radius = axes.x * (1.0 - part * part).max(0.0).sqrt();
        let circle = Vector3::new(radius, radius, 0.0);
        let last = self.last_row(&Point3::new(body.center.x, body.center.y, 0.0), &circle);
        // One row more for rounding; the cast saturates.
        last.map_or(i32::MAX, |last| (last.ceil() + 2.0) as i32)
    }

    /// Last (real) row of an ellipsoid's image, within or outside; `None` where it reaches behind the image plane. With
    /// `d` from the camera to its middle and A its axes, the plane of row v is tangent to it where
    ///
    /// ```text
    /// (down · d − v forward · d)² = |A down − v A forward|²
    /// ```
    fn last_row(&self, center: &Point3<f64>, axes: &Vector3<f64>) -> Option<f64> {
        let d = center - self.center;
        let (down, forward) = (self.down.dot(&d), self.forward.dot(&d));
        let (a, b) = (self.down.component_mul(axes), self.forward.component_mul(axes));
        // q2 v² − 2 q1 v + q0 = 0
        let q2 = forward * forward - b.norm_squared();
        let q1 = down * forward - a.dot(&b);
        let q0 = down * down - a.norm_squared();
        (forward > 0.0 && q2 > 0.0).then(|| (q1 + (q1 * q1 - q2 * q0).max(0.0).sqrt()) / q2)
    }

    /// Static depth at a pixel, as in [`PreparedCamera::static_z_m`].
    pub fn static_z_m(&self, u: i32, v: i32) -> f32 {
        self.depth.z_m(u as u32, v as u32)
    }
}
