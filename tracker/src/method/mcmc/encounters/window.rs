//! Traits that names showed in the undecided moments, for any set of exchanges.

use std::collections::{BTreeMap, VecDeque};

use super::super::person::Key;
use super::super::posture::Size;
use super::super::smoother::LaggedMoment;
use super::super::traits::{LearntSize, LearntTraits};
use super::Encounters;
use super::appearance::Appearance;

/// Table of the undecided moments. Tracks, and the names that they had before, are counted alike.
pub(super) struct Window {
    /// Sizes that each name showed before the window, as certain as those in it can be compared with them.
    known: Vec<LearntSize>,
    /// Sizes that each track showed in the first moments of the window: `moments + 1` sums a track.
    shown: Vec<LearntSize>,
    /// Appearance vectors, likewise; `None` where they tell nobody apart.
    appearance: Option<Appearance>,
    moments: usize,
    /// Encounters: their tracks, and the first moment after them.
    encounters: Vec<([usize; 2], usize)>,
    /// Sizes of people.
    population: Size,
}

/// Sums of one evaluation, kept between evaluations.
#[derive(Default)]
pub(super) struct Sums {
    /// Name that each track has, and the moment since which its traits are not added yet.
    carried: Vec<(usize, usize)>,
    /// Sizes of each name.
    sizes: Vec<LearntSize>,
    /// Vectors of each name.
    vectors: Vec<f64>,
}

impl Window {
    /// Table of the moments after the settled ones.
    pub(super) fn new(moments: &VecDeque<LaggedMoment>, encounters: &Encounters) -> Self {
        let keys: BTreeMap<Key, usize> = encounters.names.keys().copied().zip(0..).collect();
        let settled: Vec<_> = encounters.names.values().map(|name| encounters.settled.get(name)).collect();
        let known = |traits: Option<&LearntTraits>| {
            traits.map_or_else(LearntSize::default, |traits| traits.size.of_another_time())
        };
        let known = settled.iter().map(|traits| known(*traits)).collect();
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
        let appearance = Appearance::new(&settled, moments.range(first..), &keys);
        let step = |time_s: f64| moments.range(first..).take_while(|moment| moment.time_s <= time_s).count();
        // Encounters are of tracks with names.
        let track = |key: Key| keys.get(&key).copied().unwrap_or_default();
        let of = encounters.list.iter().map(|met| (met.keys.map(track), step(met.time_s)));
        Self {
            known,
            shown,
            appearance,
            moments: count,
            encounters: of.collect(),
            population: encounters.population,
        }
    }

    /// Tracks of an encounter.
    pub(super) fn tracks(&self, encounter: usize) -> [usize; 2] {
        self.encounters[encounter].0
    }

    /// Log density of all traits, where these encounters were exchanges, nats.
    pub(super) fn log_density(&self, exchanges: &[bool], sums: &mut Sums) -> f64 {
        self.add_up(exchanges, sums);
        let by_sizes: f64 = sums.sizes.iter().map(|size| size.log_marginal(&self.population)).sum();
        by_sizes + self.appearance.as_ref().map_or(0.0, |shown| shown.log_density(&sums.vectors))
    }

    /// Adds the traits of the window to those of each name before.
    fn add_up(&self, exchanges: &[bool], sums: &mut Sums) {
        sums.sizes.clone_from(&self.known);
        if let Some(shown) = &self.appearance {
            shown.known().clone_into(&mut sums.vectors);
        }
        sums.carried.clear();
        sums.carried.extend((0..self.known.len()).map(|track| (track, 0)));
        for ((tracks, step), _) in
            self.encounters.iter().zip(exchanges).filter(|(_, is_exchange)| **is_exchange)
        {
            let [a, b] = tracks.map(|track| self.hand_over(track, *step, sums));
            (sums.carried[tracks[0]].0, sums.carried[tracks[1]].0) = (b, a);
        }
        for track in 0..self.known.len() {
            self.hand_over(track, self.moments, sums);
        }
    }

    /// Adds what a track has shown until a moment to the traits of its name, which is returned.
    fn hand_over(&self, track: usize, until: usize, sums: &mut Sums) -> usize {
        let (name, since) = sums.carried[track];
        let row = &self.shown[track * (self.moments + 1)..][..=self.moments];
        sums.sizes[name] = sums.sizes[name].with(&row[until].without(&row[since]));
        if let Some(shown) = &self.appearance {
            shown.hand_over(track, since..until, name, &mut sums.vectors);
        }
        sums.carried[track].1 = until;
        name
    }
}
