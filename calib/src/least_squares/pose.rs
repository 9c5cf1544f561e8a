//! Steps of poses and similarities, and the derivatives of the points that they transform.

use nalgebra::{Isometry3, Point3, SMatrix, Similarity3, Translation3, UnitQuaternion, Vector3};

/// Pose after a step of rotation vector and translation.
pub fn moved_pose(pose: &Isometry3<f64>, step: &[f64]) -> Isometry3<f64> {
    let [rotation, translation] = [0, 3].map(|first| Vector3::from_column_slice(&step[first..first + 3]));
    let mut moved =
        Isometry3::from_parts(Translation3::from(translation), UnitQuaternion::new(rotation)) * pose;
    // Many small rotations accumulate rounding errors.
    moved.rotation.renormalize();
    moved
}

/// Similarity after a step of rotation vector, translation and logarithm of the scale.
pub fn moved_similarity(similarity: &Similarity3<f64>, step: &[f64]) -> Similarity3<f64> {
    let grown = Similarity3::from_scaling(step[6].exp()) * similarity;
    Similarity3::from_isometry(moved_pose(&grown.isometry, &step[..6]), grown.scaling())
}

/// Derivative of a transformed point by its pose's parameters, `[−[x]×, I]`.
pub fn by_pose(transformed: &Point3<f64>) -> SMatrix<f64, 3, 6> {
    let mut by = SMatrix::<f64, 3, 6>::zeros();
    by.fixed_columns_mut::<3>(0).copy_from(&-transformed.coords.cross_matrix());
    by.fixed_columns_mut::<3>(3).fill_with_identity();
    by
}

/// Derivative of a transformed point by its similarity's parameters, `[−[x]×, I, x]`.
pub fn by_similarity(transformed: &Point3<f64>) -> SMatrix<f64, 3, 7> {
    let mut by = SMatrix::<f64, 3, 7>::zeros();
    by.fixed_columns_mut::<6>(0).copy_from(&by_pose(transformed));
    by.set_column(6, &transformed.coords);
    by
}
