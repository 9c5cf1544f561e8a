//! Search for encounters in the held moments: tracks that met, and tracks that began near the end of another.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Vector2;

use super::super::options::McmcOptions;
use super::super::person::Key;
use super::super::reassociation::place_nats;
use super::super::smoother::{LaggedMoment, WINDOW_S};
use super::{Encounter, Encounters, REMEMBERED_S};

/// Least log probability ratio by the places of an encounter that is remembered, nats.
const LEAST_PLACE_NATS: f64 = -12.0;
/// Interval of which one encounter of a pair is remembered, seconds.
const APART_S: f64 = 0.2;
/// Time for which the end of a track and the beginning of the same person's next one may overlap, seconds.
const TOGETHER_S: f64 = 2.0;

/// Time (seconds) and place (metres) of a track.
pub(super) type Event<'a> = (f64, &'a Vector2<f64>);

/// First and last moment of a track.
struct Life {
    /// Time of the moment before the track's first one, seconds; `None` for one that began before the held moments.
    before_s: Option<f64>,
    /// Last measurement: time (seconds) and place (metres).
    last: Option<(f64, Vector2<f64>)>,
    is_over: bool,
}

impl Encounters {
    /// Remembers the encounters of the moments that have become older than the window of reassociation. `returns_nats`: log odds
    /// that who is found at a time and place is somebody who was lost before.
    pub(super) fn search(
        &mut self,
        moments: &VecDeque<LaggedMoment>,
        options: &McmcOptions,
        returns_nats: &impl Fn(Event<'_>, Event<'_>) -> f64,
    ) {
        let Some(now) = moments.back() else { return };
        let until_s = now.time_s - WINDOW_S;
        let from_s = self.searched_s.max(self.settled_s);
        for (from, moment) in moments.iter().enumerate() {
            if moment.time_s > from_s && moment.time_s <= until_s {
                self.meet(moments, from, options);
            }
        }
        self.searched_s = self.searched_s.max(until_s);
        self.find_again(moments, until_s, returns_nats);
    }

    /// Remembers the encounters of the tracks that are close in one moment.
    fn meet(&mut self, moments: &VecDeque<LaggedMoment>, from: usize, options: &McmcOptions) {
        let moment = &moments[from];
        for (i, a) in moment.people.iter().enumerate() {
            for b in &moment.people[..i] {
                let keys = [a.key, b.key];
                if !keys.iter().all(|key| self.names.contains_key(key)) {
                    continue;
                }
                let nats = place_nats(moments, from, keys, options);
                if let Some(place_nats) = nats.filter(|nats| *nats > LEAST_PLACE_NATS) {
                    self.add(Encounter { time_s: moment.time_s, keys, place_nats, is_exchange: false });
                }
            }
        }
    }

    /// Remembers an encounter, the likelier one of two that follow each other.
    fn add(&mut self, new: Encounter) {
        let is_same = |old: &Encounter| {
            new.time_s - old.time_s < APART_S && new.keys.iter().all(|key| old.keys.contains(key))
        };
        if let Some(same) = self.list.iter().rposition(is_same) {
            let old = &self.list[same];
            if old.is_exchange || old.place_nats >= new.place_nats {
                return;
            }
            self.list.remove(same);
        }
        self.insert(new);
    }

    /// Remembers the tracks that began near the end of another.
    fn find_again(
        &mut self,
        moments: &VecDeque<LaggedMoment>,
        until_s: f64,
        returns_nats: &impl Fn(Event<'_>, Event<'_>) -> f64,
    ) {
        let lives = lives(moments);
        let ended = lives.iter().filter_map(|(key, life)| Some((*key, life.last.filter(|_| life.is_over)?)));
        for (lost, (lost_s, lost_at)) in ended {
            for (found, life) in &lives {
                let Some(before_s) = life.before_s.filter(|_| *found != lost) else { continue };
                let time_s = before_s.max(lost_s);
                let keys = [lost, *found];
                let is_known =
                    |other: &Encounter| other.keys == keys && other.time_s.to_bits() == time_s.to_bits();
                if before_s < lost_s - TOGETHER_S
                    || before_s > lost_s + REMEMBERED_S
                    || time_s > until_s
                    || time_s <= self.settled_s
                    || !keys.iter().all(|key| self.names.contains_key(key))
                    || self.list.iter().any(is_known)
                {
                    continue;
                }
                let Some((found_s, found_at)) = first_place(moments, *found, time_s) else { continue };
                let place_nats = returns_nats((lost_s, &lost_at), (found_s, &found_at));
                if place_nats > LEAST_PLACE_NATS {
                    self.insert(Encounter { time_s, keys, place_nats, is_exchange: false });
                }
            }
        }
    }
}

/// First and last moments of all held tracks.
fn lives(moments: &VecDeque<LaggedMoment>) -> BTreeMap<Key, Life> {
    let mut lives: BTreeMap<Key, Life> = BTreeMap::new();
    let mut before_s = None;
    for moment in moments {
        for trace in &moment.people {
            let life = lives.entry(trace.key).or_insert(Life { before_s, last: None, is_over: true });
            if let Some(measured) = &trace.motion.measured {
                life.last = Some((moment.time_s, measured.place));
            }
        }
        before_s = Some(moment.time_s);
    }
    for trace in moments.back().iter().flat_map(|now| &now.people) {
        if let Some(life) = lives.get_mut(&trace.key) {
            life.is_over = false;
        }
    }
    lives
}

/// Time (seconds) and place (metres) of a track in its first moment after a time.
fn first_place(moments: &VecDeque<LaggedMoment>, key: Key, after_s: f64) -> Option<(f64, Vector2<f64>)> {
    let mut later = moments.iter().skip(moments.partition_point(|moment| moment.time_s <= after_s));
    later.find_map(|moment| {
        let trace = moment.people.iter().find(|trace| trace.key == key)?;
        Some((moment.time_s, trace.motion.place()))
    })
}
