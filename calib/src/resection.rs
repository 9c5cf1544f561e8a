//! Resection: the pose of a calibrated camera from known points and their pixels.
//!
//! A direct linear transform gives the start — the 3 × 4 projection of points in space, or the homography of
//! points on a plane (R. Hartley & A. Zisserman, *Multiple View Geometry*, 2nd ed., algorithms 7.1 and 4.2, on
//! normalised image coordinates, so that the intrinsics are used) — and Levenberg–Marquardt on the reprojection
//! error finishes it.

use nalgebra::{
    DMatrix, Isometry3, Matrix3, Matrix6, Point2, Point3, Rotation3, SMatrix, SymmetricEigen, Translation3,
    UnitQuaternion, Vector2, Vector3, Vector6,
};

use crate::{Camera, Error, Intrinsics, Result};

/// Points count as coplanar when their smallest principal spread is below this fraction of the largest.
const COPLANARITY_RATIO: f64 = 1e-3;
/// Points count as collinear when their middle principal spread is below this fraction of the largest.
const COLLINEARITY_RATIO: f64 = 1e-3;
/// Levenberg–Marquardt steps; a dozen suffice from a linear start.
const MAX_STEPS: usize = 100;

/// A point whose place in the world is known, and where the camera sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// World coordinates, metres.
    pub world: Point3<f64>,
    /// Pixel in the (distorted) image.
    pub pixel: Point2<f64>,
}

/// A camera's pose and how well it explains the picks.
#[derive(Debug, Clone)]
pub struct Resection {
    /// The camera at its pose.
    pub camera: Camera,
    /// Distance between each pick and its point's projection, pixels.
    pub residuals_px: Vec<f64>,
}

impl Resection {
    /// Root mean square residual, pixels.
    pub fn rms_px(&self) -> f64 {
        (self.residuals_px.iter().map(|r| r * r).sum::<f64>() / self.residuals_px.len() as f64).sqrt()
    }
}

/// Estimates the pose of a camera: 6 or more points in space, or 4 or more on a plane.
///
/// # Errors
/// [`Error::Degenerate`] for too few points, points on a line, a number that is not finite, a pixel that the lens
/// model has no ray for, or points that come out behind the camera.
pub fn resect(intrinsics: &Intrinsics, picks: &[Pick]) -> Result<Resection> {
    let finite = |p: &Pick| p.world.coords.iter().chain(p.pixel.coords.iter()).all(|v| v.is_finite());
    if let Some(bad) = picks.iter().position(|p| !finite(p)) {
        return Err(Error::Degenerate(format!("pick {} is not finite", bad + 1)));
    }
    let rays: Vec<Vector2<f64>> = picks
        .iter()
        .enumerate()
        .map(|(i, pick)| {
            let ray = intrinsics.unproject(&pick.pixel);
            ray.map(|r| r.xy()).ok_or_else(|| {
                Error::Degenerate(format!("pick {}: the lens model has no ray for this pixel", i + 1))
            })
        })
        .collect::<Result<_>>()?;
    let frame = PrincipalFrame::of(picks)?;
    let start =
        if frame.is_planar { from_plane(&frame, picks, &rays) } else { from_space(&frame, picks, &rays) }?;
    let pose = refine(intrinsics, picks, start);
    let camera = Camera { intrinsics: intrinsics.clone(), camera_from_world: pose };
    let residuals_px = picks
        .iter()
        .enumerate()
        .map(|(i, pick)| {
            let seen = camera.project(&pick.world);
            seen.map(|s| (s - pick.pixel).norm()).ok_or_else(|| {
                Error::Degenerate(format!(
                    "pick {} comes out behind the camera; check its coordinates",
                    i + 1
                ))
            })
        })
        .collect::<Result<_>>()?;
    Ok(Resection { camera, residuals_px })
}

/// The picks' points seen from their centroid along their principal axes, with unit mean spread.
struct PrincipalFrame {
    principal_from_world: Isometry3<f64>,
    spread: f64,
    is_planar: bool,
}

impl PrincipalFrame {
    fn of(picks: &[Pick]) -> Result<Self> {
        let n = picks.len();
        if n < 4 {
            return Err(Error::Degenerate(format!("{n} points; 6 in space or 4 on a plane are needed")));
        }
        let centroid = picks.iter().map(|p| p.world.coords).sum::<Vector3<f64>>() / n as f64;
        let covariance: Matrix3<f64> =
            picks.iter().map(|p| p.world.coords - centroid).map(|d| d * d.transpose()).sum::<Matrix3<f64>>()
                / n as f64;
        let eigen = SymmetricEigen::new(covariance);
        let mut order = [0, 1, 2];
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let spread = order.map(|i| eigen.eigenvalues[i].max(0.0).sqrt());
        if spread[1] <= COLLINEARITY_RATIO * spread[0] || spread[0] <= f64::EPSILON {
            return Err(Error::Degenerate(
                "the points lie on one line; pick points spread over the view".into(),
            ));
        }
        let is_planar = spread[2] <= COPLANARITY_RATIO * spread[0];
        if !is_planar && n < 6 {
            return Err(Error::Degenerate(format!("{n} points in space; 6 are needed (or 4 on one plane)")));
        }
        let [x, y] = [order[0], order[1]].map(|i| eigen.eigenvectors.column(i).into_owned());
        let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        let world_from_principal =
            Isometry3::from_parts(Translation3::from(centroid), UnitQuaternion::from_rotation_matrix(&axes));
        Ok(Self { principal_from_world: world_from_principal.inverse(), spread: spread[0], is_planar })
    }

    fn normalised(&self, world: &Point3<f64>) -> Vector3<f64> {
        (self.principal_from_world * world).coords / self.spread
    }

    /// `camera_from_world`, from a rotation and a translation in normalised units.
    fn pose(&self, rotation: &Matrix3<f64>, translation: Vector3<f64>) -> Isometry3<f64> {
        let nearest = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(rotation));
        Isometry3::from_parts(Translation3::from(translation * self.spread), nearest)
            * self.principal_from_world
    }
}

/// The right singular vector of the smallest singular value: the solution of `rows · p = 0`, |p| = 1.
fn null_vector(rows: DMatrix<f64>) -> Result<Vec<f64>> {
    let eigen = SymmetricEigen::new(rows.transpose() * rows);
    let vector: Vec<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imin()).iter().copied().collect();
    if vector.iter().all(|v| v.is_finite()) {
        Ok(vector)
    } else {
        Err(Error::Degenerate("the points do not determine a pose".into()))
    }
}

fn from_space(frame: &PrincipalFrame, picks: &[Pick], rays: &[Vector2<f64>]) -> Result<Isometry3<f64>> {
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
    let p = null_vector(rows)?;
    let left = Matrix3::from_fn(|r, c| p[4 * r + c]);
    let last = Vector3::new(p[3], p[7], p[11]);
    let sign = if left.determinant() < 0.0 { -1.0 } else { 1.0 };
    let scale = sign * left.norm() / 3.0_f64.sqrt();
    if scale.abs() <= f64::EPSILON {
        return Err(Error::Degenerate("the points do not determine a pose".into()));
    }
    Ok(frame.pose(&(left / scale), last / scale))
}

fn from_plane(frame: &PrincipalFrame, picks: &[Pick], rays: &[Vector2<f64>]) -> Result<Isometry3<f64>> {
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
    let h = null_vector(rows)?;
    let column = |c: usize| Vector3::new(h[c], h[3 + c], h[6 + c]);
    let (a, b, t) = (column(0), column(1), column(2));
    let scale = 0.5 * (a.norm() + b.norm());
    if scale <= f64::EPSILON {
        return Err(Error::Degenerate("the points do not determine a pose".into()));
    }
    // The plane's centroid lies in front of the camera: that fixes the homography's sign.
    let scale = if t.z < 0.0 { -scale } else { scale };
    let (a, b, t) = (a / scale, b / scale, t / scale);
    Ok(frame.pose(&Matrix3::from_columns(&[a, b, a.cross(&b)]), t))
}

/// Levenberg–Marquardt on the reprojection error. The pose is disturbed on the left:
/// `exp(ω, v) · camera_from_world`, so ∂(R X + t) = ω × (R X + t) + v.
fn refine(intrinsics: &Intrinsics, picks: &[Pick], start: Isometry3<f64>) -> Isometry3<f64> {
    let cost = |pose: &Isometry3<f64>| -> f64 {
        picks
            .iter()
            .map(|p| {
                intrinsics.project(&(pose * p.world)).map_or(f64::INFINITY, |s| (s - p.pixel).norm_squared())
            })
            .sum()
    };
    let (mut pose, mut error, mut damping) = (start, cost(&start), 1e-3);
    for _ in 0..MAX_STEPS {
        let (mut hessian, mut gradient) = (Matrix6::zeros(), Vector6::zeros());
        for pick in picks {
            let x = pose * pick.world;
            let Some(seen) = intrinsics.project(&x) else { continue };
            let point = intrinsics.project_jacobian(&x);
            let mut j = SMatrix::<f64, 2, 6>::zeros();
            j.fixed_columns_mut::<3>(0).copy_from(&(-point * x.coords.cross_matrix()));
            j.fixed_columns_mut::<3>(3).copy_from(&point);
            hessian += j.transpose() * j;
            gradient += j.transpose() * (seen - pick.pixel);
        }
        let damped = hessian + Matrix6::from_diagonal(&(hessian.diagonal() * damping));
        let Some(step) = damped.cholesky().map(|c| c.solve(&-gradient)) else { break };
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(0).into_owned());
        let candidate =
            Isometry3::from_parts(Translation3::from(step.fixed_rows::<3>(3).into_owned()), turn) * pose;
        let candidate_error = cost(&candidate);
        if candidate_error < error || !error.is_finite() {
            let converged = step.norm() < 1e-12;
            (pose, error, damping) = (candidate, candidate_error, damping * 0.1);
            if converged {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn lens() -> Intrinsics {
        let mut k = Intrinsics::from_horizontal_fov(640, 480, 75.0);
        k.distortion = [-0.2, 0.05, 0.001, -0.001, 0.0].into();
        k
    }

    /// A camera about 4 m from the origin that looks at it, turned about its axis.
    fn pose(azimuth: f64, elevation: f64, roll: f64) -> Isometry3<f64> {
        let eye =
            Point3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin())
                * 4.0;
        Isometry3::rotation(Vector3::z() * roll)
            * Isometry3::look_at_rh(&eye, &Point3::origin(), &Vector3::z())
    }

    fn facing(pose: Isometry3<f64>) -> Isometry3<f64> {
        // look_at_rh looks along −z; a camera here looks along +z with y down.
        Isometry3::rotation(Vector3::x() * std::f64::consts::PI) * pose
    }

    fn picks(camera: &Camera, points: &[[f64; 3]]) -> Vec<Pick> {
        let world = points.iter().map(|p| Point3::from(*p));
        world.map(|w| Pick { world: w, pixel: camera.project(&w).unwrap() }).collect()
    }

    const SPACE: [[f64; 3]; 7] = [
        [0.8, 0.1, 0.0],
        [-0.7, 0.4, 0.3],
        [0.2, -0.9, 0.5],
        [0.5, 0.6, -0.4],
        [-0.3, -0.5, -0.6],
        [0.0, 0.2, 0.9],
        [0.9, -0.6, 0.2],
    ];
    const PLANE: [[f64; 3]; 5] =
        [[0.9, 0.8, 0.2], [-0.8, 0.7, 0.2], [-0.9, -0.6, 0.2], [0.7, -0.9, 0.2], [0.1, 0.3, 0.2]];

    proptest! {
        #[test]
        fn exact_picks_give_the_exact_pose(azimuth in 0.0..6.2, elevation in 0.3..1.2, roll in -3.0..3.0) {
            let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(azimuth, elevation, roll)) };
            for points in [&SPACE[..], &PLANE[..], &PLANE[..4]] {
                let found = resect(&camera.intrinsics, &picks(&camera, points)).unwrap();
                prop_assert!(found.rms_px() < 1e-6, "{} px from {} points", found.rms_px(), points.len());
                let off = found.camera.camera_from_world * camera.camera_from_world.inverse();
                prop_assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6);
            }
        }
    }

    #[test]
    fn a_bad_pick_stands_out_in_its_residual() {
        let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(1.0, 0.7, 0.2)) };
        let mut seen = picks(&camera, &SPACE);
        seen[3].pixel.x += 25.0;
        let found = resect(&camera.intrinsics, &seen).unwrap();
        let worst = found.residuals_px.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).unwrap().0;
        assert_eq!(worst, 3);
        assert_relative_eq!(found.camera.center(), camera.center(), epsilon = 0.3);
    }

    #[test]
    fn degenerate_picks_are_refused() {
        let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(1.0, 0.7, 0.2)) };
        let line = [
            [0.0, 0.0, 0.0],
            [0.1, 0.1, 0.1],
            [0.2, 0.2, 0.2],
            [0.3, 0.3, 0.3],
            [-0.1, -0.1, -0.1],
            [-0.2, -0.2, -0.2],
        ];
        let mut nan = picks(&camera, &SPACE);
        nan[0].world.x = f64::NAN;
        for bad in
            [picks(&camera, &line), picks(&camera, &SPACE[..5]), picks(&camera, &PLANE[..3]), vec![], nan]
        {
            assert!(
                matches!(resect(&camera.intrinsics, &bad), Err(Error::Degenerate(_))),
                "{} picks",
                bad.len()
            );
        }
    }
}
