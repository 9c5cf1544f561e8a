//! A start by two views and growth: an essential matrix for the best pair, then frame after frame by resection
//! (J. L. Schönberger and J.-M. Frahm, "Structure-from-motion revisited", CVPR 2016, section 4, for video).

use calib::least_squares::Loss;
use nalgebra::{Isometry3, Point2, Vector3};
use rand_pcg::Pcg64Mcg;

use super::partial_reconstruction::{Adjustment, PartialReconstruction, passing};
use super::resection::{ResectedPose, resect};
use super::triangulation::TriangulationLimits;
use super::two_views::{TwoViews, parallax_beyond_rotation, relative_motion};
use crate::bundle::LensFreedom;

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
pub(crate) type FrameObservations = Vec<Vec<(usize, Point2<f64>)>>;

/// Fills the empty reconstruction as far as possible. `false` when no pair of frames starts it.
pub(crate) fn reconstruct(
    partial: &mut PartialReconstruction<'_>,
    seen: &FrameObservations,
    lens: LensFreedom,
    rng: &mut Pcg64Mcg,
) -> bool {
    if !start(partial, seen, rng) {
        return false;
    }
    grow(partial, seen, lens);
    true
}

/// Rays of the tracks two frames share.
struct FramePair {
    frames: (usize, usize),
    first: Vec<Vector3<f64>>,
    second: Vec<Vector3<f64>>,
    rank: f64,
}

/// Poses for the best pair of frames and points for their shared tracks.
fn start(partial: &mut PartialReconstruction<'_>, seen: &FrameObservations, rng: &mut Pcg64Mcg) -> bool {
    let focal = 0.5 * (partial.intrinsics.fx + partial.intrinsics.fy);
    let mut pairs = ranked_pairs(partial, seen, focal);
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
    partial.poses[a] = Some(Isometry3::identity());
    partial.poses[b] = Some(views.motion);
    partial.triangulate(
        &TriangulationLimits { max_error_px: 3.0, min_angle: 0.5_f64.to_radians(), min_sightings: 2 },
        false,
    );
    let how =
        Adjustment { gate_px: 4.0, loss: Loss::Cauchy(1.0), lens: LensFreedom::Fixed, solver: passing(15) };
    partial.adjust(&how).is_some()
}

/// Pairs of frames with enough shared tracks, the most promising first.
fn ranked_pairs(partial: &PartialReconstruction<'_>, seen: &FrameObservations, focal: f64) -> Vec<FramePair> {
    let frames = seen.len();
    let stride = (frames / 12).max(1);
    let mut pairs = Vec::new();
    for a in (0..frames).step_by(stride) {
        for b in (a + 1..frames).filter(|b| (b - a) % stride.min(3) == 0) {
            let pair = shared_rays(partial, seen, a, b);
            if pair.first.len() < MIN_SHARED {
                continue;
            }
            let Some(parallax) = parallax_beyond_rotation(&pair.first, &pair.second) else { continue };
            let rank = (pair.first.len() as f64).sqrt() * (parallax * focal).min(ENOUGH_PARALLAX_PX);
            pairs.push(FramePair { rank, ..pair });
        }
    }
    pairs.sort_by(|p, q| q.rank.total_cmp(&p.rank).then(p.frames.cmp(&q.frames)));
    pairs
}

fn shared_rays(
    partial: &PartialReconstruction<'_>,
    seen: &FrameObservations,
    a: usize,
    b: usize,
) -> FramePair {
    let mut pair = FramePair { frames: (a, b), first: Vec::new(), second: Vec::new(), rank: 0.0 };
    // Both lists are in the order of tracks.
    let mut others = seen[b].iter().peekable();
    for (track, pixel) in &seen[a] {
        while others.next_if(|(other, _)| other < track).is_some() {}
        if let Some((_, other)) = others.next_if(|(other, _)| other == track)
            && let (Some(ray), Some(other)) =
                (partial.intrinsics.unproject(pixel), partial.intrinsics.unproject(other))
        {
            pair.first.push(ray);
            pair.second.push(other);
        }
    }
    pair
}

/// Adds frames while one can be resected.
pub(crate) fn grow(partial: &mut PartialReconstruction<'_>, seen: &FrameObservations, lens: LensFreedom) {
    let mut refused = vec![false; seen.len()];
    let mut adjusted_at = partial.registered();
    loop {
        let next = (0..seen.len())
            .filter(|&f| partial.poses[f].is_none() && !refused[f])
            .map(|f| (partial.picks(&seen[f]).len(), std::cmp::Reverse(f)))
            .max();
        let Some((known, std::cmp::Reverse(frame))) = next else { break };
        if known < MIN_KNOWN {
            break;
        }
        let Some(found) = resect_frame(partial, seen, frame) else {
            refused[frame] = true;
            continue;
        };
        partial.poses[frame] = Some(found.camera_from_world);
        refused.fill(false);
        // Two observations suffice: where the camera turns fast, tracks are short, and resection tolerates wrong
        // points.
        let accept = TriangulationLimits {
            max_error_px: 3.0,
            min_angle: GROWING_ANGLE_DEG.to_radians(),
            min_sightings: 2,
        };
        partial.triangulate(&accept, true);
        if partial.registered() >= adjusted_at + (adjusted_at / 4).clamp(1, 6) {
            let how = Adjustment { gate_px: 6.0, loss: Loss::Cauchy(1.0), lens, solver: passing(8) };
            partial.adjust(&how);
            partial.triangulate(&accept, false);
            adjusted_at = partial.registered();
        }
    }
}

/// Pose of one frame from the points it observes, starting from its neighbours' poses.
fn resect_frame(
    partial: &PartialReconstruction<'_>,
    seen: &FrameObservations,
    frame: usize,
) -> Option<ResectedPose> {
    let picks = partial.picks(&seen[frame]);
    let mut starts: Vec<Isometry3<f64>> = Vec::new();
    let before: Vec<usize> = (0..frame).rev().filter(|&f| partial.poses[f].is_some()).take(2).collect();
    let after: Vec<usize> = (frame + 1..seen.len()).filter(|&f| partial.poses[f].is_some()).take(2).collect();
    for side in [&before, &after] {
        let poses: Vec<Isometry3<f64>> = side.iter().filter_map(|&f| partial.poses[f]).collect();
        starts.extend(poses.first());
        if let [near, far] = poses[..] {
            starts.push(near * far.inverse() * near);
        }
    }
    let found = starts.iter().filter_map(|s| resect(&partial.intrinsics, &picks, s, INLIER_PX));
    let best = found.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    (best.inliers >= MIN_KNOWN && 2 * best.inliers > picks.len()).then_some(best)
}
