//! Sizes that names showed in the undecided moments, for any set of exchanges.

use std::collections::{BTreeMap, VecDeque};

use super::super::options::McmcOptions;
use super::super::person::Key;
use super::super::smoother::LaggedMoment;
use super::super::traits::LearntSize;
use super::Encounters;
use crate::TrackId;

/// Table of the undecided moments. Tracks, and the names that they had before, are counted alike.
pub(super) struct Window<'a> {
    /// Name of each track before the window.
    names: Vec<TrackId>,
    /// Sizes that each name showed before the window, and what they are worth against those in it.
    before: Vec<LearntSize>,
    known: Vec<LearntSize>,
    /// Sizes that each track showed in the first moments of the window: `moments + 1` sums a track.
    shown: Vec<LearntSize>,
    moments: usize,
    /// Encounters: their tracks, and the first moment after them.
    encounters: Vec<([usize; 2], usize)>,
    options: &'a McmcOptions,
}

/// Sums of one evaluation, kept between evaluations.
#[derive(Default)]
pub(super) struct Sums {
    /// Name that each track has, and the moment since which its sizes are not added yet.
    carried: Vec<(usize, usize)>,
    /// Sizes of each name.
    sizes: Vec<LearntSize>,
}

impl<'a> Window<'a> {
    /// Table of the moments after the settled ones.
    pub(super) fn new(
        moments: &VecDeque<LaggedMoment>,
        encounters: &Encounters,
        options: &'a McmcOptions,
    ) -> Self {
        let keys: BTreeMap<Key, usize> = encounters.names.keys().copied().zip(0..).collect();
        let names: Vec<TrackId> = encounters.names.values().copied().collect();
        let settled = |name: &TrackId| encounters.settled.get(name).copied().unwrap_or_default();
        let before: Vec<LearntSize> = names.iter().map(settled).collect();
        let known = before.iter().map(LearntSize::of_another_time).collect();
        let first = moments.partition_point(|moment| moment.time_s <= encounters.settled_s);
        let count = moments.len() - first;
        let mut shown = vec![LearntSize::default(); keys.len() * (count + 1)];
        for (at, moment) in moments.range(first..).enumerate() {
            for track in 0..keys.len() {
                shown[track * (count + 1) + at + 1] = shown[track * (count + 1) + at];
            }
            for trace in &moment.people {
                if let Some(track) = keys.get(&trace.key) {
                    shown[track * (count + 1) + at + 1].add(&trace.shown);
                }
            }
        }
        let step = |time_s: f64| moments.range(first..).take_while(|moment| moment.time_s <= time_s).count();
        // Encounters are of tracks with names.
        let track = |key: Key| keys.get(&key).copied().unwrap_or_default();
        let of = encounters.list.iter().map(|met| (met.keys.map(track), step(met.time_s)));
        Self { names, before, known, shown, moments: count, encounters: of.collect(), options }
    }

    /// Tracks of an encounter.
    pub(super) fn tracks(&self, encounter: usize) -> [usize; 2] {
        self.encounters[encounter].0
    }

    /// Log density of all sizes, where these encounters were exchanges, nats.
    pub(super) fn log_density(&self, exchanges: &[bool], sums: &mut Sums) -> f64 {
        self.add_up(&self.known, exchanges, sums);
        sums.sizes.iter().map(|size| size.log_marginal(self.options)).sum()
    }

    /// Sizes that each name has shown until now, where these encounters were exchanges.
    pub(super) fn sizes_of_names(&self, exchanges: &[bool]) -> BTreeMap<TrackId, LearntSize> {
        let mut sums = Sums::default();
        self.add_up(&self.before, exchanges, &mut sums);
        self.names.iter().copied().zip(sums.sizes).collect()
    }

    /// Adds the sizes of the window to those of each name before.
    fn add_up(&self, before: &[LearntSize], exchanges: &[bool], sums: &mut Sums) {
        before.clone_into(&mut sums.sizes);
        sums.carried.clear();
        sums.carried.extend((0..self.names.len()).map(|track| (track, 0)));
        for ((tracks, step), _) in
            self.encounters.iter().zip(exchanges).filter(|(_, is_exchange)| **is_exchange)
        {
            let [a, b] = tracks.map(|track| self.hand_over(track, *step, sums));
            (sums.carried[tracks[0]].0, sums.carried[tracks[1]].0) = (b, a);
        }
        for track in 0..self.names.len() {
            self.hand_over(track, self.moments, sums);
        }
    }

    /// Adds what a track has shown until a moment to the sizes of its name, which is returned.
    fn hand_over(&self, track: usize, until: usize, sums: &mut Sums) -> usize {
        let (name, since) = sums.carried[track];
        let row = &self.shown[track * (self.moments + 1)..][..=self.moments];
        sums.sizes[name] = sums.sizes[name].with(&row[until].without(&row[since]));
        sums.carried[track].1 = until;
        name
    }
}
