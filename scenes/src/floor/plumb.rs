//! The vertical by the lines of pictures, as the search of the floor uses it.

use nalgebra::{Matrix3, Matrix3x2, UnitQuaternion, Vector3};

/// Vertical by the edges of one capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plumb {
    /// Unit vector, in the frame of the normals.
    pub up: Vector3<f64>,
    /// Covariance of the unit vector; zero along itself.
    pub covariance: Matrix3<f64>,
}

impl Plumb {
    /// The same vertical in another frame.
    #[must_use]
    pub fn turned(&self, by: &UnitQuaternion<f64>) -> Self {
        let turn = by.to_rotation_matrix().into_inner();
        Self { up: by * self.up, covariance: turn * self.covariance * turn.transpose() }
    }
}

/// Two unit vectors across a unit vector.
pub fn tangents(up: &Vector3<f64>) -> Option<Matrix3x2<f64>> {
    let first = up.cross(&Vector3::ith(up.iamin(), 1.0)).try_normalize(0.0)?;
    Some(Matrix3x2::from_columns(&[first, up.cross(&first)]))
}
