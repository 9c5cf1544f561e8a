//! Which frames of a capture take part: spread as wide as the camera went, yet looking at what the reference sees.

use nalgebra::{Isometry3, Point3};

use super::DenseOptions;
use calib::Intrinsics;

/// What the choice needs to know of one frame.
pub(super) struct Candidate {
    pub(super) frame: usize,
    pub(super) camera_from_reference: Isometry3<f64>,
    /// Mean absolute brightness gradient: blurred frames have less of it.
    pub(super) sharpness: f64,
}

impl Candidate {
    fn center(&self) -> Point3<f64> {
        self.camera_from_reference.inverse() * Point3::origin()
    }
}

/// At most `options.key_frames` frames, farthest first: each the one whose centre lies farthest from all chosen
/// before (the reference first), blurred frames and such as see little of the reference's points put back.
pub(super) fn choose(
    candidates: &[Candidate],
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
            let seen = points
                .iter()
                .filter_map(|p| intrinsics.project(&(c.camera_from_reference * p)))
                .filter(|pixel| intrinsics.contains(pixel))
                .count();
            let share = seen as f64 / points.len().max(1) as f64;
            if share < options.least_shared_view {
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
