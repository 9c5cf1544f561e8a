//! Rotation matrices from files, and angles between rotations.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::{Error, Result};

/// Largest distance of `R Rᵀ` from the identity for a matrix in a file to be a rotation: files carry 6 digits or more.
const ORTHONORMALITY_TOLERANCE: f64 = 1e-4;

/// Converts a 3 × 3 matrix from a file to the rotation it stands for, with the rounding of its digits removed.
///
/// # Errors
/// [`Error::Invalid`] when the matrix is not orthonormal to four digits, mirrors, or holds a non-finite number.
pub fn from_matrix(m: &Matrix3<f64>) -> Result<UnitQuaternion<f64>> {
    if !m.iter().all(|v| v.is_finite()) {
        return Err(Error::Invalid("the rotation holds a number that is not finite".into()));
    }
    let off = (m * m.transpose() - Matrix3::identity()).abs().max();
    if off > ORTHONORMALITY_TOLERANCE {
        return Err(Error::Invalid(format!(
            "the rotation's rows are not orthonormal (off by {off:.2e}); write R with more digits"
        )));
    }
    if m.determinant() < 0.0 {
        return Err(Error::Invalid("the rotation mirrors (its determinant is −1); negate one axis".into()));
    }
    Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_eps(
        m,
        1e-12,
        100,
        Rotation3::identity(),
    )))
}

/// The rotation nearest to a matrix; for a sum of outer products of two bundles of directions, the rotation between
/// them (W. Kabsch, Acta Crystallographica A 32, 1976): `U diag(1, 1, det U Vᵀ) Vᵀ` of its singular value
/// decomposition. The identity where the decomposition does not converge.
pub fn nearest(m: &Matrix3<f64>) -> Rotation3<f64> {
    /// Limit of the decomposition's steps; a dozen suffice.
    const MOST_STEPS: usize = 200;
    let found = m.try_svd(true, true, f64::EPSILON, MOST_STEPS);
    let Some((u, v_t)) = found.and_then(|svd| svd.u.zip(svd.v_t)) else { return Rotation3::identity() };
    let sign = (u.determinant() * v_t.determinant()).signum();
    let turn = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    if turn.iter().all(|v| v.is_finite()) {
        Rotation3::from_matrix_unchecked(turn)
    } else {
        Rotation3::identity()
    }
}

/// Angle of the rotation between two orientations, degrees.
pub fn angle_between_deg(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    a.angle_to(b).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn rounded_digits_are_repaired_and_mirrors_refused() {
        let truth = UnitQuaternion::from_euler_angles(0.3, -2.0, 1.0);
        let rounded = truth.to_rotation_matrix().matrix().map(|v: f64| (v * 1e6).round() / 1e6);
        assert!(angle_between_deg(&from_matrix(&rounded).unwrap(), &truth) < 1e-4);

        let mirrored = truth.to_rotation_matrix().matrix() * Matrix3::from_diagonal(&[1.0, 1.0, -1.0].into());
        assert!(from_matrix(&mirrored).unwrap_err().to_string().contains("mirrors"));
        assert!(from_matrix(&Matrix3::zeros()).is_err());
        assert!(from_matrix(&Matrix3::from_element(f64::NAN)).is_err());
    }

    #[test]
    fn angles_are_in_degrees() {
        let quarter = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        assert_relative_eq!(angle_between_deg(&UnitQuaternion::identity(), &quarter), 90.0, epsilon = 1e-9);
    }

    #[test]
    fn the_nearest_rotation_turns_one_bundle_into_the_other_and_the_search_ends() {
        let truth = UnitQuaternion::from_euler_angles(2.1, -0.7, 2.9);
        let bundle =
            [Vector3::new(0.3, -0.2, 1.0), Vector3::new(-0.5, 0.4, 1.0), Vector3::new(0.1, 0.6, 1.0)];
        let sum: Matrix3<f64> = bundle.iter().map(|ray| (truth * ray) * ray.transpose()).sum();
        let found = UnitQuaternion::from_rotation_matrix(&nearest(&sum));
        assert!(angle_between_deg(&found, &truth) < 1e-6, "{found}");
        // Nearest to no rotation, or to many.
        for m in
            [Matrix3::zeros(), -Matrix3::identity(), Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0))]
        {
            assert!(nearest(&m).matrix().iter().all(|v| v.is_finite()));
        }
    }
}
