//! Overlapping windows of a long sequence, each factorized and adjusted, chained by absolute orientation.

use calib::Intrinsics;
use calib::absolute_orientation::similarity_weighted;
use calib::least_squares::{Loss, Options};
use nalgebra::{Isometry3, Point3, Similarity3, Vector2};
use rayon::prelude::*;

use super::affine::{MIN_COMPLETE, Measurements};
use super::perspective;
use crate::bundle::{BundleOptions, BundleProblem, BundleState, Observation};
use crate::features::FeatureTrack;

/// Longest window, frames; longer ones gain little and hold few complete tracks.
const MAX_FRAMES: usize = 40;
/// Shortest window that is factorized.
const MIN_FRAMES: usize = 4;
/// Complete tracks a window should have; it shrinks until it has them.
const ENOUGH_COMPLETE: usize = 40;
/// Least share of a window's frames in which a track must be observed to take part.
const MIN_SEEN: f64 = 0.6;
/// Largest number of tracks that take part.
const MAX_TRACKS: usize = 300;
/// Least number of shared points by which two windows are chained.
const MIN_SHARED: usize = 8;
/// Mean robust cost of an observation (px²) beyond which a window has converged to a wrong minimum.
const MAX_COST: f64 = 0.6;

/// A range of frames reconstructed on its own.
struct FrameWindow {
    /// First frame.
    first: usize,
    poses: Vec<Isometry3<f64>>,
    /// Points as (track, position).
    points: Vec<(usize, Point3<f64>)>,
    /// Mean robust cost of an observation, px².
    cost: f64,
}

/// Poses of the frames that a chain of windows reaches; `None` when not even one window factorizes.
///
/// The chain starts at the window with the smallest residual and goes both ways until one cannot be placed; frames
/// beyond are left to resection.
pub(crate) fn reconstruct(
    tracks: &[FeatureTrack],
    intrinsics: &Intrinsics,
    frames: usize,
) -> Option<Vec<Option<Isometry3<f64>>>> {
    let windows: Vec<Option<FrameWindow>> = cover(tracks, frames)
        .into_par_iter()
        .map(|(first, length, chosen)| solve(tracks, &chosen, intrinsics, first, length))
        .map(|window| window.filter(|w| w.cost <= MAX_COST))
        .collect();
    let (start, _) = windows
        .iter()
        .enumerate()
        .filter_map(|(index, window)| Some((index, window.as_ref()?.cost)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    let mut chain = WindowChain { poses: vec![None; frames], points: vec![None; tracks.len()] };
    for window in windows[start..].iter().map_while(Option::as_ref) {
        if !chain.append(window) {
            break;
        }
    }
    for window in windows[..start].iter().rev().map_while(Option::as_ref) {
        if !chain.append(window) {
            break;
        }
    }
    Some(chain.poses)
}

/// Windows that overlap by half, with the tracks that take part in each.
fn cover(tracks: &[FeatureTrack], frames: usize) -> Vec<(usize, usize, Vec<usize>)> {
    let mut windows = Vec::new();
    let mut first = 0;
    while first + MIN_FRAMES <= frames {
        let Some((length, chosen)) = choose(tracks, first, frames) else {
            first += 1;
            continue;
        };
        windows.push((first, length, chosen));
        if first + length >= frames {
            break;
        }
        first += (length / 2).max(1);
    }
    windows
}

/// Poses and points of the windows so far, in the frame and scale of the first.
struct WindowChain {
    /// Pose of each frame.
    poses: Vec<Option<Isometry3<f64>>>,
    /// Point of each track.
    points: Vec<Option<Point3<f64>>>,
}

impl WindowChain {
    /// Appends a window; `false` when it shares too little with the chain.
    fn append(&mut self, window: &FrameWindow) -> bool {
        let Some(placed) = place(window, &self.points) else { return false };
        for (offset, pose) in window.poses.iter().enumerate() {
            self.poses[window.first + offset].get_or_insert_with(|| moved(pose, &placed));
        }
        for (track, point) in &window.points {
            self.points[*track].get_or_insert(placed * point);
        }
        true
    }
}

/// The longest window from a frame on with enough complete tracks, and the tracks that take part.
fn choose(tracks: &[FeatureTrack], first: usize, frames: usize) -> Option<(usize, Vec<usize>)> {
    let longest = MAX_FRAMES.min(frames - first);
    let seen_within = |track: &FeatureTrack, end: usize| {
        track.observations.iter().filter(|(f, _)| (first..end).contains(f)).count()
    };
    let complete = |length: usize| tracks.iter().filter(|t| seen_within(t, first + length) == length).count();
    let length = (MIN_FRAMES..=longest)
        .rev()
        .find(|&n| complete(n) >= ENOUGH_COMPLETE)
        .or_else(|| (complete(MIN_FRAMES.min(longest)) >= MIN_COMPLETE).then_some(MIN_FRAMES.min(longest)))?;
    let mut chosen: Vec<(usize, usize)> = tracks
        .iter()
        .enumerate()
        .map(|(index, track)| (seen_within(track, first + length), index))
        .filter(|(seen, _)| *seen as f64 >= MIN_SEEN * length as f64)
        .collect();
    chosen.sort_by_key(|(seen, index)| (std::cmp::Reverse(*seen), *index));
    chosen.truncate(MAX_TRACKS);
    Some((length, chosen.into_iter().map(|(_, index)| index).collect()))
}

/// Factorizes one window; both depth interpretations are adjusted, and the one with the smaller residual stays.
fn solve(
    tracks: &[FeatureTrack],
    chosen: &[usize],
    intrinsics: &Intrinsics,
    first: usize,
    length: usize,
) -> Option<FrameWindow> {
    let mut measured: Measurements = Vec::with_capacity(chosen.len());
    let mut observations: Vec<Vec<Observation>> = Vec::with_capacity(chosen.len());
    for &index in chosen {
        let mut row = vec![None; length];
        let mut seen = Vec::new();
        for (frame, pixel) in &tracks[index].observations {
            if let Some(slot) = frame.checked_sub(first).and_then(|f| row.get_mut(f)) {
                let ray = intrinsics.unproject(pixel)?;
                *slot = Some(Vector2::new(ray.x, ray.y));
                seen.push(Observation::new(frame - first, *pixel));
            }
        }
        measured.push(row);
        observations.push(seen);
    }
    let solver = Options { max_iterations: 25, cost_tolerance: 1e-4, ..Options::default() };
    let mut problem = BundleProblem {
        observations,
        on_plane: Vec::new(),
        options: BundleOptions { solver, ..Default::default() },
    };
    let adjusted = perspective::factorize(&measured).into_iter().map(|(metric, _)| {
        let points = metric.points.into_iter().map(Point3::from).collect();
        let mut state = BundleState { intrinsics: intrinsics.clone(), poses: metric.poses, points };
        let mut cost = f64::INFINITY;
        for loss in [Loss::Huber(2.0), Loss::Cauchy(1.0)] {
            problem.options.loss = loss;
            cost = problem.adjust(&mut state).final_cost;
        }
        (cost, state)
    });
    let (cost, state) = adjusted.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let agrees = |point: usize| problem.observations[point].iter().all(|o| state.error_px(point, o) < 3.0);
    let points = chosen
        .iter()
        .enumerate()
        .filter(|(p, _)| agrees(*p))
        .map(|(p, &track)| (track, state.points[p]))
        .collect();
    let cost = cost / problem.observation_count().max(1) as f64;
    Some(FrameWindow { first, cost, poses: state.poses, points })
}

/// `chain_from_window`, by the shared points; distant points, whose depths are uncertain, count less.
fn place(window: &FrameWindow, known: &[Option<Point3<f64>>]) -> Option<Similarity3<f64>> {
    if known.iter().all(Option::is_none) {
        return Some(Similarity3::identity());
    }
    let (mut a, mut b, mut weights) = (Vec::new(), Vec::new(), Vec::new());
    for (track, point) in &window.points {
        if let Some(chain) = known[*track] {
            let depth = (window.poses[0] * point).z;
            a.push(*point);
            b.push(chain);
            // The standard deviation of a depth grows with the depth squared.
            weights.push(1.0 / depth.max(1e-3).powi(4));
        }
    }
    if a.len() < MIN_SHARED {
        return None;
    }
    let mut placed = similarity_weighted(&a, &b, &weights).ok()?;
    for _ in 0..10 {
        let off: Vec<f64> =
            a.iter().zip(&b).zip(&weights).map(|((a, b), w)| (placed * a - b).norm_squared() * w).collect();
        let mut sorted = off.clone();
        sorted.sort_by(f64::total_cmp);
        let scale = sorted[sorted.len() / 2].max(f64::MIN_POSITIVE);
        let robust: Vec<f64> =
            weights.iter().zip(&off).map(|(w, s)| w * Loss::Cauchy(1.0).weight(s / scale)).collect();
        placed = similarity_weighted(&a, &b, &robust).ok()?;
    }
    Some(placed)
}

/// A pose of the window's frame in the chain's, whose unit of length it takes.
fn moved(pose: &Isometry3<f64>, chain_from_window: &Similarity3<f64>) -> Isometry3<f64> {
    let rotation = pose.rotation * chain_from_window.isometry.rotation.inverse();
    // The camera's centre transforms as a point.
    let center = chain_from_window * (pose.inverse() * Point3::origin());
    Isometry3::from_parts((rotation * -center.coords).into(), rotation)
}
