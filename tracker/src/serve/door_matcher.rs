//! People who go out of one room through a door and come into another through its twin: a one-to-one assignment of
//! departures to arrivals.
//!
//! A passage is scored by its log likelihood ratio against an arrival and a departure that have nothing to do with each
//! other. The time of a passage is normally distributed, with a mean and a deviation that are learnt from the passages
//! that nothing else could explain, mixed with a uniform distribution over the plausible times, so that whoever dawdles is
//! recognised, too. Looks (height, colours) are compared by a distance, whose distributions for the same person and for
//! two people are learnt in the same way. The best assignment of all open departures and arrivals is that of H. W. Kuhn,
//! "The Hungarian method for the assignment problem", Naval Research Logistics Quarterly 2, 1955.

use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;

/// Longest time from a disappearance to the event of it, seconds: a missing person is waited for, frames wait for late
/// cameras.
const REPORT_S: f64 = 4.0;
/// Error of the times of disappearance and appearance, seconds.
const TIME_ERROR_S: f64 = 0.5;
/// Weight of the uniform part of the passage times.
const UNIFORM: f64 = 0.1;
/// Density of departures and arrivals that belong to nobody, relative to the uniform part.
const CLUTTER: f64 = 0.02;
/// Bound of the log likelihood ratio of each kind of looks.
const MOST_LOOKS: f64 = 3.0;
/// Number of observations as which the assumed distributions count.
const PRIOR_COUNT: f64 = 4.0;
/// Scores become whole numbers for the assignment: parts of a nat.
const SCALE: f64 = 1e6;

/// Options of a door.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DoorOptions {
    /// Shortest and longest plausible time from leaving one room to entering the other, seconds; negative where the rooms
    /// overlap.
    pub plausible_s: [f64; 2],
}

/// Looks of a person that are comparable between rooms.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Looks {
    /// Height, metres, if it is known.
    pub height_m: Option<f64>,
}

/// A decided arrival.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Passage<P> {
    /// The person who came in.
    pub arrived: P,
    /// The same person before, in the other room; `None` for somebody who did not come from there.
    pub departed: Option<P>,
}

/// Matcher of one door in one direction. `P` names a person in a room.
#[derive(Debug, Clone)]
pub struct DoorMatcher<P> {
    plausible_s: [f64; 2],
    departures: Vec<(P, f64)>,
    arrivals: Vec<(P, f64)>,
    times: Distribution,
    heights: Cue,
}

/// Normal distribution that is learnt from observations, beginning with an assumed one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Distribution {
    count: f64,
    mean: f64,
    variance: f64,
}

/// Distances between looks, of the same person and of two people.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cue {
    same: Distribution,
    other: Distribution,
}

impl Distribution {
    fn assumed(mean: f64, sigma: f64) -> Self {
        Self { count: PRIOR_COUNT, mean, variance: sigma * sigma }
    }

    fn add(&mut self, value: f64) {
        // Older observations fade, so that a door that changes is learnt anew.
        self.count = (self.count + 1.0).min(200.0);
        let step = value - self.mean;
        self.mean += step / self.count;
        self.variance += (step * (value - self.mean) - self.variance) / self.count;
    }

    fn log_density(&self, value: f64) -> f64 {
        let variance = self.variance.max(1e-6);
        -0.5 * ((value - self.mean).powi(2) / variance + (std::f64::consts::TAU * variance).ln())
    }
}

impl Cue {
    /// Log likelihood ratio of a distance for the same person against another one.
    fn log_ratio(&self, distance: f64) -> f64 {
        let ratio = self.same.log_density(distance) - self.other.log_density(distance);
        // Beyond the mean of two people a greater distance must not speak for one: it has wider tails.
        let ratio = if distance > self.other.mean { ratio.min(0.0) } else { ratio };
        ratio.clamp(-MOST_LOOKS, MOST_LOOKS)
    }
}

impl<P: Copy + Ord> DoorMatcher<P> {
    /// Matcher that knows nothing of this door but its options.
    pub fn new(options: DoorOptions) -> Self {
        let [low_s, high_s] = options.plausible_s;
        Self {
            plausible_s: options.plausible_s,
            departures: Vec::new(),
            arrivals: Vec::new(),
            times: Distribution::assumed(0.5 * (low_s + high_s), (0.25 * (high_s - low_s)).max(TIME_ERROR_S)),
            // Estimates of one person's height in two rooms differ by some centimetres; heights of two people by more.
            heights: Cue {
                same: Distribution::assumed(0.04, 0.04),
                other: Distribution::assumed(0.11, 0.08),
            },
        }
    }

    /// Takes somebody who went out at a time, seconds on any clock that both rooms share.
    pub fn depart(&mut self, person: P, time_s: f64) {
        self.departures.push((person, time_s));
    }

    /// Takes back somebody who had not gone. Returns whether they still waited for an arrival.
    pub fn revoke(&mut self, person: P) -> bool {
        let before = self.departures.len();
        self.departures.retain(|(other, _)| *other != person);
        self.departures.len() < before
    }

    /// Takes somebody who came in at a time.
    pub fn arrive(&mut self, person: P, time_s: f64) {
        self.arrivals.push((person, time_s));
    }

    /// Whether an arrival of this person is undecided.
    pub fn awaits(&self, person: P) -> bool {
        self.arrivals.iter().any(|(other, _)| *other == person)
    }

    /// Decides the arrivals whose departures must have been reported at a time.
    pub fn decide(&mut self, now_s: f64, looks: impl Fn(P) -> Looks) -> Vec<Passage<P>> {
        let [low_s, high_s] = self.plausible_s;
        let is_due = |time_s: f64| time_s - low_s.min(0.0) + REPORT_S <= now_s;
        let mut decided = Vec::new();
        if self.arrivals.iter().any(|(_, time_s)| is_due(*time_s)) {
            let scores = self.scores(&looks);
            let partners = assigned(&scores, self.departures.len());
            let (mut used, mut waiting) = (vec![false; self.departures.len()], Vec::new());
            for (i, (&arrival, partner)) in self.arrivals.clone().iter().zip(partners).enumerate() {
                let (person, time_s) = arrival;
                if !is_due(time_s) {
                    waiting.push(arrival);
                    continue;
                }
                let departed = partner.map(|j| {
                    used[j] = true;
                    let is_unambiguous = is_alone(&scores, i, j);
                    self.learn(i, j, is_unambiguous, &looks);
                    self.departures[j].0
                });
                decided.push(Passage { arrived: person, departed });
            }
            self.arrivals = waiting;
            let mut used = used.into_iter();
            self.departures.retain(|_| !used.next().unwrap_or(false));
        }
        // The latest arrival that could belong to a departure has been reported by then.
        let over_s = now_s - high_s - 2.0 * REPORT_S - TIME_ERROR_S + low_s.min(0.0);
        self.departures.retain(|(_, time_s)| *time_s >= over_s);
        decided
    }

    /// Score of each arrival (rows) with each departure, nats above having nothing to do with each other; `None` outside
    /// the plausible times.
    fn scores(&self, looks: &impl Fn(P) -> Looks) -> Vec<Vec<Option<f64>>> {
        let [low_s, high_s] = self.plausible_s;
        let uniform = UNIFORM / (high_s - low_s + 2.0 * TIME_ERROR_S);
        let departed: Vec<Looks> = self.departures.iter().map(|(person, _)| looks(*person)).collect();
        let row = |&(person, arrived_s): &(P, f64)| {
            let arrived = looks(person);
            let each = self.departures.iter().zip(&departed).map(|(&(_, departed_s), before)| {
                let passage_s = arrived_s - departed_s;
                if !(low_s - TIME_ERROR_S..=high_s + TIME_ERROR_S).contains(&passage_s) {
                    return None;
                }
                let density = (1.0 - UNIFORM) * self.times.log_density(passage_s).exp() + uniform;
                let heights = before.height_m.zip(arrived.height_m);
                let height = heights.map_or(0.0, |(a, b)| self.heights.log_ratio((a - b).abs()));
                Some((density / (CLUTTER * uniform)).ln() + height)
            });
            each.collect()
        };
        self.arrivals.iter().map(row).collect()
    }

    /// Learns from a passage; of an ambiguous one only that others look otherwise.
    fn learn(&mut self, arrival: usize, departure: usize, is_unambiguous: bool, looks: &impl Fn(P) -> Looks) {
        let ((person, arrived_s), (before, departed_s)) =
            (self.arrivals[arrival], self.departures[departure]);
        let Some(own) = looks(person).height_m else {
            if is_unambiguous {
                self.times.add(arrived_s - departed_s);
            }
            return;
        };
        if is_unambiguous {
            self.times.add(arrived_s - departed_s);
            if let Some(earlier) = looks(before).height_m {
                self.heights.same.add((own - earlier).abs());
            }
        }
        for (j, (other, _)) in self.departures.iter().enumerate() {
            if let Some(height_m) = looks(*other).height_m.filter(|_| j != departure) {
                self.heights.other.add((own - height_m).abs());
            }
        }
    }
}

/// Whether neither the arrival nor the departure of a pair could belong to another one.
fn is_alone(scores: &[Vec<Option<f64>>], arrival: usize, departure: usize) -> bool {
    let in_row = scores[arrival].iter().flatten().count();
    let in_column = scores.iter().filter(|row| row[departure].is_some()).count();
    in_row == 1 && in_column == 1
}

/// Departure of each arrival in the assignment of the largest total score; a pair that scores below zero is none.
fn assigned(scores: &[Vec<Option<f64>>], departures: usize) -> Vec<Option<usize>> {
    let arrivals = scores.len();
    if arrivals == 0 {
        return Vec::new();
    }
    // Each arrival may also stay alone, at a column of its own.
    let weights = Matrix::from_fn(arrivals, departures + arrivals, |(i, j)| {
        let score = scores[i].get(j).copied().flatten().unwrap_or(0.0);
        (score.max(0.0) * SCALE) as i64
    });
    let (_, columns) = kuhn_munkres(&weights);
    let partner =
        |(i, j): (usize, usize)| scores[i].get(j).copied().flatten().filter(|score| *score > 0.0).map(|_| j);
    columns.into_iter().enumerate().map(partner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn matcher() -> DoorMatcher<u32> {
        DoorMatcher::new(DoorOptions { plausible_s: [0.0, 4.0] })
    }

    fn unknown(_: u32) -> Looks {
        Looks::default()
    }

    #[test]
    fn nothing_is_decided_before_every_departure_must_be_known() {
        let mut matcher = matcher();
        matcher.arrive(7, 102.0);
        assert_eq!(matcher.decide(105.9, unknown), []);
        // The disappearance of those who are missing is reported later than the appearance.
        matcher.depart(1, 100.5);
        assert!(matcher.awaits(7));
        let decided = matcher.decide(106.1, unknown);
        assert_eq!(decided, [Passage { arrived: 7, departed: Some(1) }]);
        assert!(!matcher.awaits(7) && matcher.decide(1000.0, unknown).is_empty());
    }

    #[test]
    fn implausible_times_and_departures_that_were_taken_back_are_no_passages() {
        let mut matcher = matcher();
        for (departed_s, arrived_s) in [(10.0, 16.0), (30.0, 29.0)] {
            matcher.depart(1, departed_s);
            matcher.arrive(2, arrived_s);
            assert_eq!(matcher.decide(60.0, unknown), [Passage { arrived: 2, departed: None }]);
        }
        matcher.depart(3, 100.0);
        assert!(matcher.revoke(3) && !matcher.revoke(3));
        matcher.arrive(4, 101.0);
        assert_eq!(matcher.decide(120.0, unknown), [Passage { arrived: 4, departed: None }]);
        // In rooms that overlap, people appear in one before they disappear from the other.
        let mut overlapping = DoorMatcher::new(DoorOptions { plausible_s: [-2.0, 1.0] });
        overlapping.arrive(6, 100.0);
        assert_eq!(overlapping.decide(105.9, unknown), []);
        overlapping.depart(5, 101.5);
        assert_eq!(overlapping.decide(106.1, unknown), [Passage { arrived: 6, departed: Some(5) }]);
    }

    #[test]
    fn heights_tell_people_apart_who_pass_together() {
        let heights = [1.60, 1.85, 1.84, 1.62];
        let looks = |person: u32| Looks { height_m: heights.get(person as usize).copied() };
        let mut matcher = matcher();
        matcher.depart(0, 100.0);
        matcher.depart(1, 100.2);
        matcher.arrive(2, 102.0);
        matcher.arrive(3, 102.2);
        let decided = matcher.decide(120.0, looks);
        assert_eq!(
            decided,
            [Passage { arrived: 2, departed: Some(1) }, Passage { arrived: 3, departed: Some(0) }]
        );
    }

    #[test]
    fn the_time_of_a_passage_is_learnt() {
        let mut matcher = matcher();
        for i in 0..30 {
            let (at_s, person) = (100.0 * f64::from(i), 2 * i);
            matcher.depart(person, at_s);
            matcher.arrive(person + 1, at_s + 1.0 + 0.01 * f64::from(i % 5));
            matcher.decide(at_s + 20.0, unknown);
        }
        // Two people went out; the one who comes in now takes a second, not three.
        matcher.depart(1000, 5000.0);
        matcher.depart(1001, 5002.0);
        matcher.arrive(1002, 5003.0);
        assert_eq!(matcher.decide(5020.0, unknown), [Passage { arrived: 1002, departed: Some(1001) }]);
    }

    proptest! {
        /// Whatever comes: each arrival is decided once, each departure is used at most once, within the plausible times,
        /// and the total score is that of the best of all assignments.
        #[test]
        fn assignments_are_one_to_one_and_the_best(seed in any::<u64>(), arrivals in 1_usize..5, departures in 0_usize..5) {
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let scores: Vec<Vec<Option<f64>>> = (0..arrivals)
                .map(|_| (0..departures).map(|_| rng.random_bool(0.8).then(|| rng.random_range(-2.0..6.0))).collect())
                .collect();
            let partners = assigned(&scores, departures);
            let mut used: Vec<usize> = partners.iter().flatten().copied().collect();
            used.sort_unstable();
            used.dedup();
            prop_assert_eq!(used.len(), partners.iter().flatten().count());
            let total: f64 = partners.iter().enumerate().filter_map(|(i, j)| scores[i][(*j)?]).sum();
            prop_assert!((total - best(&scores, &mut vec![false; departures])).abs() < 1e-4);
        }
    }

    /// Largest total score, by trying everything.
    fn best(rows: &[Vec<Option<f64>>], used: &mut Vec<bool>) -> f64 {
        let Some((row, rest)) = rows.split_first() else { return 0.0 };
        let mut most = best(rest, used);
        for (j, score) in row.iter().enumerate() {
            if let Some(score) = score.filter(|_| !used[j]) {
                used[j] = true;
                most = most.max(score + best(rest, used));
                used[j] = false;
            }
        }
        most
    }
}
