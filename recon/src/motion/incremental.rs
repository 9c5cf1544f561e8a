//! A start by two views and growth: an essential matrix for the best pair, then frame after frame by resection
//! (J. L. Schönberger and J.-M. Frahm, "Structure-from-motion revisited", CVPR 2016, section 4, for video).

use nalgebra::{Isometry3, Point2, Vector3};
use rand_pcg::Pcg64Mcg;

use super::resection::{Resection, resect};
use super::sketch::{Adjustment, PASSING, Sketch};
use super::triangulation::Acceptance;
use super::two_views::{TwoViews, parallax_beyond_rotation, relative_motion};
use crate::bundle::{LensFreedom, Loss};

/// Least number of shared tracks of a starting pair.
const MIN_SHARED: usize = 40;
/// Parallax beyond which more does not raise a pair's rank, pixels.
const ENOUGH_PARALLAX_PX: f64 = 40.0;
/// Number of pairs whose relative motion is estimated.
const PAIRS_TRIED: usize = 6;
/// Distance within which a pair of rays agrees with an essential matrix, pixels.
const EPIPOLAR_PX: f64 = 1.0;
/// Least number of known points from which a frame is resected.
const MIN_KNOWN: usize = 15;
/// Pixel distance of an inlier in resection.
const INLIER_PX: f64 = 1.5;
/// Least angle between the rays to a point that frames are resected from, degrees.
const GROWING_ANGLE_DEG: f64 = 1.5;

/// Observations of each frame: (track, pixel).
pub(crate) type Seen = Vec<Vec<(usize, Point2<f64>)>>;

/// Fills the empty reconstruction as far as possible. `false` when no pair of frames starts it.
pub(crate) fn reconstruct(
    sketch: &mut Sketch<'_>,
    seen: &Seen,
    lens: LensFreedom,
    rng: &mut Pcg64Mcg,
) -> bool {
    if !start(sketch, seen, rng) {
        return false;
    }
    grow(sketch, seen, lens);
    true
}

/// Rays of the tracks two frames share.
struct Pair {
    frames: (usize, usize),
    first: Vec<Vector3<f64>>,
    second: Vec<Vector3<f64>>,
    rank: f64,
}

/// Poses for the best pair of frames and points for their shared tracks.
fn start(sketch: &mut Sketch<'_>, seen: &Seen, rng: &mut Pcg64Mcg) -> bool {
    let focal = 0.5 * (sketch.intrinsics.fx + sketch.intrinsics.fy);
    let mut pairs = ranked_pairs(sketch, seen, focal);
    pairs.truncate(PAIRS_TRIED);
    let mut best: Option<(usize, (usize, usize), TwoViews)> = None;
    for pair in pairs {
        let Some(views) = relative_motion(&pair.first, &pair.second, EPIPOLAR_PX / focal, rng) else {
            continue;
        };
        // A point counts when its rays meet at two degrees or more.
        let apart = |i: &&usize| {
            (views.motion.rotation * pair.first[**i]).angle(&pair.second[**i]) > 2.0_f64.to_radians()
        };
        let worth = views.agreeing.len() + views.agreeing.iter().filter(apart).count();
        if best.as_ref().is_none_or(|(most, ..)| worth > *most) {
            best = Some((worth, pair.frames, views));
        }
    }
    let Some((_, (a, b), views)) = best else { return false };
    if views.agreeing.len() < MIN_SHARED / 2 {
        return false;
    }
    sketch.poses[a] = Some(Isometry3::identity());
    sketch.poses[b] = Some(views.motion);
    sketch.triangulate(
        &Acceptance { max_error_px: 3.0, min_angle: 0.5_f64.to_radians(), min_sightings: 2 },
        false,
    );
    let how = Adjustment {
        gate_px: 4.0,
        loss: Loss::Cauchy(1.0),
        lens: LensFreedom::Fixed,
        max_steps: 15,
        cost_end: PASSING,
    };
    sketch.adjust(&how).is_some()
}

/// Pairs of frames with enough shared tracks, the most promising first.
fn ranked_pairs(sketch: &Sketch<'_>, seen: &Seen, focal: f64) -> Vec<Pair> {
    let frames = seen.len();
    let stride = (frames / 12).max(1);
    let mut pairs = Vec::new();
    for a in (0..frames).step_by(stride) {
        for b in (a + 1..frames).filter(|b| (b - a) % stride.min(3) == 0) {
            let pair = shared_rays(sketch, seen, a, b);
            if pair.first.len() < MIN_SHARED {
                continue;
            }
            let Some(parallax) = parallax_beyond_rotation(&pair.first, &pair.second) else { continue };
            let rank = (pair.first.len() as f64).sqrt() * (parallax * focal).min(ENOUGH_PARALLAX_PX);
            pairs.push(Pair { rank, ..pair });
        }
    }
    pairs.sort_by(|p, q| q.rank.total_cmp(&p.rank).then(p.frames.cmp(&q.frames)));
    pairs
}

fn shared_rays(sketch: &Sketch<'_>, seen: &Seen, a: usize, b: usize) -> Pair {
    let mut pair = Pair { frames: (a, b), first: Vec::new(), second: Vec::new(), rank: 0.0 };
    // Both lists are in the order of tracks.
    let mut others = seen[b].iter().peekable();
    for (track, pixel) in &seen[a] {
        while others.next_if(|(other, _)| other < track).is_some() {}
        if let Some((_, other)) = others.next_if(|(other, _)| other == track)
            && let (Some(ray), Some(other)) =
                (sketch.intrinsics.unproject(pixel), sketch.intrinsics.unproject(other))
        {
            pair.first.push(ray);
            pair.second.push(other);
        }
    }
    pair
}

/// Adds frames while one can be resected.
pub(crate) fn grow(sketch: &mut Sketch<'_>, seen: &Seen, lens: LensFreedom) {
    let mut refused = vec![false; seen.len()];
    let mut adjusted_at = sketch.registered();
    loop {
        let next = (0..seen.len())
            .filter(|&f| sketch.poses[f].is_none() && !refused[f])
            .map(|f| (sketch.pairs(&seen[f]).len(), std::cmp::Reverse(f)))
            .max();
        let Some((known, std::cmp::Reverse(frame))) = next else { break };
        if known < MIN_KNOWN {
            break;
        }
        let Some(found) = resect_frame(sketch, seen, frame) else {
            refused[frame] = true;
            continue;
        };
        sketch.poses[frame] = Some(found.camera_from_world);
        refused.fill(false);
        // Two observations suffice: where the camera turns fast, tracks are short, and resection tolerates wrong
        // points.
        let accept =
            Acceptance { max_error_px: 3.0, min_angle: GROWING_ANGLE_DEG.to_radians(), min_sightings: 2 };
        sketch.triangulate(&accept, true);
        if sketch.registered() >= adjusted_at + (adjusted_at / 4).clamp(1, 6) {
            let how =
                Adjustment { gate_px: 6.0, loss: Loss::Cauchy(1.0), lens, max_steps: 8, cost_end: PASSING };
            sketch.adjust(&how);
            sketch.triangulate(&accept, false);
            adjusted_at = sketch.registered();
        }
    }
}

/// Pose of one frame from the points it observes, starting from its neighbours' poses.
fn resect_frame(sketch: &Sketch<'_>, seen: &Seen, frame: usize) -> Option<Resection> {
    let pairs = sketch.pairs(&seen[frame]);
    let mut starts: Vec<Isometry3<f64>> = Vec::new();
    let before: Vec<usize> = (0..frame).rev().filter(|&f| sketch.poses[f].is_some()).take(2).collect();
    let after: Vec<usize> = (frame + 1..seen.len()).filter(|&f| sketch.poses[f].is_some()).take(2).collect();
    for side in [&before, &after] {
        let poses: Vec<Isometry3<f64>> = side.iter().filter_map(|&f| sketch.poses[f]).collect();
        starts.extend(poses.first());
        if let [near, far] = poses[..] {
            starts.push(near * far.inverse() * near);
        }
    }
    let found = starts.iter().filter_map(|s| resect(&sketch.intrinsics, &pairs, s, INLIER_PX));
    let best = found.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    (best.inliers >= MIN_KNOWN && 2 * best.inliers > pairs.len()).then_some(best)
}
