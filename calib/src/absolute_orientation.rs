//! Absolute orientation: the similarity (or rigid) transform that takes one point set to another.
//!
//! B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", J. Opt. Soc. Am. A 4
//! (1987) 629–642. The rotation is the eigenvector of the largest eigenvalue of the symmetric 4 × 4 matrix `N`
//! built from the cross-covariance of the centred sets (section 4.A); the scale is the ratio of the sets'
//! root-mean-square radii (section 2.E, symmetric: swapping the sets inverts it); the translation joins the
//! centroids.

use nalgebra::{
    Isometry3, Matrix3, Matrix4, Point3, Quaternion, Similarity3, SymmetricEigen, Translation3,
    UnitQuaternion, Vector3,
};

use crate::{Error, Result};

/// Points count as lying on a line when their second principal spread is below this fraction of the first.
const COLLINEARITY_RATIO: f64 = 1e-3;

/// Estimates the similarity `b_from_a` between corresponding points, with Horn's symmetric scale.
///
/// The rotation minimises the squared distance between `b_from_a · a[i]` and `b[i]`. The scale is `√(S_b / S_a)`, the
/// ratio of the root-mean-square radii (section 2.E), and not the least-squares `tr(Rᵀ C) / S_a` (section 2.D): it is
/// symmetric, so that swapping the sets inverts the transform, while noise in `a` biases the least-squares scale
/// towards zero.
///
/// # Errors
/// [`Error::Degenerate`] for sets of different sizes, fewer than three points, points on one point or line, or
/// a coordinate that is not finite.
pub fn similarity(a: &[Point3<f64>], b: &[Point3<f64>]) -> Result<Similarity3<f64>> {
    similarity_weighted(a, b, &vec![1.0; a.len()])
}

/// [`similarity`] with a weight per pair; weights are zero or positive.
pub fn similarity_weighted(
    a: &[Point3<f64>],
    b: &[Point3<f64>],
    weights: &[f64],
) -> Result<Similarity3<f64>> {
    let moments = Moments::of(a, b, weights)?;
    let rotation = moments.rotation();
    let scale = (moments.spread_b / moments.spread_a).sqrt();
    Ok(Similarity3::from_parts(moments.translation(&rotation, scale), rotation, scale))
}

/// Estimates the rigid transform `b_from_a` with the least squared distance between `b_from_a · a[i]` and `b[i]`.
///
/// # Errors
/// As [`similarity`].
pub fn rigid(a: &[Point3<f64>], b: &[Point3<f64>]) -> Result<Isometry3<f64>> {
    let moments = Moments::of(a, b, &vec![1.0; a.len()])?;
    let rotation = moments.rotation();
    Ok(Isometry3::from_parts(moments.translation(&rotation, 1.0), rotation))
}

/// First and second moments of two corresponding point sets.
struct Moments {
    centroid_a: Vector3<f64>,
    centroid_b: Vector3<f64>,
    /// Σ w (a − ā)(b − b̄)ᵀ
    cross: Matrix3<f64>,
    /// Σ w |a − ā|²
    spread_a: f64,
    /// Σ w |b − b̄|²
    spread_b: f64,
}

impl Moments {
    fn of(a: &[Point3<f64>], b: &[Point3<f64>], weights: &[f64]) -> Result<Self> {
        if a.len() != b.len() || a.len() != weights.len() {
            return Err(Error::Degenerate(format!("{} points against {}", a.len(), b.len())));
        }
        if weights.iter().filter(|w| **w > 0.0).count() < 3 {
            return Err(Error::Degenerate(format!("{} points; at least 3 are needed", a.len())));
        }
        if !a.iter().chain(b).all(|p| p.coords.iter().all(|v| v.is_finite())) {
            return Err(Error::Degenerate("a coordinate is not finite".into()));
        }
        let total: f64 = weights.iter().sum();
        let mean = |points: &[Point3<f64>]| {
            points.iter().zip(weights).map(|(p, w)| p.coords * *w).sum::<Vector3<f64>>() / total
        };
        let (centroid_a, centroid_b) = (mean(a), mean(b));
        let (mut cross, mut cov_a, mut cov_b) = (Matrix3::zeros(), Matrix3::zeros(), Matrix3::zeros());
        for ((p, q), w) in a.iter().zip(b).zip(weights) {
            let (p, q) = (p.coords - centroid_a, q.coords - centroid_b);
            cross += *w * p * q.transpose();
            cov_a += *w * p * p.transpose();
            cov_b += *w * q * q.transpose();
        }
        refuse_line(&cov_a, "the first set")?;
        refuse_line(&cov_b, "the second set")?;
        Ok(Self { centroid_a, centroid_b, cross, spread_a: cov_a.trace(), spread_b: cov_b.trace() })
    }

    /// Horn's 4 × 4 matrix N and its top eigenvector.
    fn rotation(&self) -> UnitQuaternion<f64> {
        let s = &self.cross;
        let (xx, xy, xz) = (s[(0, 0)], s[(0, 1)], s[(0, 2)]);
        let (yx, yy, yz) = (s[(1, 0)], s[(1, 1)], s[(1, 2)]);
        let (zx, zy, zz) = (s[(2, 0)], s[(2, 1)], s[(2, 2)]);
        #[rustfmt::skip]
        let n = Matrix4::new(
            xx + yy + zz, yz - zy,       zx - xz,       xy - yx,
            yz - zy,      xx - yy - zz,  xy + yx,       zx + xz,
            zx - xz,      xy + yx,       yy - xx - zz,  yz + zy,
            xy - yx,      zx + xz,       yz + zy,       zz - xx - yy,
        );
        let eigen = SymmetricEigen::new(n);
        let q = eigen.eigenvectors.column(eigen.eigenvalues.imax());
        UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3]))
    }

    fn translation(&self, rotation: &UnitQuaternion<f64>, scale: f64) -> Translation3<f64> {
        Translation3::from(self.centroid_b - rotation * self.centroid_a * scale)
    }
}

fn refuse_line(covariance: &Matrix3<f64>, which: &str) -> Result<()> {
    let mut spreads: [f64; 3] = covariance.symmetric_eigenvalues().into();
    spreads.sort_by(f64::total_cmp);
    let (first, second) = (spreads[2].max(0.0).sqrt(), spreads[1].max(0.0).sqrt());
    if first <= f64::EPSILON || second < COLLINEARITY_RATIO * first {
        return Err(Error::Degenerate(format!(
            "{which} lies on one point or line; pick points spread over the view"
        )));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn points() -> impl Strategy<Value = Vec<Point3<f64>>> {
        prop::collection::vec(
            prop::array::uniform3(-5.0..5.0).prop_map(|[x, y, z]| Point3::new(x, y, z)),
            4..20,
        )
    }

    proptest! {
        #[test]
        fn recovers_a_known_similarity(
            a in points(), axis in prop::array::uniform3(-3.0..3.0f64), t in prop::array::uniform3(-9.0..9.0f64),
            scale in 0.01..50.0f64,
        ) {
            let truth = Similarity3::new(Vector3::from(t), Vector3::from(axis), scale);
            let b: Vec<_> = a.iter().map(|p| truth * p).collect();
            let Ok(found) = similarity(&a, &b) else { return Err(TestCaseError::reject("on a line")) };
            for (p, q) in a.iter().zip(&b) {
                prop_assert!((found * p - q).norm() < 1e-8 * scale.max(1.0));
            }
        }

        #[test]
        fn swapping_the_sets_inverts_the_scale(a in points(), noise in points()) {
            let b: Vec<_> = a.iter().zip(noise.iter().cycle()).map(|(p, n)| p + n.coords * 0.05).collect();
            if let (Ok(forth), Ok(back)) = (similarity(&a, &b), similarity(&b, &a)) {
                prop_assert!((forth.scaling() * back.scaling() - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn no_small_turn_improves_a_noisy_fit() {
        let a: Vec<_> = (0..12)
            .map(|i| Point3::new((i * 7 % 5) as f64, (i * 3 % 7) as f64, (i * 5 % 4) as f64))
            .collect();
        let truth = Isometry3::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.5, 0.1, -0.9));
        let b: Vec<_> =
            a.iter().enumerate().map(|(i, p)| truth * p + Vector3::repeat(0.02 * (i as f64).sin())).collect();
        let cost =
            |t: &Isometry3<f64>| a.iter().zip(&b).map(|(p, q)| (t * p - q).norm_squared()).sum::<f64>();
        let found = rigid(&a, &b).unwrap();
        for axis in 0..3 {
            for step in [-1e-3, 1e-3] {
                let mut twist = Vector3::zeros();
                twist[axis] = step;
                assert!(cost(&(found * Isometry3::new(Vector3::zeros(), twist))) > cost(&found));
                assert!(cost(&(Isometry3::new(twist, Vector3::zeros()) * found)) > cost(&found));
            }
        }
        assert_relative_eq!(found, truth, epsilon = 0.05);
    }

    #[test]
    fn planar_sets_are_fine_and_lines_are_refused() {
        let plane: Vec<_> =
            [(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)].map(|(x, y)| Point3::new(x, y, 4.0)).to_vec();
        let truth = Similarity3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.0, 2.0, 0.4), 2.5);
        let image: Vec<_> = plane.iter().map(|p| truth * p).collect();
        assert_relative_eq!(similarity(&plane, &image).unwrap(), truth, epsilon = 1e-9);

        let line: Vec<_> = (0..5).map(|i| Point3::new(i as f64, 2.0 * i as f64, 1.0)).collect();
        let one = vec![Point3::new(1.0, 1.0, 1.0); 5];
        let nan = vec![Point3::new(f64::NAN, 0.0, 0.0); 5];
        for bad in [&line[..], &one, &nan, &plane[..2], &[]] {
            assert!(matches!(similarity(bad, bad), Err(Error::Degenerate(_))), "{bad:?}");
        }
        assert!(similarity(&plane, &line).is_err());
    }
}
