//! HOTA: detection and association in one figure, over all strictnesses.
//!
//! J. Luiten et al., "HOTA: a higher order metric for evaluating multi-object tracking", IJCV 129 (2021), and its
//! reference implementation TrackEval. For each of 19 thresholds α: DetA is the Jaccard index of the detections,
//! AssA the mean over the matches of their two tracks' Jaccard index, HOTA there = √(DetA · AssA); all three are
//! averaged over α. In each frame the rows are assigned once, by similarity times how well the two tracks go
//! together over the whole recording.

use super::assignment::best;
use super::grid::Grid;
use super::instant::SIMILARITY_TOLERANCE;
use super::scenario::Scenario;
use super::{Figure, Metric, percent};

/// Thresholds 0.05, 0.10 … 0.95.
const THRESHOLDS: usize = 19;

/// The HOTA figures, each 0 to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Hota {
    /// The three, where there are identities and any rows at all.
    pub scores: Option<HotaScores>,
}

/// Means over the 19 thresholds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HotaScores {
    /// √(DetA · AssA), averaged.
    pub hota: f64,
    /// Detection accuracy.
    pub det_a: f64,
    /// Association accuracy.
    pub ass_a: f64,
}

impl Metric for Hota {
    fn of(scenario: &Scenario) -> Self {
        let is_judgeable = scenario.has_identities && scenario.truth_rows + scenario.track_rows > 0;
        Self { scores: is_judgeable.then(|| scores(scenario)) }
    }

    fn figures(&self) -> Vec<Figure> {
        let of = |part: fn(&HotaScores) -> f64| percent(self.scores.as_ref().map(part));
        vec![
            Figure::new("HOTA", of(|s| s.hota), "detection and association together, over 19 strictnesses"),
            Figure::new("DetA", of(|s| s.det_a), "the detection half of HOTA"),
            Figure::new("AssA", of(|s| s.ass_a), "the association half of HOTA"),
        ]
    }
}

fn scores(scenario: &Scenario) -> HotaScores {
    let (mut truth_count, mut track_count) = (vec![0.0; scenario.people], vec![0.0; scenario.tracks]);
    for instant in &scenario.instants {
        instant.truth.iter().for_each(|person| truth_count[*person] += 1.0);
        instant.tracks.iter().for_each(|track| track_count[*track] += 1.0);
    }
    let alignment = alignment(scenario, &truth_count, &track_count);

    // Matches at each threshold, in all and by pair of person and track.
    let mut matched = [0usize; THRESHOLDS];
    let mut together = vec![Grid::zeros(scenario.people, scenario.tracks); THRESHOLDS];
    for instant in &scenario.instants {
        let weights = Grid::from_fn(instant.truth.len(), instant.tracks.len(), |i, j| {
            alignment.at(instant.truth[i], instant.tracks[j]) * instant.similarity.at(i, j)
        });
        for (i, j) in best(&weights) {
            for (index, alpha) in thresholds().enumerate() {
                if instant.similarity.at(i, j) >= alpha - SIMILARITY_TOLERANCE {
                    matched[index] += 1;
                    together[index].add(instant.truth[i], instant.tracks[j], 1.0);
                }
            }
        }
    }

    let mut mean = HotaScores { hota: 0.0, det_a: 0.0, ass_a: 0.0 };
    for (matched, together) in matched.iter().zip(&together) {
        let det_a = *matched as f64 / (scenario.truth_rows + scenario.track_rows - matched) as f64;
        let mut ass_sum = 0.0;
        for (person, truth_count) in truth_count.iter().enumerate() {
            for (track, track_count) in track_count.iter().enumerate() {
                let n = together.at(person, track);
                if n > 0.0 {
                    ass_sum += n * n / (truth_count + track_count - n);
                }
            }
        }
        let ass_a = ass_sum / (*matched).max(1) as f64;
        mean.hota += (det_a * ass_a).sqrt() / THRESHOLDS as f64;
        mean.det_a += det_a / THRESHOLDS as f64;
        mean.ass_a += ass_a / THRESHOLDS as f64;
    }
    mean
}

fn thresholds() -> impl Iterator<Item = f64> {
    (0..THRESHOLDS).map(|i| 0.05 + i as f64 * 0.05)
}

/// How well each person and track go together over the recording, before any matching: a soft Jaccard index.
fn alignment(scenario: &Scenario, truth_count: &[f64], track_count: &[f64]) -> Grid {
    let mut together = Grid::zeros(scenario.people, scenario.tracks);
    for instant in &scenario.instants {
        let similarity = &instant.similarity;
        let row_sum = |i| (0..instant.tracks.len()).map(|j| similarity.at(i, j)).sum::<f64>();
        let column_sum = |j| (0..instant.truth.len()).map(|i| similarity.at(i, j)).sum::<f64>();
        let column_sums: Vec<f64> = (0..instant.tracks.len()).map(column_sum).collect();
        for (i, person) in instant.truth.iter().enumerate() {
            let row_sum = row_sum(i);
            for (j, track) in instant.tracks.iter().enumerate() {
                let union = row_sum + column_sums[j] - similarity.at(i, j);
                if union > f64::EPSILON {
                    together.add(*person, *track, similarity.at(i, j) / union);
                }
            }
        }
    }
    Grid::from_fn(scenario.people, scenario.tracks, |i, j| {
        together.at(i, j) / (truth_count[i] + track_count[j] - together.at(i, j))
    })
}
