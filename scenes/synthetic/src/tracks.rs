//! Sparse scenes: random points in front of moving cameras, and their tracks with noise, gaps and outliers.
//!
//! For the tests of solvers (factorization, resection, bundle adjustment), which need no pictures.

use calib::{Camera, Intrinsics};
use nalgebra::{Isometry3, Point2, Point3, Vector2};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;

use scenes::view::look_at;

/// Options of a random sparse scene.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackOptions {
    /// Seed of the whole scene.
    pub seed: u64,
    /// Number of cameras along an arc in front of the points.
    pub cameras: usize,
    /// Number of points in a box, 2 m in front of the cameras and 3 m deep.
    pub points: usize,
    /// Length of the cameras' arc, metres.
    pub baseline_m: f64,
    /// Standard deviation of the observations.
    pub noise_px: f64,
    /// Share of the observations that are placed elsewhere in the image.
    pub outliers: f64,
    /// Share of the observations that are missing.
    pub gaps: f64,
    /// Intrinsics of the camera.
    pub intrinsics: Intrinsics,
}

impl Default for TrackOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            cameras: 12,
            points: 120,
            baseline_m: 0.8,
            noise_px: 0.3,
            outliers: 0.0,
            gaps: 0.1,
            intrinsics: Intrinsics::from_horizontal_fov(640, 480, 73.0),
        }
    }
}

/// Cameras, points and their observations.
#[derive(Debug, Clone, PartialEq)]
pub struct PointTracks {
    /// The true poses.
    pub camera_from_world: Vec<Isometry3<f64>>,
    /// The true points.
    pub points: Vec<Point3<f64>>,
    /// Observations of each point.
    pub observations: Vec<Vec<PointObservation>>,
}

/// Observation of a point by a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointObservation {
    /// Index of the camera.
    pub camera: usize,
    /// Observed pixel.
    pub pixel: Point2<f64>,
    /// Whether the pixel is an outlier, unrelated to the truth.
    pub outlier: bool,
}

impl TrackOptions {
    /// Makes the scene. Shares are clamped to 0 … 1, a noise that is no standard deviation counts as none.
    pub fn build(&self) -> PointTracks {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let camera_from_world = self.poses(&mut rng);
        let points: Vec<Point3<f64>> = (0..self.points)
            .map(|_| {
                Point3::new(
                    rng.random_range(-1.8..1.8),
                    rng.random_range(2.0..5.0),
                    rng.random_range(-1.3..1.3),
                )
            })
            .collect();
        let noise = Normal::new(0.0, self.noise_px).ok();
        let observations = points
            .iter()
            .map(|point| {
                let mut seen = Vec::new();
                for (camera, pose) in camera_from_world.iter().enumerate() {
                    let exact =
                        self.intrinsics.project(&(pose * point)).filter(|p| self.intrinsics.contains(p));
                    let Some(exact) = exact else { continue };
                    // The number of draws is always the same, so that one option does not change the randomness of
                    // another.
                    let missing = rng.random_bool(self.gaps.clamp(0.0, 1.0));
                    let outlier = rng.random_bool(self.outliers.clamp(0.0, 1.0));
                    let mut draw = || noise.map_or(0.0, |noise| noise.sample(&mut rng));
                    let offset = Vector2::new(draw(), draw());
                    let elsewhere = Point2::new(
                        rng.random_range(0.0..f64::from(self.intrinsics.width)),
                        rng.random_range(0.0..f64::from(self.intrinsics.height)),
                    );
                    let pixel = if outlier { elsewhere } else { exact + offset };
                    if !missing {
                        seen.push(PointObservation { camera, pixel, outlier });
                    }
                }
                seen
            })
            .collect();
        PointTracks { camera_from_world, points, observations }
    }

    /// Cameras on an arc, up and down a little, that look at the middle of the points.
    fn poses(&self, rng: &mut Pcg64Mcg) -> Vec<Isometry3<f64>> {
        let last = self.cameras.saturating_sub(1).max(1) as f64;
        (0..self.cameras)
            .map(|i| {
                let t = i as f64 / last - 0.5;
                let mut jitter = |reach: f64| rng.random_range(-reach..reach);
                let eye = Point3::new(
                    self.baseline_m * t + jitter(0.02),
                    0.3 * self.baseline_m * t * t + jitter(0.05),
                    0.2 * self.baseline_m * (9.0 * t).sin() + jitter(0.02),
                );
                look_at(&eye, &Point3::new(jitter(0.1), 3.5, jitter(0.1)))
            })
            .collect()
    }
}

impl PointTracks {
    /// The cameras, given the intrinsics they were made with.
    pub fn cameras(&self, intrinsics: &Intrinsics) -> Vec<Camera> {
        let camera =
            |pose: &Isometry3<f64>| Camera { intrinsics: intrinsics.clone(), camera_from_world: *pose };
        self.camera_from_world.iter().map(camera).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn observations_are_the_projections_with_the_noise_asked_for() {
        let options = TrackOptions { outliers: 0.05, gaps: 0.2, noise_px: 0.5, ..TrackOptions::default() };
        let tracks = options.build();
        let cameras = tracks.cameras(&options.intrinsics);
        let (mut squares, mut inliers, mut outliers, mut near) = (0.0, 0, 0, 0);
        for (point, seen) in tracks.points.iter().zip(&tracks.observations) {
            for o in seen {
                let error = (o.pixel - cameras[o.camera].project(point).unwrap()).norm();
                if o.outlier {
                    outliers += 1;
                    near += i32::from(error < 10.0);
                } else {
                    inliers += 1;
                    squares += error * error;
                }
            }
        }
        let rms = (squares / f64::from(inliers)).sqrt();
        assert!((rms - 0.5 * 2.0_f64.sqrt()).abs() < 0.05, "{rms}");
        let share = f64::from(outliers) / f64::from(outliers + inliers);
        assert!((share - 0.05).abs() < 0.025 && near * 20 < outliers + 20, "{share} {near}");
        let full = TrackOptions { gaps: 0.0, ..options.clone() }.build();
        let count = |t: &PointTracks| t.observations.iter().map(Vec::len).sum::<usize>() as f64;
        assert!((count(&tracks) / count(&full) - 0.8).abs() < 0.05);
        assert_eq!(tracks, options.build());
    }

    #[test]
    fn nothing_asked_for_is_nothing() {
        let none = TrackOptions { cameras: 0, points: 0, ..TrackOptions::default() }.build();
        assert!(none.points.is_empty() && none.camera_from_world.is_empty());
        let blind = TrackOptions { gaps: 1.0, noise_px: f64::NAN, ..TrackOptions::default() }.build();
        assert!(blind.observations.iter().all(Vec::is_empty));
    }
}
