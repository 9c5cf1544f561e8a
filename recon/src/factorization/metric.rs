//! Metric upgrade: the 3 × 3 matrix that makes the rows of the affine motion a camera's axes.
//!
//! C. J. Poelman and T. Kanade, "A paraperspective factorization method for shape and motion recovery" (PAMI 1997).
//! Image coordinates are normalised (focal length 1). With the origin's image at `(x_f, y_f)` and its depth `z_f`, the
//! rows of paraperspective motion are
//!
//! ```text
//! m_f = (i_f − x_f k_f) / z_f        |m_f|² / (1 + x_f²) = |n_f|² / (1 + y_f²) = 1 / z_f²
//! n_f = (j_f − y_f k_f) / z_f        m_f · n_f = x_f y_f / z_f²
//! ```
//!
//! linear in the symmetric `Q = A Aᵀ`. Scaled orthography is the same with `x_f = y_f = 0` in the constraints.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Rotation3, SymmetricEigen, Translation3, UnitQuaternion, Vector3,
};

use super::affine::Affine;

/// Camera model of affine measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum AffineModel {
    /// Parallel rays along the optical axis, scaled with distance.
    Orthographic,
    /// Parallel rays along the line of sight to the origin.
    Paraperspective,
}

/// Poses and points; the points' mean is the origin.
#[derive(Debug, Clone)]
pub(crate) struct MetricMotion {
    /// `camera_from_world`.
    pub(crate) poses: Vec<Isometry3<f64>>,
    pub(crate) points: Vec<Vector3<f64>>,
}

/// Least eigenvalue of `Q`, relative to the largest: noise may push it below zero when the camera hardly turned.
const MIN_EIGENVALUE: f64 = 1e-4;

/// Metric interpretation of an affine factorization, and its mirror: both explain affine measurements equally.
pub(crate) fn upgrade(affine: &Affine, model: AffineModel) -> Option<[MetricMotion; 2]> {
    let a = metric_matrix(affine, model)?;
    let back = a.try_inverse()?;
    let metric = |sign: f64| -> Option<MetricMotion> {
        let points = affine.points.iter().map(|s| back * s * sign).collect();
        let poses =
            (0..affine.motion.len()).map(|f| pose(affine, f, &(a * sign), model)).collect::<Option<_>>()?;
        Some(MetricMotion { poses, points })
    };
    Some([metric(1.0)?, metric(-1.0)?])
}

/// Image of the origin in the constraints.
fn origin_image(affine: &Affine, f: usize, model: AffineModel) -> (f64, f64) {
    match model {
        AffineModel::Orthographic => (0.0, 0.0),
        AffineModel::Paraperspective => (affine.offset[f].x, affine.offset[f].y),
    }
}

fn metric_matrix(affine: &Affine, model: AffineModel) -> Option<Matrix3<f64>> {
    let frames = affine.motion.len();
    let mut system = DMatrix::zeros(2 * frames + 1, 6);
    let mut right = DVector::zeros(2 * frames + 1);
    // aᵀ Q b as a row over (q00, q01, q02, q11, q12, q22).
    let form = |a: &Vector3<f64>, b: &Vector3<f64>| {
        [a.x * b.x, a.x * b.y + a.y * b.x, a.x * b.z + a.z * b.x, a.y * b.y, a.y * b.z + a.z * b.y, a.z * b.z]
    };
    for f in 0..frames {
        let (x, y) = origin_image(affine, f, model);
        let m: Vector3<f64> = affine.motion[f].row(0).transpose();
        let n: Vector3<f64> = affine.motion[f].row(1).transpose();
        let (mm, nn, mn) = (form(&m, &m), form(&n, &n), form(&m, &n));
        for k in 0..6 {
            let (across, down) = (mm[k] / (1.0 + x * x), nn[k] / (1.0 + y * y));
            system[(2 * f, k)] = across - down;
            system[(2 * f + 1, k)] = 2.0 * mn[k] - x * y * (across + down);
            // The scale is free: the mean of 1 / z² is set to 1.
            system[(2 * frames, k)] += 0.5 * (across + down);
        }
    }
    right[2 * frames] = frames as f64;
    // Columns differ much in size when the affine frame is skewed, so they are scaled before solving.
    let scale: Vec<f64> = (0..6).map(|k| system.column(k).norm().max(1e-12)).collect();
    for (k, s) in scale.iter().enumerate() {
        system.column_mut(k).scale_mut(1.0 / s);
    }
    let q = system.svd(true, true).solve(&right, 1e-12).ok()?;
    let q: Vec<f64> = q.iter().zip(&scale).map(|(q, s)| q / s).collect();
    let symmetric = Matrix3::new(q[0], q[1], q[2], q[1], q[3], q[4], q[2], q[4], q[5]);
    let eigen = SymmetricEigen::new(symmetric);
    let largest = eigen.eigenvalues.max();
    if !(largest > 0.0 && largest.is_finite()) {
        return None;
    }
    let roots = eigen.eigenvalues.map(|v| v.max(MIN_EIGENVALUE * largest).sqrt());
    Some(eigen.eigenvectors * Matrix3::from_diagonal(&roots))
}

/// Pose of a frame from its metric motion rows.
fn pose(affine: &Affine, f: usize, a: &Matrix3<f64>, model: AffineModel) -> Option<Isometry3<f64>> {
    let (x, y) = origin_image(affine, f, model);
    let rows = affine.motion[f] * a;
    let (m, n): (Vector3<f64>, Vector3<f64>) = (rows.row(0).transpose(), rows.row(1).transpose());
    let inverse_depth = (0.5 * (m.norm_squared() / (1.0 + x * x) + n.norm_squared() / (1.0 + y * y))).sqrt();
    if !(inverse_depth > 0.0 && inverse_depth.is_finite()) {
        return None;
    }
    let (m, n) = (m / inverse_depth, n / inverse_depth);
    // m × n = x i + y j + k, so (i, j, k) solve a linear system; then to the nearest rotation.
    let sum = Matrix3::from_rows(&[m.transpose(), n.transpose(), m.cross(&n).transpose()]);
    let axes = Matrix3::new(1.0, 0.0, -x, 0.0, 1.0, -y, x, y, 1.0).try_inverse()? * sum;
    let svd = axes.svd(true, true);
    let rotation = svd.u? * svd.v_t?;
    if rotation.determinant() < 0.0 {
        return None;
    }
    let depth = 1.0 / inverse_depth;
    let t = Vector3::new(affine.offset[f].x * depth, affine.offset[f].y * depth, depth);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some(Isometry3::from_parts(Translation3::from(t), rotation))
}
