//! Triangulation of a track's point from the poses that observed it.

use calib::Intrinsics;
use calib::least_squares::{Loss, NormalEquations, Options, Problem, minimise};
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Vector3};

const SOLVER: Options = Options { max_iterations: 15, cost_tolerance: 1e-6, initial_damping: 1e-3 };

/// One observation: the camera's pose and the pixel.
pub(crate) type PoseObservation<'a> = (&'a Isometry3<f64>, Point2<f64>);

/// Conditions for accepting a triangulated point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TriangulationLimits {
    /// Largest reprojection error of an inlier observation, pixels.
    pub(crate) max_error_px: f64,
    /// Least angle between two inlier rays, radians.
    pub(crate) min_angle: f64,
    /// Least number of inlier observations.
    pub(crate) min_sightings: usize,
}

/// World point on which the observations agree; `None` when too few agree or their rays are too parallel.
pub(crate) fn triangulate(
    intrinsics: &Intrinsics,
    sightings: &[PoseObservation<'_>],
    accept: &TriangulationLimits,
) -> Option<Point3<f64>> {
    let mut used: Vec<PoseObservation<'_>> = sightings.to_vec();
    // The second pass leaves out the outliers of the first.
    for _ in 0..2 {
        if used.len() < accept.min_sightings.max(2) {
            return None;
        }
        let mut point = nearest_to_rays(intrinsics, &used)?;
        let loss = Loss::Cauchy(0.5 * accept.max_error_px);
        minimise(&Reprojection { intrinsics, sightings: &used, loss }, &mut point, &SOLVER);
        let agreeing: Vec<PoseObservation<'_>> = sightings
            .iter()
            .filter(|s| error_px(intrinsics, s, &point) <= accept.max_error_px)
            .copied()
            .collect();
        if agreeing.len() >= accept.min_sightings && 2 * agreeing.len() > sightings.len() {
            let apart = widest_angle(agreeing.iter().map(|s| s.0), &point) >= accept.min_angle;
            return apart.then_some(point);
        }
        used = agreeing;
    }
    None
}

/// Distance between an observation and the projection; infinite behind the camera.
fn error_px(intrinsics: &Intrinsics, sighting: &PoseObservation<'_>, point: &Point3<f64>) -> f64 {
    intrinsics.project(&(sighting.0 * point)).map_or(f64::INFINITY, |p| (p - sighting.1).norm())
}

/// Widest angle between the rays to a point, radians, from the first ray and from the ray furthest from it.
pub(crate) fn widest_angle<'a>(poses: impl Iterator<Item = &'a Isometry3<f64>>, point: &Point3<f64>) -> f64 {
    let rays: Vec<Vector3<f64>> = poses.map(|pose| point - pose.inverse() * Point3::origin()).collect();
    let furthest = |from: &Vector3<f64>| {
        let angles = rays.iter().map(|r| r.angle(from)).enumerate();
        angles.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
    };
    let Some(first) = rays.first() else { return 0.0 };
    let (index, _) = furthest(first);
    furthest(&rays[index]).1
}

/// Point with the least squared distances to all rays.
fn nearest_to_rays(intrinsics: &Intrinsics, sightings: &[PoseObservation<'_>]) -> Option<Point3<f64>> {
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (pose, pixel) in sightings {
        let direction = pose.rotation.inverse() * intrinsics.unproject(pixel)?.normalize();
        let center = pose.inverse() * Point3::origin();
        let across = Matrix3::identity() - direction * direction.transpose();
        normal += across;
        right += across * center.coords;
    }
    normal.cholesky().map(|c| Point3::from(c.solve(&right)))
}

/// Reprojection of one point into all its sightings.
struct Reprojection<'a> {
    intrinsics: &'a Intrinsics,
    sightings: &'a [PoseObservation<'a>],
    loss: Loss,
}

impl Problem for Reprojection<'_> {
    type State = Point3<f64>;
    type Equations = NormalEquations<3>;

    fn cost(&self, point: &Point3<f64>) -> f64 {
        let squared = |s: &PoseObservation<'_>| error_px(self.intrinsics, s, point).min(1e3).powi(2);
        self.sightings.iter().map(|s| self.loss.cost(squared(s))).sum()
    }

    fn linearise(&self, point: &Point3<f64>) -> NormalEquations<3> {
        let mut equations = NormalEquations::default();
        for (pose, pixel) in self.sightings {
            let camera_point = *pose * point;
            let Some(projected) = self.intrinsics.project(&camera_point) else { continue };
            let by_camera_point = self.intrinsics.project_jacobian(&camera_point);
            let residual = projected - pixel;
            let weight = self.loss.weight(residual.norm_squared());
            let rotation = pose.rotation.to_rotation_matrix();
            equations.add(&(by_camera_point * rotation.matrix()), &residual, weight);
        }
        equations
    }

    fn moved(&self, point: &Point3<f64>, step: &Vector3<f64>) -> Point3<f64> {
        point + step
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn poses() -> Vec<Isometry3<f64>> {
        (0..6)
            .map(|i| {
                Isometry3::new(
                    Vector3::new(-0.1 * f64::from(i), 0.02, 0.0),
                    Vector3::new(0.0, 0.02 * f64::from(i), 0.0),
                )
            })
            .collect()
    }

    const ACCEPT: TriangulationLimits =
        TriangulationLimits { max_error_px: 2.0, min_angle: 0.01, min_sightings: 3 };

    #[test]
    fn a_point_is_found_with_one_wrong_sighting_and_refused_without_parallax() {
        let (camera, truth) = (Intrinsics::from_horizontal_fov(640, 480, 60.0), Point3::new(0.3, -0.2, 3.0));
        let poses = poses();
        let mut sightings: Vec<PoseObservation<'_>> =
            poses.iter().map(|p| (p, camera.project(&(p * truth)).unwrap())).collect();
        assert!((triangulate(&camera, &sightings, &ACCEPT).unwrap() - truth).norm() < 1e-6);
        sightings[2].1.y += 15.0;
        assert!((triangulate(&camera, &sightings, &ACCEPT).unwrap() - truth).norm() < 0.02);
        let still = vec![sightings[0]; 5];
        assert!(triangulate(&camera, &still, &ACCEPT).is_none());
        assert!(triangulate(&camera, &sightings[..1], &ACCEPT).is_none());
    }

    #[test]
    fn points_behind_are_refused() {
        let (camera, poses) = (Intrinsics::from_horizontal_fov(640, 480, 60.0), poses());
        // Rays that diverge in front of the cameras meet behind them.
        let sightings: Vec<PoseObservation<'_>> =
            poses.iter().enumerate().map(|(i, p)| (p, Point2::new(320.0 + 40.0 * i as f64, 240.0))).collect();
        assert!(triangulate(&camera, &sightings, &ACCEPT).is_none());
    }
}
