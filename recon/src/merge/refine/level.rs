//! Constraint that the vertical is the same for two cameras: the vertical by the plumb lines in the pictures of one
//! ([`crate::plumb`]), transformed to the other, equals the vertical by its own lines. It needs no common points, and
//! holds where the cameras' spaces are bent.

use nalgebra::{Matrix2x3, Matrix3, Similarity3, Vector2, Vector3};

use super::state::ByCamera;
use crate::plumb::{Plumb, tangents};

/// Difference between the verticals of two cameras.
#[derive(Debug, Clone)]
pub(super) struct LevelConstraint {
    pub(super) from: usize,
    pub(super) onto: usize,
    /// Vertical in the frame of `from`.
    up: Vector3<f64>,
    /// Axes across the other's vertical, in standard deviations of both.
    across: Matrix2x3<f64>,
}

impl LevelConstraint {
    /// Constraints of all cameras with a vertical, each with the first of them; standard deviations are those at the
    /// present poses.
    pub(super) fn all(plumb: &[Option<Plumb>], poses: &[Similarity3<f64>]) -> Vec<Self> {
        let mut told = plumb.iter().enumerate().filter_map(|(camera, of)| Some((camera, of.as_ref()?)));
        let Some(first) = told.next() else { return Vec::new() };
        told.filter_map(|other| Self::between(first, other, poses)).collect()
    }

    fn between(
        (onto, there): (usize, &Plumb),
        (from, here): (usize, &Plumb),
        poses: &[Similarity3<f64>],
    ) -> Option<Self> {
        let turn = poses[onto].isometry.rotation.inverse() * poses[from].isometry.rotation;
        let tangents = tangents(&there.up)?;
        let both = tangents.transpose() * (there.covariance + here.turned(&turn).covariance) * tangents;
        let whitened = both.cholesky()?.l().try_inverse()? * tangents.transpose();
        Some(Self { from, onto, up: here.up, across: whitened })
    }

    pub(super) fn residual(&self, poses: &[Similarity3<f64>]) -> Vector2<f64> {
        let common = poses[self.from].isometry.rotation * self.up;
        self.across * (poses[self.onto].isometry.rotation.inverse() * common)
    }

    /// Derivative of the residual by the rotation of `from`; that by the rotation of `onto` is the opposite.
    pub(super) fn by_turning(&self, poses: &[Similarity3<f64>]) -> ByCamera {
        let common: Vector3<f64> = poses[self.from].isometry.rotation * self.up;
        let back: Matrix3<f64> =
            poses[self.onto].isometry.rotation.inverse().to_rotation_matrix().into_inner();
        let rows = self.across * back * -common.cross_matrix();
        let mut by = ByCamera::zeros();
        by.fixed_columns_mut::<3>(0).copy_from(&rows);
        by
    }
}
