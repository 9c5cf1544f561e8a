//! Check for a second, different reconstruction that fits the same tracks almost as well.
//!
//! With repeated things, or a path that hardly shows depth, a capture can be interpreted in two ways, and the smaller
//! error need not be the right one. The two starts of [`super::estimate`] are independent enough to detect this: where
//! both fit, they must agree.

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};

use super::partial_reconstruction::PartialReconstruction;

/// Relative excess of the worse start's error up to which it fits almost as well.
const ALMOST: f64 = 0.1;
/// Root mean square difference of poses above which they are another motion: degrees, and share of the path's extent.
const OTHER_DEG: f64 = 1.0;
const OTHER_SHARE: f64 = 0.1;

/// Difference of two motions, independent of their frames and scales.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Difference {
    /// Root mean square rotation, degrees.
    rotation_deg: f64,
    /// Root mean square distance of the centres as a share of the first motion's extent.
    position_share: f64,
}

/// Warning when the start that lost fits almost as well as the one that was kept, and differs from it.
pub(super) fn doubt(
    kept: &PartialReconstruction<'_>,
    lost: Option<&PartialReconstruction<'_>>,
) -> Option<String> {
    let lost = lost?;
    let errors = [kept.robust_error_px(), lost.robust_error_px()];
    let difference = difference(&kept.poses, &lost.poses)?;
    is_ambiguous(errors, &difference).then(|| {
        format!(
            "two different motions fit its capture almost equally well ({:.2} and {:.2} px; they differ by {:.1}° and {:.0} % of \
             the path), so the one kept may be wrong: look at its preview, and film along a wider path, with more different \
             things in view",
            errors[0],
            errors[1],
            difference.rotation_deg,
            100.0 * difference.position_share
        )
    })
}

fn is_ambiguous([kept_px, lost_px]: [f64; 2], difference: &Difference) -> bool {
    lost_px <= (1.0 + ALMOST) * kept_px
        && (difference.rotation_deg > OTHER_DEG || difference.position_share > OTHER_SHARE)
}

/// Difference over the frames that both motions have; `None` for fewer than three, or without movement.
fn difference(a: &[Option<Isometry3<f64>>], b: &[Option<Isometry3<f64>>]) -> Option<Difference> {
    let both: Vec<(Isometry3<f64>, Isometry3<f64>)> =
        a.iter().zip(b).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
    if both.len() < 3 {
        return None;
    }
    // Rotation of world a from world b, averaged over the frames.
    let turns: Matrix3<f64> =
        both.iter().map(|(a, b)| (a.rotation.inverse() * b.rotation).to_rotation_matrix().into_inner()).sum();
    let turn = UnitQuaternion::from_rotation_matrix(&calib::rotation::nearest(&turns));
    let center = |pose: &Isometry3<f64>| (pose.inverse() * Point3::origin()).coords;
    let mut ours: Vec<Vector3<f64>> = both.iter().map(|(a, _)| center(a)).collect();
    let mut theirs: Vec<Vector3<f64>> = both.iter().map(|(_, b)| turn * center(b)).collect();
    let count = both.len() as f64;
    for centers in [&mut ours, &mut theirs] {
        let mean: Vector3<f64> = centers.iter().sum::<Vector3<f64>>() / count;
        for c in centers.iter_mut() {
            *c -= mean;
        }
    }
    let squares = |centers: &[Vector3<f64>]| centers.iter().map(Vector3::norm_squared).sum::<f64>();
    let (extent, other) = (squares(&ours), squares(&theirs));
    if extent <= 0.0 || other <= 0.0 {
        return None;
    }
    let scale = ours.iter().zip(&theirs).map(|(p, q)| p.dot(q)).sum::<f64>() / other;
    let apart: Vec<Vector3<f64>> = ours.iter().zip(&theirs).map(|(p, q)| p - scale * q).collect();
    let angles: f64 =
        both.iter().map(|(a, b)| (a.rotation * turn).angle_to(&b.rotation).to_degrees().powi(2)).sum();
    Some(Difference {
        rotation_deg: (angles / count).sqrt(),
        position_share: (squares(&apart) / extent).sqrt(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(bend: f64) -> Vec<Option<Isometry3<f64>>> {
        let pose = |i: i32| {
            let s = f64::from(i) * 0.1;
            let shift = Vector3::new(s, 0.3 * s * s + bend * s.sin(), 0.1 * s);
            Isometry3::new(shift, Vector3::new(0.1 * s, -0.2 * s + bend * s * s, 0.05))
        };
        (0..12).map(|i| (i != 4).then(|| pose(i))).collect()
    }

    #[test]
    fn frame_and_scale_are_no_difference() {
        let world = Isometry3::new(Vector3::new(3.0, -1.0, 2.0), Vector3::new(0.4, 1.0, -0.7));
        let moved = path(0.0).into_iter().map(|pose| {
            let mut pose = pose? * world;
            pose.translation.vector *= 2.5;
            Some(pose)
        });
        // A pose's translation scales with the world after rotation and shift.
        let same = difference(&path(0.0), &moved.collect::<Vec<_>>()).unwrap();
        assert!(same.rotation_deg < 1e-5 && same.position_share < 1e-9, "{same:?}");
        assert!(!is_ambiguous([0.5, 0.5], &same));
    }

    #[test]
    fn another_motion_that_fits_as_well_is_a_rival() {
        let other = difference(&path(0.0), &path(0.2)).unwrap();
        assert!(other.rotation_deg > 2.0 && other.position_share > 0.1, "{other:?}");
        assert!(is_ambiguous([0.5, 0.52], &other) && !is_ambiguous([0.5, 0.6], &other));
        let turned = Difference { rotation_deg: 0.2, position_share: 0.3 };
        assert!(is_ambiguous([0.5, 0.5], &turned));
    }

    #[test]
    fn too_few_frames_or_no_movement_say_nothing() {
        assert_eq!(difference(&path(0.0)[3..6], &path(0.1)[3..6]), None);
        let still = vec![Some(Isometry3::identity()); 5];
        assert_eq!(difference(&still, &still), None);
    }
}
