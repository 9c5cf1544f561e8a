//! A landmark seen in the new picture, and its residual, weighted by the uncertainty of pixel and depth.

use nalgebra::{Isometry3, Matrix2, Point2, Point3, Vector2, Vector3};

use crate::Intrinsics;

/// Weighted residual up to which a sighting agrees with a pose.
pub(super) const AGREES_SIGMAS: f64 = 3.5;

/// A point of the scene, and the pixel at which it may have been seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// The point.
    pub world: Point3<f64>,
    /// Displacement of the point by one standard deviation of its depth in the reference picture.
    pub depth_step: Vector3<f64>,
    /// The pixel.
    pub pixel: Point2<f64>,
    /// Standard deviation of the pixel, that of the reference picture's included.
    pub pixel_sigma_px: f64,
    /// Cell of the reference pictures' grids: sightings of one cell share their errors.
    pub cell: u32,
}

impl Sighting {
    /// Projection minus pixel, pixels; `None` behind the camera.
    pub(super) fn residual_px(
        &self,
        intrinsics: &Intrinsics,
        camera_from_world: &Isometry3<f64>,
    ) -> Option<Vector2<f64>> {
        Some(intrinsics.project(&(camera_from_world * self.world))? - self.pixel)
    }

    /// Inverse square root of the residual's covariance `σ² I + v vᵀ`, where `v` is the projection's displacement by one
    /// standard deviation of the depth.
    pub(super) fn whitening(
        &self,
        intrinsics: &Intrinsics,
        camera_from_world: &Isometry3<f64>,
    ) -> Matrix2<f64> {
        let place = camera_from_world * self.world;
        let v = intrinsics.project_jacobian(&place) * (camera_from_world * self.depth_step);
        let squared = v.norm_squared();
        let sigma = self.pixel_sigma_px;
        let plain = Matrix2::identity() / sigma;
        if !(squared.is_finite() && squared > f64::MIN_POSITIVE) {
            return plain;
        }
        let along = 1.0 - sigma / (sigma * sigma + squared).sqrt();
        plain - v * v.transpose() * (along / (squared * sigma))
    }

    /// Logarithm of the determinant of the residual's covariance, [`Self::whitening`]'s.
    pub(super) fn log_determinant(&self, intrinsics: &Intrinsics, camera_from_world: &Isometry3<f64>) -> f64 {
        -2.0 * self.whitening(intrinsics, camera_from_world).determinant().abs().max(f64::MIN_POSITIVE).ln()
    }

    /// The sighting, its pixel and its depth uncertain by `pixel` and `depth` times as much.
    pub(super) fn with_uncertainty(&self, pixel: f64, depth: f64) -> Self {
        Self { pixel_sigma_px: self.pixel_sigma_px * pixel, depth_step: self.depth_step * depth, ..*self }
    }

    /// Squared residual in standard deviations; infinite behind the camera.
    pub(super) fn squared(&self, intrinsics: &Intrinsics, camera_from_world: &Isometry3<f64>) -> f64 {
        self.residual_px(intrinsics, camera_from_world).map_or(f64::INFINITY, |residual| {
            (self.whitening(intrinsics, camera_from_world) * residual).norm_squared()
        })
    }
}
