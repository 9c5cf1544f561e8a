//! A picture that is made by casting rays: one ray a sample.

use calib::Camera;
use glam::Vec3;
use nalgebra::Point2;
use rayon::prelude::*;

/// Surfaces that the rays of a camera have met: distance and colour of each sample, in rows of a grid that is finer than the
/// picture.
#[derive(Debug, Clone)]
pub struct RayImage {
    /// The camera.
    pub camera: Camera,
    /// Samples of a pixel along each axis, at least 1.
    pub samples: u32,
    /// Centre of the camera.
    pub eye: Vec3,
    /// One unit vector a sample; zero where the lens has no image.
    pub directions: Vec<Vec3>,
    /// Distance along the ray; infinite where nothing is met.
    pub distances: Vec<f32>,
    /// Colour of what is met.
    pub colors: Vec<Vec3>,
}

impl RayImage {
    /// Casts the rays of a camera. `meet` returns distance and colour of what a ray meets from the eye in a direction;
    /// where that is nothing, the sample has the colour `ground`.
    pub fn cast(
        camera: &Camera,
        samples: u32,
        ground: Vec3,
        meet: impl Fn(Vec3, Vec3) -> Option<(f32, Vec3)> + Sync,
    ) -> Self {
        let samples = samples.max(1);
        let center = camera.center();
        let eye = Vec3::new(center.x as f32, center.y as f32, center.z as f32);
        let (width, height) = (camera.intrinsics.width * samples, camera.intrinsics.height * samples);
        let sample = |row: u32, column: u32| {
            let pixel = Point2::new(sample_center(column, samples), sample_center(row, samples));
            let Some(ray) = camera.ray(&pixel) else { return (Vec3::ZERO, f32::INFINITY, ground) };
            let direction = Vec3::new(ray.x as f32, ray.y as f32, ray.z as f32);
            let (distance, color) = meet(eye, direction).unwrap_or((f32::INFINITY, ground));
            (direction, distance, color)
        };
        let rows: Vec<Vec<(Vec3, f32, Vec3)>> = (0..height)
            .into_par_iter()
            .map(|row| (0..width).map(|column| sample(row, column)).collect())
            .collect();
        let count = width as usize * height as usize;
        let [mut directions, mut colors] = [Vec::with_capacity(count), Vec::with_capacity(count)];
        let mut distances = Vec::with_capacity(count);
        for (direction, distance, color) in rows.into_iter().flatten() {
            directions.push(direction);
            distances.push(distance);
            colors.push(color);
        }
        Self { camera: camera.clone(), samples, eye, directions, distances, colors }
    }

    /// Width of the finer grid.
    pub fn width(&self) -> usize {
        (self.camera.intrinsics.width * self.samples) as usize
    }

    /// Height of the finer grid.
    pub fn height(&self) -> usize {
        (self.camera.intrinsics.height * self.samples) as usize
    }
}

/// Centre of a sample, in pixels of the picture.
fn sample_center(index: u32, samples: u32) -> f64 {
    (f64::from(index) + 0.5) / f64::from(samples) - 0.5
}
