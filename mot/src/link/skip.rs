//! Frame skipping (figure 9): when people move a pixel a frame, the direction of a step is noise; over several frames
//! it is not. The recording is linked as if only every (N+1)-th frame existed.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use nalgebra::Point2;

use super::detection::{Detection, Detections};
use super::fill::{self, FillOptions};

/// Largest distance of a detection in a skipped frame from the interpolated track to which it is added, box heights.
const SNAP_HEIGHTS: f64 = 0.25;

/// Detections of the linked frames, renumbered as consecutive frames, and the index of each among all detections.
pub(super) fn kept(detections: &Detections, skip: u32) -> (Detections, Vec<u32>) {
    let first = detections.all.first().map_or(1, |d| d.frame);
    let is_kept = |d: &Detection| (d.frame - first).is_multiple_of(skip + 1);
    let chosen = detections.all.iter().enumerate().filter(|(_, d)| is_kept(d));
    let (all, places) = chosen
        .map(|(i, d)| (Detection { frame: (d.frame - first) / (skip + 1) + 1, ..d.clone() }, i as u32))
        .unzip();
    (Detections { all, on_floor: detections.on_floor }, places)
}

/// Adds the detections of skipped frames to the tracks that pass them, between the linked frames and up to `skip`
/// frames before and after a track; each detection goes to the nearest track at most.
pub(super) fn restore(detections: &Detections, tracks: &mut [Vec<u32>], skip: u32) {
    let frames: HashMap<u32, Range<usize>> = detections.frames().into_iter().collect();
    let mut offers: Vec<(f64, u32, usize)> = Vec::new();
    for (number, track) in tracks.iter().enumerate() {
        for (frame, place) in ways(detections, track, skip) {
            for node in frames.get(&frame).cloned().into_iter().flatten() {
                let found = &detections.all[node];
                let distance = (found.place - place).norm() / found.scale();
                if distance <= SNAP_HEIGHTS {
                    offers.push((distance, node as u32, number));
                }
            }
        }
    }
    offers.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut is_taken = vec![false; detections.all.len()];
    tracks.iter().flatten().for_each(|node| is_taken[*node as usize] = true);
    let mut has_frame: HashSet<(usize, u32)> = HashSet::new();
    for (_, node, number) in offers {
        let frame = detections.all[node as usize].frame;
        if !is_taken[node as usize] && has_frame.insert((number, frame)) {
            is_taken[node as usize] = true;
            tracks[number].push(node);
        }
    }
    for track in tracks {
        track.sort_unstable();
    }
}

/// Interpolated positions of a track in the frames without its detections.
fn ways(detections: &Detections, track: &[u32], skip: u32) -> Vec<(u32, Point2<f64>)> {
    let straight = FillOptions { interpolate: true, smooth_frames: 0.0 };
    let rows = fill::rows(detections, track, &straight);
    let mut ways: Vec<(u32, Point2<f64>)> =
        rows.iter().filter(|r| !r.is_seen).map(|r| (r.frame, r.place)).collect();
    if let [first, second, ..] = rows.as_slice() {
        let back = first.place - second.place;
        let before = (1..=skip).take_while(|f| *f < first.frame);
        ways.extend(before.map(|f| (first.frame - f, first.place + back * f64::from(f))));
    }
    if let [.., second, last] = rows.as_slice() {
        let on = last.place - second.place;
        ways.extend((1..=skip).map(|f| (last.frame + f, last.place + on * f64::from(f))));
    }
    ways
}
