//! Scores of events against the truth.

use std::collections::BTreeSet;

use nalgebra::Point2;
use scenes::room::Room;
use tracker::events::{Event, EventKind};

use super::TruePath;
use super::truth::{ANY_M, CLEAR_M, TrueEvent, true_events};

/// Largest difference in time of an event and its true one, seconds.
pub const WITHIN_S: f64 = 0.5;
/// Largest distance of their positions, metres: two people may pass a border at one time.
pub const WITHIN_M: f64 = 1.0;

/// Difference by rounding, of times and positions.
const SAME: f64 = 1e-6;

/// Matched events of one kind.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Score {
    /// Number of true events.
    pub truths: usize,
    /// Number of events.
    pub found: usize,
    /// Number of true events that were found.
    pub matched: usize,
    /// Number of events that are true.
    pub right: usize,
    /// Differences in time of the pairs, seconds, without sign.
    pub time_errors_s: Vec<f64>,
    /// Differences in the duration of the stay of the pairs, seconds, without sign: from the nearer one of both truths.
    pub dwell_errors_s: Vec<f64>,
}

impl Score {
    /// Share of the events that are true.
    pub fn precision(&self) -> f64 {
        self.right as f64 / self.found.max(1) as f64
    }

    /// Share of the true events that were found.
    pub fn recall(&self) -> f64 {
        self.matched as f64 / self.truths.max(1) as f64
    }

    /// Adds another score.
    pub fn extend(&mut self, other: Self) {
        self.truths += other.truths;
        self.found += other.found;
        self.matched += other.matched;
        self.right += other.right;
        self.time_errors_s.extend(other.time_errors_s);
        self.dwell_errors_s.extend(other.dwell_errors_s);
    }
}

/// Events without those that were taken back.
pub fn valid(events: Vec<Event>) -> Vec<Event> {
    let mut valid: Vec<Event> = Vec::new();
    for event in events {
        match event.taken_back() {
            Some(taken_back) => {
                if let Some(i) = valid.iter().rposition(|other| *other == taken_back) {
                    valid.remove(i);
                }
            }
            None => valid.push(event),
        }
    }
    valid
}

/// True events: those that are beyond doubt, and all, with those who graze a border.
#[derive(Debug, Clone, PartialEq)]
pub struct Truths {
    /// These have to be found.
    pub clear: Vec<TrueEvent>,
    /// An event that is none of these is wrong.
    pub any: Vec<TrueEvent>,
}

impl Truths {
    /// Truths of paths in a recording that ends at `end_s`.
    pub fn new(room: &Room, paths: &[TruePath], end_s: f64) -> Self {
        let events = |margin_m, prolonged_m| true_events(room, paths, end_s, margin_m, prolonged_m);
        let (mut clear, as_drawn) = (events(CLEAR_M, -CLEAR_M), events(CLEAR_M, 0.0));
        // A path that crosses a line and goes back past its end has not crossed it, though it has crossed the shorter one.
        let is_same = |a: &TrueEvent, b: &TrueEvent| {
            (a.kind, a.person, &a.place, a.direction) == (b.kind, b.person, &b.place, b.direction)
                && (a.time_s - b.time_s).abs() < SAME
                && (a.position - b.position).norm() < SAME
        };
        clear.retain(|event| as_drawn.iter().any(|other| is_same(event, other)));
        Self { clear, any: events(ANY_M, CLEAR_M) }
    }
}

/// Scores the events of a kind at the places that `is_counted`: recall against the clear truths, precision against any.
pub fn score(truths: &Truths, events: &[Event], kind: EventKind, is_counted: impl Fn(&str) -> bool) -> Score {
    let of_place = |e: &&Event| e.kind == kind && is_counted(e.place.as_deref().unwrap_or_default());
    let events: Vec<&Event> = events.iter().filter(of_place).collect();
    let of_kind = |truths: &[TrueEvent]| -> Vec<TrueEvent> {
        truths.iter().filter(|t| t.kind == kind && is_counted(&t.place)).cloned().collect()
    };
    let (clear, any) = (of_kind(&truths.clear), of_kind(&truths.any));
    let right = pairs(&any, &events).len();
    let mut score = Score { truths: clear.len(), found: events.len(), right, ..Score::default() };
    for (truth, event) in pairs(&clear, &events) {
        score.matched += 1;
        score.time_errors_s.push((event.time - truth.time_s).abs());
        // A stay during which the path grazes the border may count as one or as two.
        let same = any.iter().filter(|other| other.person == truth.person && is_pair(other, event));
        let stays = same.chain([truth]);
        let errors_s = stays.filter_map(|truth| Some((event.seconds? - truth.seconds?).abs()));
        score.dwell_errors_s.extend(errors_s.min_by(f64::total_cmp));
    }
    score
}

/// Pairs of true events and events of the same place and direction, at most [`WITHIN_S`] and [`WITHIN_M`] apart, the nearest in
/// time first.
fn pairs<'a>(truths: &'a [TrueEvent], events: &[&'a Event]) -> Vec<(&'a TrueEvent, &'a Event)> {
    let mut near: Vec<(f64, usize, usize)> = Vec::new();
    for (i, truth) in truths.iter().enumerate() {
        let apart = |e: &Event| (e.time - truth.time_s).abs();
        let found = events.iter().enumerate().filter(|(_, e)| is_pair(truth, e));
        near.extend(found.map(|(k, e)| (apart(e), i, k)));
    }
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut truths_taken, mut events_taken) = (BTreeSet::new(), BTreeSet::new());
    let mut pairs = Vec::new();
    for (_, i, k) in near {
        if !truths_taken.contains(&i) && !events_taken.contains(&k) {
            truths_taken.insert(i);
            events_taken.insert(k);
            pairs.push((&truths[i], events[k]));
        }
    }
    pairs
}

/// Whether an event may be this true one.
fn is_pair(truth: &TrueEvent, event: &Event) -> bool {
    let at = event.x.zip(event.y).map(|(x, y)| Point2::new(x, y));
    event.place.as_deref() == Some(&truth.place)
        && event.direction == truth.direction
        && (event.time - truth.time_s).abs() <= WITHIN_S
        && at.is_some_and(|at| (at - truth.position).norm() <= WITHIN_M)
}

/// The value below which a share of the values lie; NaN without values.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values
        .get(((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1)))
        .copied()
        .unwrap_or(f64::NAN)
}
