//! Encounters: who is who after people met, decided for everybody of the last seconds together.
//!
//! [`super::reassociation`] looks at pairs of tracks in the seconds after two people met. In a crowd this leaves much open: people
//! walk on like one another, and a track that takes another's person usually drives that one's track to a third, so that names go
//! round in circles of which no single exchange looks right. But the average height and width of a name go on becoming more exact,
//! to about a centimetre within twenty boxes, and most people differ by several. For [`UNDECIDED_S`] seconds, each encounter of two
//! tracks is therefore remembered with what the places said about it ([`search`]), and every half second it is asked which of
//! them were exchanges:
//!
//! ```text
//! log p(exchanges) = Σ over exchanges (places − EXCHANGE_NATS)  +  Σ over names log p(all traits shown under the name)
//! ```
//!
//! where `places` is the log probability ratio of the exchange by the motion alone, and a name's traits are those of one person,
//! whose height and width are among those of the people who are tracked ([`super::population`], [`window`]), and whose appearance
//! vectors, where the detector gives some, are near to one another as they are within a track ([`appearance`]). The most probable
//! set of exchanges is searched for by simulated annealing ([`annealing`]), from the one that held before. A track that ended and
//! one that began near it are an encounter, too: an exchange then gives the new track the old name. Names are exchanged from the
//! encounter on, in all held moments; what has been told already stays.
//!
//! The moves over a window are those of S. Oh, S. Russell, S. Sastry, "Markov chain Monte Carlo data association for multi-target
//! tracking", IEEE TAC 54(3), 2009; there, too, the assignment of a whole window is one problem.

mod annealing;
mod appearance;
mod search;
mod window;

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Vector2;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use self::search::Event;
use self::window::Window;
use super::Mcmc;
use super::options::McmcOptions;
use super::person::Key;
use super::population;
use super::posture::Size;
use super::smoother::LaggedMoment;
use super::track::Track;
use super::traits::LearntTraits;
use crate::TrackId;
use crate::identity::mean_vector::MeanVector;
use crate::prepared_room::PreparedRoom;

/// Time for which moments are held: that after which a lost person is not found again, seconds.
pub(super) const REMEMBERED_S: f64 = 20.0;
/// Interval at which the encounters are weighed, seconds.
const WEIGHED_EVERY_S: f64 = 0.5;
/// Time for which an encounter can be decided, seconds: until its moment is told, after the lag of
/// [`McmcOptions::of_boxes`].
const UNDECIDED_S: f64 = 10.0 - WEIGHED_EVERY_S;
/// Log odds against an exchange beside what its places say, nats. Chosen on generated crowds of 15 people, where 0.5 and 1 are
/// alike and 2 leaves out two fifths of what is won, with the prior's spread of sizes.
const EXCHANGE_NATS: f64 = 1.0;
/// Log odds of an exchange that was seen by looks, nats.
const SEEN_NATS: f64 = 20.0;
/// Standard deviation of the distance between the end of a track and the beginning of the same person's next one, metres, and
/// its growth for each second between them, m/s.
const FOUND_AGAIN_M: f64 = 0.4;
const FOUND_AGAIN_M_S: f64 = 0.5;
/// Log ratio of the density (1/m²) of lost people who are found again to that of people who are new, nats: where people
/// neither come in nor leave; and in a zone, or for somebody who was lost in one.
const RETURNS_NATS: f64 = 3.5;
const RETURNS_AT_ZONE_NATS: f64 = -4.0;

/// Two tracks that were close, or one that ended where the other began.
#[derive(Debug, Clone)]
struct Encounter {
    /// Time after which they would have each other's names, seconds.
    time_s: f64,
    keys: [Key; 2],
    /// Log probability ratio of an exchange by the places, nats.
    place_nats: f64,
    is_exchange: bool,
}

/// Remembered encounters, and the names before them.
#[derive(Debug, Clone)]
pub(super) struct Encounters {
    /// Encounters of the last [`UNDECIDED_S`] seconds, oldest first.
    list: Vec<Encounter>,
    /// Name of each track before the first of them.
    names: BTreeMap<Key, TrackId>,
    /// Traits that each name showed until then.
    settled: BTreeMap<TrackId, LearntTraits>,
    /// Times up to which traits are settled, encounters were looked for, and encounters were weighed, seconds.
    settled_s: f64,
    searched_s: f64,
    weighed_s: f64,
    /// Sizes of the people of the last [`REMEMBERED_S`] seconds; the prior's before the first weighing.
    population: Size,
    rng: Pcg64Mcg,
}

/// Names of the people who are tracked now, where they changed.
struct Renamed {
    /// Name of each track.
    names: BTreeMap<Key, TrackId>,
    /// Traits that each name has shown.
    learnt: BTreeMap<TrackId, LearntTraits>,
}

impl Encounters {
    pub(super) fn new(options: &McmcOptions) -> Self {
        Self {
            list: Vec::new(),
            names: BTreeMap::new(),
            settled: BTreeMap::new(),
            settled_s: f64::NEG_INFINITY,
            searched_s: f64::NEG_INFINITY,
            weighed_s: f64::NEG_INFINITY,
            population: Size::prior(options),
            rng: Pcg64Mcg::seed_from_u64(options.seed),
        }
    }

    /// Decides who is who by all that is known now: exchanges names in the moments, and tells whose names changed. `returns_nats`:
    /// as in [`Self::search`].
    fn decide(
        &mut self,
        moments: &mut VecDeque<LaggedMoment>,
        options: &McmcOptions,
        returns_nats: &impl Fn(Event<'_>, Event<'_>) -> f64,
    ) -> Option<Renamed> {
        let now_s = moments.back()?.time_s;
        self.settle(moments, now_s - UNDECIDED_S);
        self.search(moments, options, returns_nats);
        self.population = population::estimated(moments, &Size::prior(options));
        self.weigh(moments)
    }

    /// Sizes of the people of the last [`REMEMBERED_S`] seconds.
    pub(super) fn population(&self) -> &Size {
        &self.population
    }

    /// Remembers an exchange of two tracks that others have found and carried out.
    pub(super) fn carried_out(&mut self, keys: [Key; 2], time_s: f64) {
        if keys.iter().all(|key| self.names.contains_key(key)) {
            self.insert(Encounter { time_s, keys, place_nats: SEEN_NATS, is_exchange: true });
        }
    }

    /// Inserts an encounter at its time.
    fn insert(&mut self, encounter: Encounter) {
        let at = self.list.partition_point(|other| other.time_s <= encounter.time_s);
        self.list.insert(at, encounter);
    }

    /// Takes notice of the names of tracks that are new.
    fn observe_names(&mut self, moments: &VecDeque<LaggedMoment>) {
        for trace in moments.back().iter().flat_map(|now| &now.people) {
            if let Some(id) = trace.id {
                self.names.entry(trace.key).or_insert(id);
            }
        }
    }

    /// Settles what is older than a time: exchanges move on to [`Self::names`], and traits to those of the names then. Vectors,
    /// which are large, are held no longer.
    fn settle(&mut self, moments: &mut VecDeque<LaggedMoment>, until_s: f64) {
        for moment in
            moments.iter_mut().filter(|moment| moment.time_s > self.settled_s && moment.time_s <= until_s)
        {
            let before = self.list.partition_point(|encounter| encounter.time_s < moment.time_s);
            for Encounter { keys: [a, b], .. } in self.list.drain(..before).filter(|old| old.is_exchange) {
                exchange(&mut self.names, a, b);
            }
            for trace in &mut moment.people {
                if let Some(name) = self.names.get(&trace.key) {
                    self.settled.entry(*name).or_default().add(&trace.shown);
                }
                trace.shown.vector = MeanVector::default();
            }
        }
        self.settled_s = self.settled_s.max(until_s);
        let is_held = |key: &Key| moments.iter().any(|m| m.people.iter().any(|trace| trace.key == *key));
        let in_doubt = |key: &Key| self.list.iter().any(|encounter| encounter.keys.contains(key));
        self.names.retain(|key, _| is_held(key) || in_doubt(key));
        let names = &self.names;
        self.settled.retain(|name, _| names.values().any(|held| held == name));
    }

    /// Finds the most probable exchanges, and gives the held moments their names. `None` where nothing changed.
    fn weigh(&mut self, moments: &mut VecDeque<LaggedMoment>) -> Option<Renamed> {
        if self.list.is_empty() {
            return None;
        }
        let window = Window::new(moments, self);
        let before: Vec<bool> = self.list.iter().map(|encounter| encounter.is_exchange).collect();
        let exchanges = annealing::most_probable(&window, &self.list, &mut self.rng);
        if exchanges == before {
            return None;
        }
        for (encounter, is_exchange) in self.list.iter_mut().zip(exchanges) {
            encounter.is_exchange = is_exchange;
        }
        let (mut names, mut learnt) = (self.names.clone(), self.settled.clone());
        let mut later = self.list.iter().peekable();
        for moment in moments.iter_mut().filter(|moment| moment.time_s > self.settled_s) {
            while let Some(encounter) = later.next_if(|encounter| encounter.time_s < moment.time_s) {
                if let (true, [a, b]) = (encounter.is_exchange, encounter.keys) {
                    exchange(&mut names, a, b);
                }
            }
            for trace in &mut moment.people {
                let Some(name) = names.get(&trace.key) else { continue };
                learnt.entry(*name).or_default().add(&trace.shown);
                if trace.id.is_some() {
                    trace.id = Some(*name);
                }
            }
        }
        Some(Renamed { names, learnt })
    }
}

/// Exchanges the names of two tracks.
fn exchange(names: &mut BTreeMap<Key, TrackId>, a: Key, b: Key) {
    if let (Some(of_a), Some(of_b)) = (names.get(&a).copied(), names.get(&b).copied()) {
        names.insert(a, of_b);
        names.insert(b, of_a);
    }
}

impl Mcmc {
    /// Exchanges the names of people who met, or of one who was lost and one who was found, where the traits shown since then
    /// tell.
    pub(super) fn rename_by_traits(&mut self) {
        let Self { encounters, smoother, stage, options, .. } = self;
        let Some(now_s) = smoother.moments.back().map(|now| now.time_s) else { return };
        encounters.observe_names(&smoother.moments);
        if now_s < encounters.weighed_s + WEIGHED_EVERY_S {
            return;
        }
        encounters.weighed_s = now_s;
        let returns_nats = |lost: Event<'_>, found: Event<'_>| returns_nats(stage, lost, found);
        if let Some(renamed) = encounters.decide(&mut smoother.moments, options, &returns_nats) {
            self.rename_tracks(&renamed);
        }
    }

    /// Gives the tracks their names, and what was learnt of the people of these names.
    fn rename_tracks(&mut self, Renamed { names, learnt }: &Renamed) {
        let wanted = |track: &Track| names.get(&track.key).copied();
        for to in 0..self.tracks.len() {
            let Some(name) = wanted(&self.tracks[to]).filter(|_| self.tracks[to].id.is_some()) else {
                continue;
            };
            let owner = self.tracks.iter().position(|track| track.id == Some(name));
            if let Some(from) = owner.filter(|from| *from != to) {
                let (left, right) = self.tracks.split_at_mut(to.max(from));
                let (low, high) = (&mut left[to.min(from)], &mut right[0]);
                low.exchange_names(high);
                if let (Some(a), Some(b)) = (low.id, high.id) {
                    self.identities.exchange(a, b);
                }
            }
        }
        for track in self.tracks.iter_mut().filter(|track| track.id.is_some()) {
            let Some(name) = names.get(&track.key) else { continue };
            track.id = Some(*name);
            if let Some(learnt) = learnt.get(name) {
                track.learnt.clone_from(learnt);
            }
        }
    }
}

/// Log odds by time and place, nats, that the person whose track begins is one who was lost: times in seconds and places in metres
/// of both.
fn returns_nats(
    stage: &PreparedRoom,
    (lost_s, lost_at): (f64, &Vector2<f64>),
    (found_s, found_at): (f64, &Vector2<f64>),
) -> f64 {
    let floor = &stage.floor;
    let is_at_zone = !stage.zones.is_empty()
        && (floor.may_appear(found_at.x, found_at.y) || floor.may_disappear(lost_at.x, lost_at.y));
    let sigma_m = FOUND_AGAIN_M + FOUND_AGAIN_M_S * (found_s - lost_s);
    let squared_sigmas = (found_at - lost_at).norm_squared() / sigma_m.powi(2);
    let density = -0.5 * squared_sigmas - (std::f64::consts::TAU * sigma_m.powi(2)).ln();
    density + if is_at_zone { RETURNS_AT_ZONE_NATS } else { RETURNS_NATS }
}

#[cfg(test)]
mod tests;
