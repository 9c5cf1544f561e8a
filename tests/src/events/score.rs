//! Scores of events against the truth.

use std::collections::BTreeSet;

use tracker::events::{Event, EventKind};

use super::truth::TrueEvent;

/// Largest difference in time of an event and its true one, seconds.
pub const WITHIN_S: f64 = 0.5;

/// Matched events of one kind.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Score {
    /// Number of true events.
    pub truths: usize,
    /// Number of events.
    pub found: usize,
    /// Number of pairs.
    pub matched: usize,
    /// Differences in time of the pairs, seconds, without sign.
    pub time_errors_s: Vec<f64>,
    /// Differences in the duration of the stay of the pairs, seconds, without sign.
    pub dwell_errors_s: Vec<f64>,
}

impl Score {
    /// Share of the events that are true.
    pub fn precision(&self) -> f64 {
        self.matched as f64 / self.found.max(1) as f64
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

/// Pairs events of a kind with true ones of the same place and direction, at most [`WITHIN_S`] apart: as many as
/// possible, since both are in order of time. Only places that `is_counted`.
pub fn score(
    truths: &[TrueEvent],
    events: &[Event],
    kind: EventKind,
    is_counted: impl Fn(&str) -> bool,
) -> Score {
    let truths: Vec<&TrueEvent> = truths.iter().filter(|t| t.kind == kind && is_counted(&t.place)).collect();
    let place = |e: &Event| e.place.clone().unwrap_or_default();
    let mut events: Vec<&Event> = events.iter().filter(|e| e.kind == kind && is_counted(&place(e))).collect();
    events.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut score = Score { truths: truths.len(), found: events.len(), ..Score::default() };
    let mut taken: BTreeSet<usize> = BTreeSet::new();
    for truth in truths {
        let is_pair = |(i, e): &(usize, &&Event)| {
            !taken.contains(i)
                && place(e) == truth.place
                && e.direction == truth.direction
                && (e.time - truth.time_s).abs() <= WITHIN_S
        };
        let Some((i, event)) = events.iter().enumerate().find(is_pair) else { continue };
        taken.insert(i);
        score.matched += 1;
        score.time_errors_s.push((event.time - truth.time_s).abs());
        if let (Some(found_s), Some(true_s)) = (event.seconds, truth.seconds) {
            score.dwell_errors_s.push((found_s - true_s).abs());
        }
    }
    score
}

/// The value below which a share of the values lie; NaN without values.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values
        .get(((values.len() as f64 * share) as usize).min(values.len().saturating_sub(1)))
        .copied()
        .unwrap_or(f64::NAN)
}
