//! Choice of a capture's key frames: spread as wide as the camera went, yet with much of the reference's view in sight.

use nalgebra::{Isometry3, Point3};

use super::DenseOptions;
use calib::Intrinsics;

/// Properties of a frame for the choice.
pub(super) struct KeyFrameCandidate {
    pub(super) frame: usize,
    pub(super) camera_from_reference: Isometry3<f64>,
    /// Mean absolute brightness gradient: blurred frames have less of it.
    pub(super) sharpness: f64,
}

impl KeyFrameCandidate {
    fn center(&self) -> Point3<f64> {
        self.camera_from_reference.inverse() * Point3::origin()
    }

    /// Median angle between the rays from the reference and from here to the points, degrees.
    fn parallax_deg(&self, points: &[Point3<f64>]) -> f64 {
        let center = self.center();
        let mut angles: Vec<f64> = points.iter().map(|p| p.coords.angle(&(p - center))).collect();
        angles.sort_by(f64::total_cmp);
        angles.get(angles.len() / 2).map_or(0.0, |angle| angle.to_degrees())
    }
}

/// Points (in the reference camera's frame) whose projections lie in a camera's image.
pub(super) fn seen_by(
    camera_from_reference: &Isometry3<f64>,
    points: &[Point3<f64>],
    intrinsics: &Intrinsics,
) -> Vec<Point3<f64>> {
    let seen = |p: &&Point3<f64>| {
        intrinsics.project(&(camera_from_reference * *p)).is_some_and(|pixel| intrinsics.contains(&pixel))
    };
    points.iter().filter(seen).copied().collect()
}

/// Chooses at most `options.key_frames` frames, farthest first: each the one whose centre lies farthest from all chosen
/// before (the reference first), with penalties for blurred frames and frames that see few of the reference's points.
/// Frames that see the points from too different a direction are left out: patches no longer look alike, and are
/// occluded.
pub(super) fn choose(
    candidates: &[KeyFrameCandidate],
    points: &[Point3<f64>],
    intrinsics: &Intrinsics,
    options: &DenseOptions,
) -> Vec<usize> {
    let mut sharpness: Vec<f64> = candidates.iter().map(|c| c.sharpness).collect();
    sharpness.sort_by(f64::total_cmp);
    let typical = sharpness.get(sharpness.len() / 2).copied().unwrap_or(1.0).max(1e-9);
    let worth: Vec<f64> = candidates
        .iter()
        .map(|c| {
            let seen = seen_by(&c.camera_from_reference, points, intrinsics).len();
            let share = seen as f64 / points.len().max(1) as f64;
            if share < options.least_shared_view || c.parallax_deg(points) > options.largest_parallax_deg {
                0.0
            } else {
                share * (c.sharpness / typical).min(1.0).powi(2)
            }
        })
        .collect();
    let mut chosen: Vec<usize> = Vec::new();
    let mut distance: Vec<f64> = candidates.iter().map(|c| c.center().coords.norm()).collect();
    while chosen.len() < options.key_frames {
        let best = (0..candidates.len())
            .filter(|i| !chosen.contains(i) && worth[*i] * distance[*i] > 0.0)
            .max_by(|a, b| (worth[*a] * distance[*a]).total_cmp(&(worth[*b] * distance[*b])));
        let Some(best) = best else { break };
        chosen.push(best);
        let center = candidates[best].center();
        for (d, c) in distance.iter_mut().zip(candidates) {
            *d = d.min((c.center() - center).norm());
        }
    }
    chosen.iter().map(|i| candidates[*i].frame).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    /// Camera that looks at the middle of points 3 away, from that angle to the side.
    fn from_the_side(frame: usize, angle_deg: f64) -> KeyFrameCandidate {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), angle_deg.to_radians());
        let middle = Translation3::new(0.0, 0.0, 3.0);
        KeyFrameCandidate { frame, camera_from_reference: middle * turn * middle.inverse(), sharpness: 1.0 }
    }

    fn things() -> Vec<Point3<f64>> {
        (0..25)
            .map(|i| Point3::new(0.2 * f64::from(i % 5) - 0.4, 0.2 * f64::from(i / 5) - 0.4, 3.0))
            .collect()
    }

    #[test]
    fn the_widest_baselines_that_patches_survive_come_first() {
        let candidates: Vec<KeyFrameCandidate> = [2.0, 33.0, -20.0, 60.0, 10.0]
            .into_iter()
            .enumerate()
            .map(|(i, a)| from_the_side(i, a))
            .collect();
        let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        let options = DenseOptions { key_frames: 3, ..DenseOptions::default() };
        assert_eq!(choose(&candidates, &things(), &lens, &options), [1, 2, 4]);
        let apart = choose(&candidates[3..4], &things(), &lens, &options);
        assert!(apart.is_empty(), "{apart:?}");
    }

    #[test]
    fn blurred_frames_and_such_as_look_elsewhere_are_put_back() {
        let mut blurred = from_the_side(7, 25.0);
        blurred.sharpness = 0.2;
        let mut elsewhere = from_the_side(8, 0.0);
        elsewhere.camera_from_reference =
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 1.2) * elsewhere.camera_from_reference;
        let candidates = [blurred, elsewhere, from_the_side(9, 15.0), from_the_side(10, -2.0)];
        let lens = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        let options = DenseOptions { key_frames: 1, ..DenseOptions::default() };
        assert_eq!(choose(&candidates, &things(), &lens, &options), [9]);
    }
}
