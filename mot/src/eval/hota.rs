//! HOTA: detection and association in one figure, over all strictnesses.
//!
//! J. Luiten et al., "HOTA: a higher order metric for evaluating multi-object tracking", IJCV 129 (2021), and its
//! reference implementation TrackEval. For each of 19 thresholds α: DetA is the Jaccard index of the detections, AssA
//! the mean over the matches of their two tracks' Jaccard index, HOTA there = √(DetA · AssA); all three are averaged
//! over α. In each frame the rows are assigned once, by similarity times the soft Jaccard index of the two tracks over
//! the whole recording.

use std::collections::HashMap;

use super::assignment::best;
use super::grid::PairTable;
use super::instant::SIMILARITY_TOLERANCE;
use super::pair_sums::PairSums;
use super::scenario::Scenario;
use super::{MetricFigure, TrackMetric, percent};

/// Number of thresholds 0.05, 0.10 … 0.95.
const THRESHOLDS: usize = 19;

/// HOTA figures, each 0 to 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Hota {
    /// Means over the 19 thresholds; `None` without identities or rows.
    pub scores: Option<HotaScores>,
    /// Figures at each threshold, the least strict first; empty where there are no scores.
    pub by_threshold: Vec<HotaScores>,
    tallies: Vec<ThresholdTally>,
}

/// Figures at one threshold, or their means.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HotaScores {
    /// √(DetA · AssA), averaged.
    pub hota: f64,
    /// Detection accuracy.
    pub det_a: f64,
    /// Association accuracy.
    pub ass_a: f64,
    /// Detection recall.
    pub det_re: f64,
    /// Detection precision.
    pub det_pr: f64,
    /// Association recall.
    pub ass_re: f64,
    /// Association precision.
    pub ass_pr: f64,
    /// Mean similarity of the matches.
    pub loc_a: f64,
}

/// Counts at one threshold; sums of several recordings are sums of these.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct ThresholdTally {
    matched: usize,
    truth: usize,
    tracks: usize,
    /// Sums over the matches of their tracks' Jaccard index, recall and precision, and of their similarity.
    ass_a: f64,
    ass_re: f64,
    ass_pr: f64,
    similarity: f64,
}

impl TrackMetric for Hota {
    fn of(scenario: &Scenario) -> Self {
        let is_judgeable = scenario.has_identities && scenario.truth_rows + scenario.track_rows > 0;
        Self::from_tallies(if is_judgeable { tallies(scenario) } else { Vec::new() })
    }

    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let mut sum: Vec<ThresholdTally> = Vec::new();
        for part in parts.filter(|p| !p.tallies.is_empty()) {
            sum.resize(THRESHOLDS, ThresholdTally::default());
            for (sum, tally) in sum.iter_mut().zip(&part.tallies) {
                sum.add(tally);
            }
        }
        Self::from_tallies(sum)
    }

    fn figures(&self) -> Vec<MetricFigure> {
        let of = |part: fn(&HotaScores) -> f64| percent(self.scores.as_ref().map(part));
        vec![
            MetricFigure::new(
                "HOTA",
                of(|s| s.hota),
                "detection and association together, over 19 strictnesses",
            ),
            MetricFigure::new("DetA", of(|s| s.det_a), "the detection half of HOTA"),
            MetricFigure::new("AssA", of(|s| s.ass_a), "the association half of HOTA"),
            MetricFigure::new("DetRe", of(|s| s.det_re), "share of the truth that is found"),
            MetricFigure::new("DetPr", of(|s| s.det_pr), "share of the tracks' rows that match a person"),
            MetricFigure::new(
                "AssRe",
                of(|s| s.ass_re),
                "share of a person's life that the matched track covers",
            ),
            MetricFigure::new(
                "AssPr",
                of(|s| s.ass_pr),
                "share of a track that stands for the matched person",
            ),
            MetricFigure::new("LocA", of(|s| s.loc_a), "mean similarity of the matches"),
        ]
    }
}

impl Hota {
    fn from_tallies(tallies: Vec<ThresholdTally>) -> Self {
        let by_threshold: Vec<HotaScores> = tallies.iter().map(ThresholdTally::scores).collect();
        let mean =
            |part: fn(&HotaScores) -> f64| by_threshold.iter().map(part).sum::<f64>() / THRESHOLDS as f64;
        let scores = (!by_threshold.is_empty()).then(|| HotaScores {
            hota: mean(|s| s.hota),
            det_a: mean(|s| s.det_a),
            ass_a: mean(|s| s.ass_a),
            det_re: mean(|s| s.det_re),
            det_pr: mean(|s| s.det_pr),
            ass_re: mean(|s| s.ass_re),
            ass_pr: mean(|s| s.ass_pr),
            loc_a: mean(|s| s.loc_a),
        });
        Self { scores, by_threshold, tallies }
    }

    /// Thresholds of [`Self::by_threshold`].
    pub fn thresholds() -> impl Iterator<Item = f64> {
        (0..THRESHOLDS).map(|i| 0.05 + i as f64 * 0.05)
    }
}

impl ThresholdTally {
    fn add(&mut self, other: &Self) {
        self.matched += other.matched;
        self.truth += other.truth;
        self.tracks += other.tracks;
        self.ass_a += other.ass_a;
        self.ass_re += other.ass_re;
        self.ass_pr += other.ass_pr;
        self.similarity += other.similarity;
    }

    fn scores(&self) -> HotaScores {
        let share = |part: f64, whole: usize| part / whole.max(1) as f64;
        let matched = self.matched as f64;
        let det_a = share(matched, self.truth + self.tracks - self.matched);
        let ass_a = share(self.ass_a, self.matched);
        HotaScores {
            hota: (det_a * ass_a).sqrt(),
            det_a,
            ass_a,
            det_re: share(matched, self.truth),
            det_pr: share(matched, self.tracks),
            ass_re: share(self.ass_re, self.matched),
            ass_pr: share(self.ass_pr, self.matched),
            // Without a match the localisation is perfect, as in TrackEval.
            loc_a: if self.matched == 0 { 1.0 } else { self.similarity / matched },
        }
    }
}

fn tallies(scenario: &Scenario) -> Vec<ThresholdTally> {
    let (mut truth_count, mut track_count) = (vec![0.0; scenario.people], vec![0.0; scenario.tracks]);
    for instant in &scenario.instants {
        instant.truth.iter().for_each(|person| truth_count[*person] += 1.0);
        instant.tracks.iter().for_each(|track| track_count[*track] += 1.0);
    }
    let together = together(scenario);
    // Soft Jaccard index of a person and a track over the recording, before any matching.
    let alignment = |person: usize, track: usize| {
        let both = together.at(person, track);
        both / (truth_count[person] + track_count[track] - both)
    };

    let mut tallies = vec![
        ThresholdTally {
            truth: scenario.truth_rows,
            tracks: scenario.track_rows,
            ..ThresholdTally::default()
        };
        THRESHOLDS
    ];
    // Number of matches of each pair of person and track, by the strictest threshold that they pass.
    let mut strictest: HashMap<(usize, usize), [u32; THRESHOLDS]> = HashMap::new();
    for instant in &scenario.instants {
        let weights = PairTable::from_fn(instant.truth.len(), instant.tracks.len(), |i, j| {
            alignment(instant.truth[i], instant.tracks[j]) * instant.similarity.at(i, j)
        });
        for (i, j) in best(&weights) {
            let similarity = instant.similarity.at(i, j);
            let passed = Hota::thresholds().filter(|a| similarity >= a - SIMILARITY_TOLERANCE).count();
            for tally in &mut tallies[..passed] {
                tally.matched += 1;
                tally.similarity += similarity;
            }
            if passed > 0 {
                let pair = (instant.truth[i], instant.tracks[j]);
                strictest.entry(pair).or_insert([0; THRESHOLDS])[passed - 1] += 1;
            }
        }
    }
    let mut pairs: Vec<_> = strictest.into_iter().collect();
    pairs.sort_unstable_by_key(|(pair, _)| *pair);
    for ((person, track), counts) in pairs {
        let mut n = 0.0;
        for (tally, count) in tallies.iter_mut().zip(counts).rev() {
            n += f64::from(count);
            tally.ass_a += n * n / (truth_count[person] + track_count[track] - n);
            tally.ass_re += n * n / truth_count[person];
            tally.ass_pr += n * n / track_count[track];
        }
    }
    tallies
}

/// Number of frames that each person and track share, in parts where several are near.
fn together(scenario: &Scenario) -> PairSums {
    let mut together = PairSums::default();
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
    together
}
