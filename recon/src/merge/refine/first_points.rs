//! Initial positions of the picked points for the refinement.

use nalgebra::{Matrix3, Point3, Similarity3, Vector3};

use crate::merge::LiftedPick;
use crate::surface::Surface;

/// Least angle between rays whose intersection tells the distance, degrees.
const LEAST_ANGLE_DEG: f64 = 1.0;

/// Initial position of each point: the mean of the positions by the cameras' depths, or, without any depth, the
/// intersection of the rays; `None` where it is undetermined.
pub(super) fn first_points(
    picks: &[LiftedPick],
    poses: &[Similarity3<f64>],
    surfaces: &[Surface],
) -> Vec<Option<Point3<f64>>> {
    let count = picks.iter().map(|p| p.point + 1).max().unwrap_or(0);
    (0..count)
        .map(|point| {
            let of_point = || picks.iter().filter(move |p| p.point == point);
            let seen: Vec<Vector3<f64>> =
                of_point().filter_map(|p| Some((poses[p.camera] * p.seen?).coords)).collect();
            if !seen.is_empty() {
                let n = seen.len() as f64;
                return Some(Point3::from(seen.into_iter().sum::<Vector3<f64>>() / n));
            }
            let ray = |pick: &LiftedPick| {
                let ray = surfaces[pick.camera].intrinsics.unproject(&pick.pixel)?;
                let pose = &poses[pick.camera].isometry;
                Some((Point3::from(pose.translation.vector), (pose.rotation * ray).normalize()))
            };
            intersection_of_rays(&of_point().filter_map(ray).collect::<Vec<_>>())
        })
        .collect()
}

/// Least-squares intersection of rays, each from a point in a direction of length 1; `None` if they are almost parallel
/// or meet behind the origin of one.
fn intersection_of_rays(rays: &[(Point3<f64>, Vector3<f64>)]) -> Option<Point3<f64>> {
    let across = |direction: &Vector3<f64>| Matrix3::identity() - direction * direction.transpose();
    let normal: Matrix3<f64> = rays.iter().map(|(_, direction)| across(direction)).sum();
    let moment: Vector3<f64> = rays.iter().map(|(from, direction)| across(direction) * from.coords).sum();
    // For two rays at an angle α the smallest eigenvalue is 1 − cos α.
    if rays.len() < 2 || normal.symmetric_eigenvalues().min() < 1.0 - LEAST_ANGLE_DEG.to_radians().cos() {
        return None;
    }
    let point = Point3::from(normal.cholesky()?.solve(&moment));
    rays.iter().all(|(from, direction)| (point - from).dot(direction) > 0.0).then_some(point)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn towards(from: [f64; 3], to: [f64; 3]) -> (Point3<f64>, Vector3<f64>) {
        let (from, to) = (Point3::from(from), Point3::from(to));
        (from, (to - from).normalize())
    }

    #[test]
    fn rays_meet_at_what_they_look_at() {
        let rays = [towards([0.0; 3], [1.0, 2.0, 4.0]), towards([3.0, 0.0, 0.5], [1.0, 2.0, 4.0])];
        let met = intersection_of_rays(&rays).unwrap();
        assert!((met - Point3::new(1.0, 2.0, 4.0)).norm() < 1e-12, "{met}");
        // Two rays that pass each other: in the middle of their shortest connection.
        let crossing = [towards([0.0; 3], [1.0, 0.0, 0.0]), towards([2.0, -1.0, 0.4], [2.0, 1.0, 0.4])];
        assert!((intersection_of_rays(&crossing).unwrap() - Point3::new(2.0, 0.0, 0.2)).norm() < 1e-12);
    }

    #[test]
    fn rays_that_tell_no_place_tell_none() {
        let away = [towards([0.0; 3], [-1.0, 0.1, 0.0]), towards([0.0, 1.0, 0.0], [-1.0, 0.5, 0.0])];
        let behind: Vec<_> = away.iter().map(|(from, direction)| (*from, -direction)).collect();
        assert!(intersection_of_rays(&away).is_some() && intersection_of_rays(&behind).is_none());
        let parallel = [towards([0.0; 3], [1.0, 0.0, 0.0]), towards([0.0, 0.1, 0.0], [10.0, 0.2, 0.0])];
        assert_eq!(intersection_of_rays(&parallel), None);
        assert_eq!(intersection_of_rays(&parallel[..1]), None);
        assert_eq!(intersection_of_rays(&[]), None);
    }
}
