//! Selection of frames that are informative about a camera's occlusion prediction.
//!
//! Three kinds of moments alternate: a person partly hidden, a person wholly hidden yet still tracked, and many people
//! at once. Moments of one camera keep a distance in time from each other.

use mot::jsonl::FrameLine;

use super::recording::{PersonVisibility, RunRecording};

/// Visible fraction below which a person counts as hidden.
pub(super) const HIDDEN: f64 = 0.03;
/// Visible fraction of the most informative partly hidden body.
const BEST_VISIBLE: f64 = 0.4;

/// Most informative frames of a camera, at most `count`, in time order; as indices into the recording's frames.
pub(super) fn informative(recording: &RunRecording, camera: &str, count: usize) -> Vec<usize> {
    let visibilities: Vec<Vec<PersonVisibility>> =
        recording.frames.iter().map(|f| in_view(recording, f, camera)).collect();
    let (first, last) = recording.span_s();
    let apart = 0.08 * (last - first);
    let mut chosen: Vec<usize> = Vec::new();
    let scores: [fn(&[PersonVisibility]) -> f64; 3] = [partly_hidden, wholly_hidden, crowd];
    // A second round through the kinds replaces kinds that do not occur.
    for score in scores.iter().cycle().take(2 * scores.len().max(count)) {
        if chosen.len() >= count {
            break;
        }
        let is_free = |index: usize| {
            let time = recording.frames[index].time;
            chosen.iter().all(|c| *c != index && (recording.frames[*c].time - time).abs() >= apart)
        };
        let best = (0..visibilities.len())
            .filter(|i| is_free(*i))
            .map(|i| (score(&visibilities[i]), i))
            // Of equal scores, the first in time.
            .max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        if let Some((_, index)) = best.filter(|(score, _)| *score > 0.0) {
            chosen.push(index);
        }
    }
    chosen.sort_unstable();
    chosen
}

fn in_view(recording: &RunRecording, frame: &FrameLine, camera: &str) -> Vec<PersonVisibility> {
    frame.people.iter().map(|p| recording.visibility(p, camera)).filter(|s| s.is_in_view).collect()
}

fn partly_hidden(people: &[PersonVisibility]) -> f64 {
    let informative = |s: &PersonVisibility| {
        if s.visible <= HIDDEN { 0.0 } else { 1.0 - (s.visible - BEST_VISIBLE).abs() / BEST_VISIBLE }
    };
    people.iter().map(informative).filter(|t| *t > 0.0).sum()
}

fn wholly_hidden(people: &[PersonVisibility]) -> f64 {
    let hidden = people.iter().filter(|s| s.visible <= HIDDEN).count();
    if hidden == 0 { 0.0 } else { hidden as f64 + 0.1 * people.len() as f64 }
}

fn crowd(people: &[PersonVisibility]) -> f64 {
    people.iter().map(|s| 1.0 + 0.5 * (1.0 - s.visible)).sum()
}
