//! The pose on which most sightings agree: RANSAC over three of them at a time, scored by the truncated squares of MSAC
//! (P. Torr & A. Zisserman, CVIU 78, 2000).

use nalgebra::{Isometry3, Vector3};

use super::sighting::{AGREES_SIGMAS, Sighting};
use crate::Intrinsics;
use crate::resection::poses_of_three_points;

/// Probability with which three agreeing sightings are drawn at least once.
const CONFIDENCE: f64 = 0.9999;
/// Fewest and most triples that are drawn.
const TRIPLES: std::ops::RangeInclusive<usize> = 200..=3000;
/// Least angle between two rays of a triple, radians: three points side by side fix no pose.
const LEAST_ANGLE: f64 = 0.03;

/// The pose with which most sightings agree; `None` for fewer than four sightings and where no triple has a pose.
pub(super) fn pose(intrinsics: &Intrinsics, sightings: &[Sighting]) -> Option<Isometry3<f64>> {
    if sightings.len() < 4 {
        return None;
    }
    let rays: Vec<Option<Vector3<f64>>> =
        sightings.iter().map(|s| Some(intrinsics.unproject(&s.pixel)?.normalize())).collect();
    let limit = AGREES_SIGMAS * AGREES_SIGMAS;
    let mut best: Option<(f64, Isometry3<f64>)> = None;
    let mut draws = Draws(1);
    let (mut drawn, mut enough) = (0, *TRIPLES.end());
    while drawn < enough {
        drawn += 1;
        let triple = [(); 3].map(|()| draws.below(sightings.len()));
        let [Some(a), Some(b), Some(c)] = triple.map(|i| rays[i]) else { continue };
        if a.angle(&b).min(b.angle(&c)).min(a.angle(&c)) < LEAST_ANGLE {
            continue;
        }
        for pose in poses_of_three_points(triple.map(|i| sightings[i].world), [a, b, c]) {
            if !pose.to_homogeneous().iter().all(|v| v.is_finite()) {
                continue;
            }
            let (mut cost, mut agreeing) = (0.0, 0);
            for sighting in sightings {
                let squared = sighting.squared(intrinsics, &pose);
                agreeing += usize::from(squared < limit);
                cost += squared.min(limit);
            }
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, pose));
                let share = agreeing as f64 / sightings.len() as f64;
                let missed = (1.0 - share.powi(3)).clamp(1e-9, 1.0 - 1e-9);
                let needed = ((1.0 - CONFIDENCE).ln() / missed.ln()).ceil() as usize;
                enough = needed.clamp(*TRIPLES.start(), *TRIPLES.end());
            }
        }
    }
    best.map(|(_, pose)| pose)
}

/// Numbers in a fixed order that looks random (the linear congruential generator of Numerical Recipes): the same
/// pictures give the same pose.
struct Draws(u32);

impl Draws {
    fn below(&mut self, count: usize) -> usize {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as usize % count
    }
}
