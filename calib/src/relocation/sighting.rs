//! A landmark seen in the new picture, and its residual, weighted by the uncertainty of pixel and depth.

use nalgebra::{Isometry3, Matrix2, Point2, Point3, Vector2, Vector3};

use crate::Intrinsics;

/// Standard deviation of a keypoint's pixel, of both pictures together.
pub(super) const PIXEL_SIGMA_PX: f64 = 0.7;
/// Weighted residual up to which a sighting agrees with a pose.
pub(super) const AGREES_SIGMAS: f64 = 3.5;

/// A point of the scene, and the pixel at which it may have been seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sighting {
    pub(super) world: Point3<f64>,
    /// Displacement of the point by one standard deviation of its depth in the reference picture.
    pub(super) depth_step: Vector3<f64>,
    pub(super) pixel: Point2<f64>,
    /// Cell of the reference pictures' grids: sightings of one cell share their errors.
    pub(super) cell: u32,
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
        let plain = Matrix2::identity() / PIXEL_SIGMA_PX;
        if !(squared.is_finite() && squared > f64::MIN_POSITIVE) {
            return plain;
        }
        let along = 1.0 - PIXEL_SIGMA_PX / (PIXEL_SIGMA_PX * PIXEL_SIGMA_PX + squared).sqrt();
        plain - v * v.transpose() * (along / (squared * PIXEL_SIGMA_PX))
    }

    /// Logarithm of the determinant of the residual's covariance, [`Self::whitening`]'s.
    pub(super) fn log_determinant(&self, intrinsics: &Intrinsics, camera_from_world: &Isometry3<f64>) -> f64 {
        -2.0 * self.whitening(intrinsics, camera_from_world).determinant().abs().max(f64::MIN_POSITIVE).ln()
    }

    /// The sighting, its depth uncertain by `factor` times as much.
    pub(super) fn with_depth_uncertainty(&self, factor: f64) -> Self {
        Self { depth_step: self.depth_step * factor, ..*self }
    }

    /// Squared residual in standard deviations; infinite behind the camera.
    pub(super) fn squared(&self, intrinsics: &Intrinsics, camera_from_world: &Isometry3<f64>) -> f64 {
        self.residual_px(intrinsics, camera_from_world).map_or(f64::INFINITY, |residual| {
            (self.whitening(intrinsics, camera_from_world) * residual).norm_squared()
        })
    }
}
