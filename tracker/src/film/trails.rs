//! Recent positions of each person.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Point2;

use crate::{PersonEstimate, TrackId};

/// Positions of the last few seconds, by person.
#[derive(Debug, Clone)]
pub(super) struct Trails {
    reach_s: f64,
    of: BTreeMap<TrackId, VecDeque<(f64, Point2<f64>)>>,
}

impl Trails {
    pub(super) fn new(reach_s: f64) -> Self {
        Self { reach_s, of: BTreeMap::new() }
    }

    /// Adds everybody's position, and drops positions that are too old.
    pub(super) fn extend(&mut self, time_s: f64, people: &[PersonEstimate]) {
        for person in people {
            self.of.entry(person.id).or_default().push_back((time_s, Point2::new(person.x_m, person.y_m)));
        }
        let oldest = time_s - self.reach_s;
        self.of.retain(|_, trail| {
            while trail.front().is_some_and(|(time, _)| *time < oldest) {
                trail.pop_front();
            }
            !trail.is_empty()
        });
    }

    /// Positions of a person with their age as a fraction of the reach: 0 now, 1 at the end. Oldest first.
    pub(super) fn of(&self, id: TrackId) -> impl Iterator<Item = (f64, Point2<f64>)> + '_ {
        let trail = self.of.get(&id);
        let now = trail.and_then(|t| t.back()).map_or(0.0, |(time, _)| *time);
        let reach = self.reach_s.max(1e-9);
        trail.into_iter().flatten().map(move |(time, place)| ((now - time) / reach, *place))
    }
}
