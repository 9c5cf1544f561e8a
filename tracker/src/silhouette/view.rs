//! A camera made ready for simulation: the rays of its pixels, and the static depth in blocks.

use nalgebra::{Point3, Vector3};

use crate::stage::StageCamera;

/// A pinhole camera with the static room in front of it.
///
/// The pixel `(u, v)` looks along `ray_0 + u·ray_u + v·ray_v` (world frame), scaled so that its length along the
/// camera's z is 1: a multiple of it *is* a depth.
#[derive(Debug, Clone)]
pub struct View {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// The camera's centre in the world.
    pub center: Point3<f64>,
    /// The camera's z axis in the world.
    pub forward: Vector3<f64>,
    pub(super) ray_0: Vector3<f64>,
    pub(super) ray_u: Vector3<f64>,
    pub(super) ray_v: Vector3<f64>,
    /// Words of 64 pixels in a row of the image; the last may be partly used.
    pub(crate) words_per_row: usize,
    /// Per pixel, as in [`StageCamera::static_z_m`].
    static_z_m: Vec<f32>,
    /// Smallest and largest static depth under each word, row by row.
    word_range_m: Vec<[f32; 2]>,
}

impl View {
    /// Prepares a camera of the stage.
    pub fn new(camera: &StageCamera) -> Self {
        let k = &camera.pinhole.intrinsics;
        let world_from_camera = camera.pinhole.camera_from_world.rotation.inverse();
        let ray =
            |u: f64, v: f64| world_from_camera * Vector3::new((u - k.cx) / k.fx, (v - k.cy) / k.fy, 1.0);
        let ray_0 = ray(0.0, 0.0);
        let static_z_m = camera.static_z_m.clone();
        let word_range_m = static_z_m
            .chunks(k.width as usize)
            .flat_map(|row| row.chunks(64))
            .map(|word| word.iter().fold([f32::INFINITY, 0.0], |[low, high], z| [z.min(low), z.max(high)]))
            .collect();
        Self {
            width: k.width,
            height: k.height,
            center: camera.pinhole.center(),
            forward: world_from_camera * Vector3::z(),
            ray_0,
            ray_u: world_from_camera * Vector3::new(1.0 / k.fx, 0.0, 0.0),
            ray_v: world_from_camera * Vector3::new(0.0, 1.0 / k.fy, 0.0),
            words_per_row: (k.width as usize).div_ceil(64),
            static_z_m,
            word_range_m,
        }
    }

    /// The ray of a pixel, of length 1 along the camera's z; world frame.
    pub fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        self.ray_0 + self.ray_u * u + self.ray_v * v
    }

    /// Static depth at a pixel, as in [`StageCamera::static_z_m`].
    pub fn static_z_m(&self, u: i32, v: i32) -> f32 {
        self.static_z_m[v as usize * self.width as usize + u as usize]
    }

    /// Smallest and largest static depth under one word of a row.
    pub(super) fn word_range_m(&self, v: i32, word: usize) -> [f32; 2] {
        self.word_range_m[v as usize * self.words_per_row + word]
    }
}
