//! CLEAR MOT: accuracy, precision, switches, fragmentations, mostly tracked and lost.
//!
//! K. Bernardin, R. Stiefelhagen, "Evaluating multiple object tracking performance: the CLEAR MOT metrics",
//! EURASIP J. Image and Video Processing 2008 (MOTA, MOTP, mismatches). MODA: R. Kasturi et al., "Framework for
//! performance evaluation of face, text and vehicle detection and tracking in video", PAMI 31 (2009). Mostly
//! tracked (more than 80 % of a life) and lost (less than 20 %): Y. Li, C. Huang, R. Nevatia, CVPR 2009.

use super::scenario::{Scenario, Space};
use super::{FigureValue, MetricFigure, TrackMetric, Unit, percent};

/// CLEAR MOT figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Clear {
    /// Number of truth rows with a matching track.
    pub matches: usize,
    /// Number of truth rows without.
    pub misses: usize,
    /// Number of track rows without a matching person.
    pub false_positives: usize,
    /// Figures that need identities; `None` without them.
    pub continuity: Option<Continuity>,
    /// Sum of the similarities of the matches.
    similarity_sum: f64,
    /// Sum of the distances of the matches.
    distance_sum: f64,
    space: Space,
}

/// Continuity of the tracks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Continuity {
    /// Number of times that a person's track differs from the last one they had, however long ago.
    pub switches: usize,
    /// Number of times that a person is lost while present and found again.
    pub fragmentations: usize,
    /// Number of times that a person's matches go on after a break, be it a loss or their absence: `Frag` of TrackEval.
    pub resumptions: usize,
    /// Number of people matched in all of their rows, and always by one track.
    pub followed: usize,
    /// Number of people matched in more than 80 % of their rows.
    pub mostly_tracked: usize,
    /// Number of people matched in less than 20 % of their rows.
    pub mostly_lost: usize,
    /// Number of people.
    pub people: usize,
}

impl TrackMetric for Clear {
    fn of(scenario: &Scenario) -> Self {
        let all = || scenario.instants.iter().flat_map(|i| &i.matches);
        let matches = all().count();
        Self {
            matches,
            misses: scenario.truth_rows - matches,
            false_positives: scenario.track_rows - matches,
            continuity: scenario.has_identities.then(|| Continuity::of(scenario)),
            similarity_sum: all().map(|m| m.similarity).sum(),
            distance_sum: all().map(|m| m.distance).sum(),
            space: scenario.space,
        }
    }

    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let sum = |count: fn(&Self) -> usize| parts.clone().map(count).sum();
        let continuities: Option<Vec<&Continuity>> = parts.clone().map(|p| p.continuity.as_ref()).collect();
        Self {
            matches: sum(|p| p.matches),
            misses: sum(|p| p.misses),
            false_positives: sum(|p| p.false_positives),
            continuity: continuities.map(|c| Continuity::together(&c)),
            similarity_sum: parts.clone().map(|p| p.similarity_sum).sum(),
            distance_sum: parts.clone().map(|p| p.distance_sum).sum(),
            space: parts.clone().next().map_or(Space::Floor, |p| p.space),
        }
    }

    fn figures(&self) -> Vec<MetricFigure> {
        let mut figures = vec![
            MetricFigure::new(
                "MOTA",
                percent(self.mota()),
                "tracking accuracy: 1 − (misses + false positives + switches) / truth",
            ),
            match self.space {
                Space::Floor => MetricFigure::new(
                    "MOTP",
                    FigureValue::real(self.motp(), Unit::Metres),
                    "tracking precision: mean distance of the matches",
                ),
                Space::Image => MetricFigure::new(
                    "MOTP",
                    percent(self.motp()),
                    "tracking precision: mean overlap (IoU) of the matches",
                ),
            },
            MetricFigure::new("MODA", percent(self.moda()), "detection accuracy: as MOTA, without switches"),
            MetricFigure::new("recall", percent(self.recall()), "share of the truth that is found"),
            MetricFigure::new(
                "precision",
                percent(self.precision()),
                "share of the tracks' rows that match a person",
            ),
        ];
        let counted =
            |count: fn(&Continuity) -> usize| FigureValue::count(self.continuity.as_ref().map(count));
        figures.extend([
            MetricFigure::new(
                "ID switches",
                counted(|c| c.switches),
                "times a person's track becomes another one",
            ),
            MetricFigure::new(
                "fragmentations",
                counted(|c| c.fragmentations),
                "times a person is lost and found again",
            ),
            MetricFigure::new(
                "Frag",
                counted(|c| c.resumptions),
                "as TrackEval counts them: times a person's matches go on after a break",
            ),
            MetricFigure::new(
                "tracking success",
                percent(self.continuity.as_ref().and_then(Continuity::success)),
                "people who are matched from their first frame to their last, by one track",
            ),
            MetricFigure::new(
                "mostly tracked",
                counted(|c| c.mostly_tracked),
                "people matched in more than 80 % of their frames",
            ),
            MetricFigure::new(
                "mostly lost",
                counted(|c| c.mostly_lost),
                "people matched in less than 20 % of their frames",
            ),
            MetricFigure::new(
                "false positives",
                FigureValue::count(Some(self.false_positives)),
                "rows that match no person",
            ),
            MetricFigure::new("misses", FigureValue::count(Some(self.misses)), "truth rows without a track"),
        ]);
        figures
    }
}

impl Clear {
    fn truth(&self) -> usize {
        self.matches + self.misses
    }

    /// Multiple object tracking accuracy, at most 1; `None` without truth or identities.
    pub fn mota(&self) -> Option<f64> {
        let errors = self.misses + self.false_positives + self.continuity.as_ref()?.switches;
        ratio(self.truth() as f64 - errors as f64, self.truth())
    }

    /// Multiple object detection accuracy, at most 1; `None` without truth.
    pub fn moda(&self) -> Option<f64> {
        ratio(self.matches as f64 - self.false_positives as f64, self.truth())
    }

    /// Multiple object tracking precision: on the floor the mean distance of the matches in metres, in the image
    /// their mean overlap; `None` without a match.
    pub fn motp(&self) -> Option<f64> {
        match self.space {
            Space::Floor => ratio(self.distance_sum, self.matches),
            Space::Image => ratio(self.similarity_sum, self.matches),
        }
    }

    /// Share of the truth that is matched, 0 to 1.
    pub fn recall(&self) -> Option<f64> {
        ratio(self.matches as f64, self.truth())
    }

    /// Share of the tracks' rows that are matched, 0 to 1.
    pub fn precision(&self) -> Option<f64> {
        ratio(self.matches as f64, self.matches + self.false_positives)
    }
}

impl Continuity {
    fn of(scenario: &Scenario) -> Self {
        /// State of one person during the count.
        #[derive(Clone, Default)]
        struct Life {
            rows: usize,
            matched: usize,
            last_track: Option<usize>,
            is_lost: bool,
            has_switched: bool,
            /// Index of the frame of the last match, among the frames with both truth and tracks.
            last_match: Option<usize>,
        }
        let mut lives = vec![Life::default(); scenario.people];
        let (mut switches, mut fragmentations, mut resumptions) = (0, 0, 0);
        let mut judged = 0;
        for instant in &scenario.instants {
            // TrackEval skips frames without truth or without tracks: they break no matches.
            judged += usize::from(!instant.truth.is_empty() && !instant.tracks.is_empty());
            let mut is_matched = vec![false; scenario.people];
            for found in &instant.matches {
                is_matched[found.person] = true;
                let life = &mut lives[found.person];
                life.matched += 1;
                let is_switch = life.last_track.is_some_and(|last| last != found.track);
                switches += usize::from(is_switch);
                life.has_switched |= is_switch;
                resumptions += usize::from(life.last_match.is_some_and(|last| last + 1 < judged));
                life.last_match = Some(judged);
                fragmentations += usize::from(life.is_lost);
                life.last_track = Some(found.track);
                life.is_lost = false;
            }
            for person in &instant.truth {
                let life = &mut lives[*person];
                life.rows += 1;
                life.is_lost |= life.last_track.is_some() && !is_matched[*person];
            }
        }
        // Integers: 80 % of 5 rows are 4, not 4.0000000001.
        let share = |more: fn(usize, usize) -> bool| {
            lives.iter().filter(|life| more(100 * life.matched, life.rows)).count()
        };
        Self {
            switches,
            fragmentations,
            resumptions,
            followed: lives.iter().filter(|l| l.matched == l.rows && !l.has_switched).count(),
            mostly_tracked: share(|matched, rows| matched > 80 * rows),
            mostly_lost: share(|matched, rows| matched < 20 * rows),
            people: scenario.people,
        }
    }

    fn together(parts: &[&Self]) -> Self {
        let sum = |count: fn(&Self) -> usize| parts.iter().map(|p| count(p)).sum();
        Self {
            switches: sum(|c| c.switches),
            fragmentations: sum(|c| c.fragmentations),
            resumptions: sum(|c| c.resumptions),
            followed: sum(|c| c.followed),
            mostly_tracked: sum(|c| c.mostly_tracked),
            mostly_lost: sum(|c| c.mostly_lost),
            people: sum(|c| c.people),
        }
    }

    /// Tracking success rate of Okada et al. (cited in [`crate::link`], section 6.2), 0 to 1: share of the people who
    /// have one id from their first frame to their last, everywhere within the threshold.
    pub fn success(&self) -> Option<f64> {
        ratio(self.followed as f64, self.people)
    }
}

fn ratio(part: f64, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part / whole as f64)
}
