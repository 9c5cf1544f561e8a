//! Direct linear transforms: the projection of points in space and the homography of points on a plane (R. Hartley &
//! A. Zisserman, *Multiple View Geometry*, 2nd ed., algorithms 7.1 and 4.2).

use nalgebra::{
    DMatrix, Isometry3, Matrix3, Matrix3x4, Point3, Rotation3, SymmetricEigen, Translation3, UnitQuaternion,
    Vector2, Vector3,
};

use super::Pick;
use crate::{Error, Result};

/// Ratio of the middle to the largest principal spread below which points count as collinear.
const COLLINEARITY_RATIO: f64 = 1e-3;

/// Frame at the picks' centroid along their principal axes, the flattest last, with unit mean spread.
pub(super) struct PrincipalFrame {
    pub(super) principal_from_world: Isometry3<f64>,
    pub(super) spread: f64,
}

impl PrincipalFrame {
    /// # Errors
    /// [`Error::Degenerate`] for points on a line. They must be finite, and there must be some.
    pub(super) fn of(picks: &[Pick]) -> Result<Self> {
        let n = picks.len() as f64;
        let centroid = picks.iter().map(|p| p.world.coords).sum::<Vector3<f64>>() / n;
        let covariance: Matrix3<f64> =
            picks.iter().map(|p| p.world.coords - centroid).map(|d| d * d.transpose()).sum::<Matrix3<f64>>()
                / n;
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let spread = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
        if spread[1] <= COLLINEARITY_RATIO * spread[0] || spread[0] <= f64::EPSILON {
            return Err(Error::Degenerate(
                "the points lie on one line; pick points spread over the view".into(),
            ));
        }
        let [x, y] = [order[0], order[1]].map(|i| eigen.eigenvectors.column(i).into_owned());
        let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        let world_from_principal =
            Isometry3::from_parts(Translation3::from(centroid), UnitQuaternion::from_rotation_matrix(&axes));
        Ok(Self { principal_from_world: world_from_principal.inverse(), spread: spread[0] })
    }

    fn normalised(&self, world: &Point3<f64>) -> Vector3<f64> {
        (self.principal_from_world * world).coords / self.spread
    }

    /// `camera_from_world`, from a rotation (roughly) and a translation in normalised units.
    pub(super) fn pose(&self, rotation: &Matrix3<f64>, translation: Vector3<f64>) -> Isometry3<f64> {
        let nearest = UnitQuaternion::from_rotation_matrix(&crate::rotation::nearest(rotation));
        Isometry3::from_parts(Translation3::from(translation * self.spread), nearest)
            * self.principal_from_world
    }
}

/// The right singular vector of the smallest singular value: the solution of `rows · p = 0`, |p| = 1.
fn null_vector(rows: &DMatrix<f64>) -> Option<Vec<f64>> {
    let eigen = SymmetricEigen::new(rows.transpose() * rows);
    let vector: Vec<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).iter().copied().collect();
    vector.iter().all(|v| v.is_finite()).then_some(vector)
}

/// The 3 × 4 matrix that projects the normalised points to the rays, in front of the camera and up to a positive
/// factor.
pub(super) fn projection(
    frame: &PrincipalFrame,
    picks: &[Pick],
    rays: &[Vector2<f64>],
) -> Option<Matrix3x4<f64>> {
    let mut rows = DMatrix::zeros(2 * picks.len(), 12);
    for (i, (pick, ray)) in picks.iter().zip(rays).enumerate() {
        let p = frame.normalised(&pick.world).push(1.0);
        for k in 0..4 {
            rows[(2 * i, k)] = p[k];
            rows[(2 * i, 8 + k)] = -ray.x * p[k];
            rows[(2 * i + 1, 4 + k)] = p[k];
            rows[(2 * i + 1, 8 + k)] = -ray.y * p[k];
        }
    }
    let p = Matrix3x4::from_row_slice(&null_vector(&rows)?);
    let mirrors = p.fixed_columns::<3>(0).determinant() < 0.0;
    Some(if mirrors { -p } else { p })
}

/// `camera_from_world` of points in space.
pub(super) fn from_space(
    frame: &PrincipalFrame,
    picks: &[Pick],
    rays: &[Vector2<f64>],
) -> Option<Isometry3<f64>> {
    let p = projection(frame, picks, rays)?;
    let left = p.fixed_columns::<3>(0).into_owned();
    let scale = left.norm() / 3.0_f64.sqrt();
    (scale > f64::EPSILON).then(|| frame.pose(&(left / scale), p.column(3) / scale))
}

/// `camera_from_world` of points on a plane; points near the plane are replaced by their projections onto it.
pub(super) fn from_plane(
    frame: &PrincipalFrame,
    picks: &[Pick],
    rays: &[Vector2<f64>],
) -> Option<Isometry3<f64>> {
    let mut rows = DMatrix::zeros(2 * picks.len(), 9);
    for (i, (pick, ray)) in picks.iter().zip(rays).enumerate() {
        let p = frame.normalised(&pick.world).xy().push(1.0);
        for k in 0..3 {
            rows[(2 * i, k)] = p[k];
            rows[(2 * i, 6 + k)] = -ray.x * p[k];
            rows[(2 * i + 1, 3 + k)] = p[k];
            rows[(2 * i + 1, 6 + k)] = -ray.y * p[k];
        }
    }
    let h = null_vector(&rows)?;
    let column = |c: usize| Vector3::new(h[c], h[3 + c], h[6 + c]);
    let (a, b, t) = (column(0), column(1), column(2));
    let scale = 0.5 * (a.norm() + b.norm());
    if scale <= f64::EPSILON {
        return None;
    }
    // The plane's centroid lies in front of the camera: that fixes the homography's sign.
    let scale = if t.z < 0.0 { -scale } else { scale };
    let (a, b, t) = (a / scale, b / scale, t / scale);
    Some(frame.pose(&Matrix3::from_columns(&[a, b, a.cross(&b)]), t))
}
