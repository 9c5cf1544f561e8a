//! Encounters: exchanges of ids that only the sizes of many seconds reveal.
//!
//! [`super::reassociation`] looks at the seconds after two people met. Where they walked on like one another, these leave it
//! open who is who; but the average height and width of a person go on becoming more exact, to about a centimetre within
//! twenty boxes, and people differ by several. For [`REMEMBERED_S`] seconds each encounter of two tracks is therefore
//! remembered with what the places said about it, and is decided as soon as the sizes shown before and since are clear:
//!
//! ```text
//! log p(exchanged) − log p(own) = places  +  Σ over both  log p(sizes since | other's sizes before) − log p(… | own sizes before)
//! ```
//!
//! A track that ended and one that began near it are an encounter, too: an exchange then gives the new track the old id.
//! A track that went over to somebody who had been lost is one more: the lost person's name goes on there, and the track's own is
//! lost since then ([`jumps`]).
//! Three people who exchanged their ids in a circle are two exchanges. Ids are exchanged from the encounter on, in all held
//! moments; what has been told already stays.

mod jumps;

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Vector2;

use self::jumps::jumps_to;
use super::Mcmc;
use super::options::McmcOptions;
use super::person::Key;
use super::reassociation::place_nats;
use super::smoother::{LaggedMoment, WINDOW_S};
use super::trace::Trace;
use super::traits::{LearntSize, LearntTraits, size_exchange_nats};
use crate::TrackId;

/// Time for which an encounter can be decided, seconds.
pub(super) const REMEMBERED_S: f64 = 20.0;
/// Least log probability ratio of an exchange that is carried out, nats.
const CLEARLY_NATS: f64 = 1.0;
/// Least log probability ratio by the places of an encounter that is remembered, nats.
const LEAST_PLACE_NATS: f64 = -12.0;
/// Interval of which one encounter of a pair is remembered, seconds.
const APART_S: f64 = 0.5;
/// Largest number of exchanges of one moment.
const MOST_EXCHANGES: usize = 8;
/// Standard deviation of the distance between the end of a track and the beginning of the same person's next one, metres, and
/// its growth for each second between them, m/s.
const FOUND_AGAIN_M: f64 = 0.4;
const FOUND_AGAIN_M_S: f64 = 0.5;
/// Time for which the end of a track and the beginning of the same person's next one may overlap, seconds.
const TOGETHER_S: f64 = 2.0;
/// Log ratio of the density (1/m²) of lost people who are found again to that of people who are new, nats: where people
/// neither come in nor leave; and in a zone, or for somebody who was lost in one.
const RETURNS_NATS: f64 = 3.5;
const RETURNS_AT_ZONE_NATS: f64 = -4.0;

/// Two tracks that were close.
#[derive(Debug, Clone)]
struct Encounter {
    time_s: f64,
    /// Their names from then on.
    ids: [TrackId; 2],
    /// Log probability ratio of an exchange by the places, nats.
    place_nats: f64,
}

/// Person whose track ended.
#[derive(Debug, Clone)]
struct Lost {
    id: TrackId,
    /// Time and place of the last measurement, seconds and metres.
    time_s: f64,
    place: Vector2<f64>,
    learnt: LearntTraits,
}

/// Remembered encounters and lost people.
#[derive(Debug, Clone, Default)]
pub(super) struct Encounters {
    met: Vec<Encounter>,
    lost: Vec<Lost>,
    /// Learnt traits of the people who were tracked at the moment before.
    tracked: BTreeMap<TrackId, LearntTraits>,
    /// Time up to which encounters were looked for, seconds.
    searched_s: Option<f64>,
    /// Whether the detector gives appearance vectors.
    has_vectors: bool,
}

/// Exchange of two names after a time.
struct Renaming {
    time_s: f64,
    ids: [TrackId; 2],
    /// Sizes that the two have from then on.
    sizes: [LearntSize; 2],
    kind: Kind,
}

/// Kinds of exchange of two names.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// Two tracks that met.
    Met,
    /// The first, who was lost, is found again as the second, whose name is given up.
    Found,
    /// The track of the second went over to the first, who was lost; the second is lost since then, at this place (metres).
    GoneOver(Vector2<f64>),
}

/// Sizes that each name showed in the held moments: after each of them until now.
struct SizesSince {
    times_s: Vec<f64>,
    of: BTreeMap<TrackId, Vec<LearntSize>>,
}

impl SizesSince {
    fn of_moments(moments: &VecDeque<LaggedMoment>) -> Self {
        let mut of: BTreeMap<TrackId, Vec<LearntSize>> = BTreeMap::new();
        for (back, moment) in moments.iter().rev().enumerate() {
            for sums in of.values_mut() {
                sums.push(sums.last().copied().unwrap_or_default());
            }
            for trace in &moment.people {
                let Some(id) = trace.id else { continue };
                let sums = of.entry(id).or_insert_with(|| vec![LearntSize::default(); back + 1]);
                if let Some(last) = sums.last_mut() {
                    last.add(&trace.shown);
                }
            }
        }
        Self { times_s: moments.iter().rev().map(|moment| moment.time_s).collect(), of }
    }

    /// Sizes shown after a time.
    fn after(&self, id: TrackId, time_s: f64) -> LearntSize {
        // `sums[i]` has the newest i + 1 moments.
        let newer = self.times_s.partition_point(|held_s| *held_s > time_s);
        let sums = self.of.get(&id);
        newer.checked_sub(1).and_then(|i| sums?.get(i)).copied().unwrap_or_default()
    }
}

impl Encounters {
    /// Remembers the encounters of the moments that have become older than the window of reassociation, and who was lost.
    fn remember(
        &mut self,
        moments: &VecDeque<LaggedMoment>,
        tracked: BTreeMap<TrackId, LearntTraits>,
        options: &McmcOptions,
    ) {
        let Some(now) = moments.back() else { return };
        let first_s = now.time_s - REMEMBERED_S;
        self.met.retain(|encounter| encounter.time_s >= first_s);
        for (id, learnt) in std::mem::replace(&mut self.tracked, tracked) {
            if !self.tracked.contains_key(&id)
                && let Some((time_s, place)) = last_measured(moments, id)
            {
                self.lost.push(Lost { id, time_s, place, learnt });
            }
        }
        let tracked = &self.tracked;
        self.lost.retain(|lost| lost.time_s >= first_s && !tracked.contains_key(&lost.id));
        let until_s = now.time_s - WINDOW_S;
        let searched_s = self.searched_s.replace(until_s).unwrap_or(f64::NEG_INFINITY);
        let ids: BTreeMap<Key, TrackId> =
            now.people.iter().filter_map(|trace| Some((trace.key, trace.id?))).collect();
        for (from, moment) in moments.iter().enumerate() {
            if moment.time_s <= searched_s || moment.time_s > until_s {
                continue;
            }
            for (i, a) in moment.people.iter().enumerate() {
                for b in &moment.people[..i] {
                    let name = |trace: &Trace| trace.id.or_else(|| ids.get(&trace.key).copied());
                    let (Some(id_a), Some(id_b)) = (name(a), name(b)) else { continue };
                    let place_nats = place_nats(moments, from, [a.key, b.key], options);
                    if let Some(place_nats) = place_nats.filter(|nats| *nats > LEAST_PLACE_NATS) {
                        self.add(Encounter { time_s: moment.time_s, ids: [id_a, id_b], place_nats });
                    }
                }
            }
        }
    }

    /// Remembers an encounter, the likelier one of two that follow each other.
    fn add(&mut self, new: Encounter) {
        let is_same = |old: &&mut Encounter| {
            new.time_s - old.time_s < APART_S && new.ids.iter().all(|id| old.ids.contains(id))
        };
        match self.met.iter_mut().rev().find(is_same) {
            Some(old) if old.place_nats >= new.place_nats => {}
            Some(old) => *old = new,
            None => self.met.push(new),
        }
    }

    /// Clearest exchange, if any is clear.
    fn clearest(
        &self,
        moments: &VecDeque<LaggedMoment>,
        room: &impl Fn(&Lost, &Vector2<f64>, f64) -> f64,
        options: &McmcOptions,
    ) -> Option<Renaming> {
        let since = SizesSince::of_moments(moments);
        let learnt = |id: TrackId| -> LearntSize {
            let lost = || self.lost.iter().find(|lost| lost.id == id).map(|lost| lost.learnt.size);
            self.tracked.get(&id).map(|traits| traits.size).or_else(lost).unwrap_or_default()
        };
        let weighed = |time_s: f64, ids: [TrackId; 2], nats: f64, kind: Kind| {
            let after = ids.map(|id| since.after(id, time_s));
            let before = [0, 1].map(|i| learnt(ids[i]).without(&after[i]));
            let gain = nats + size_exchange_nats(before.each_ref(), after.each_ref(), options);
            let sizes = [0, 1].map(|i: usize| before[i].with(&after[1 - i]));
            (gain, Renaming { time_s, ids, sizes, kind })
        };
        let met = self.met.iter().map(|met| weighed(met.time_s, met.ids, met.place_nats, Kind::Met));
        let begun = beginnings(moments);
        let found = self.lost.iter().flat_map(|lost| {
            let later = begun.iter().filter(|(id, begun_s)| {
                *begun_s > lost.time_s - TOGETHER_S && *id != lost.id && self.tracked.contains_key(id)
            });
            later.filter_map(|(id, begun_s)| {
                let (time_s, place) = first_place(moments, *id, begun_s.max(lost.time_s))?;
                Some(weighed(lost.time_s, [lost.id, *id], room(lost, &place, time_s), Kind::Found))
            })
        });
        let gone_over = self.lost.iter().flat_map(|lost| {
            let returns = |place: &Vector2<f64>, time_s: f64| room(lost, place, time_s);
            let jumps = jumps_to(moments, (lost.time_s, &lost.place), &returns).into_iter();
            let known = jumps.filter(|jump| jump.id != lost.id && self.tracked.contains_key(&jump.id));
            known.filter_map(|jump| {
                let (time_s, ids) = (jump.time_s, [lost.id, jump.id]);
                // Boxes that do not fit the track's own person may show a third one: they have to fit the lost person
                // better than a stranger.
                let shown = since.after(jump.id, time_s);
                let of_anybody = shown.log_density(&LearntSize::default(), options);
                let is_likely = shown.log_density(&lost.learnt.size, options) > of_anybody;
                let kind = Kind::GoneOver(jump.left);
                is_likely.then(|| weighed(time_s, ids, jump.nats, kind))
            })
        });
        let all = met.chain(found.collect::<Vec<_>>()).chain(gone_over.collect::<Vec<_>>());
        let clear = all.filter(|(gain, _)| *gain > CLEARLY_NATS);
        clear.max_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, renaming)| renaming)
    }

    /// Exchanges two names in what is remembered of later encounters, and of lost people.
    fn exchange(&mut self, Renaming { time_s, ids, sizes, kind }: &Renaming) {
        let [a, b] = *ids;
        let other = |id: TrackId| match id {
            id if id == a => b,
            id if id == b => a,
            id => id,
        };
        // One exchange decides what happened there. It has the time of its encounter, to the bit.
        let is_decided = |met: &Encounter| met.time_s.to_bits() == time_s.to_bits();
        self.met.retain(|met| !(is_decided(met) && met.ids.iter().all(|id| ids.contains(id))));
        for encounter in self.met.iter_mut().filter(|encounter| encounter.time_s > *time_s) {
            encounter.ids = encounter.ids.map(other);
        }
        match *kind {
            Kind::Met => {}
            Kind::Found => self.lost.retain(|lost| lost.id != a),
            Kind::GoneOver(left) => {
                for lost in self.lost.iter_mut().filter(|lost| lost.id == a) {
                    (lost.time_s, lost.place) = (*time_s, left);
                }
            }
        }
        for lost in self.lost.iter_mut().filter(|lost| ids.contains(&lost.id)) {
            lost.id = other(lost.id);
            lost.learnt.size = sizes[usize::from(lost.id == b)];
        }
    }
}

/// Time (seconds) and place (metres) of the last measurement of a name.
fn last_measured(moments: &VecDeque<LaggedMoment>, id: TrackId) -> Option<(f64, Vector2<f64>)> {
    moments.iter().rev().find_map(|moment| {
        let trace = moment.people.iter().find(|trace| trace.id == Some(id))?;
        Some((moment.time_s, trace.motion.measured.as_ref()?.place))
    })
}

/// Place (metres) of a name in the first moment with it from a time on, and that time (seconds).
fn first_place(moments: &VecDeque<LaggedMoment>, id: TrackId, from_s: f64) -> Option<(f64, Vector2<f64>)> {
    let later = moments.iter().skip(moments.partition_point(|moment| moment.time_s < from_s));
    let mut places = later.filter_map(|moment| {
        let trace = moment.people.iter().find(|trace| trace.id == Some(id))?;
        Some((moment.time_s, trace.motion.place()))
    });
    places.next()
}

/// Names that begin within the held moments, with the time of their track's first moment, seconds.
fn beginnings(moments: &VecDeque<LaggedMoment>) -> Vec<(TrackId, f64)> {
    let Some(first) = moments.front() else { return Vec::new() };
    let mut names: BTreeMap<TrackId, Key> = BTreeMap::new();
    let mut keys: BTreeMap<Key, f64> = BTreeMap::new();
    for moment in moments {
        for trace in &moment.people {
            keys.entry(trace.key).or_insert(moment.time_s);
            if let Some(id) = trace.id {
                names.entry(id).or_insert(trace.key);
            }
        }
    }
    let begun = names.into_iter().filter_map(|(id, key)| Some((id, *keys.get(&key)?)));
    begun.filter(|(_, begun_s)| *begun_s > first.time_s).collect()
}

impl Mcmc {
    /// Exchanges ids of people who met, or of one who was lost and one who was found, where their sizes since then tell.
    pub(super) fn rename_by_sizes(&mut self) {
        self.encounters.has_vectors |= self.boxes.has_vectors();
        if self.encounters.has_vectors {
            // Vectors tell more.
            return;
        }
        let tracked = |mcmc: &Self| -> BTreeMap<TrackId, LearntTraits> {
            mcmc.tracks.iter().filter_map(|track| Some((track.id?, track.learnt.clone()))).collect()
        };
        self.encounters.remember(&self.smoother.moments, tracked(self), &self.options);
        let mut encounters = std::mem::take(&mut self.encounters);
        for _ in 0..MOST_EXCHANGES {
            let room =
                |lost: &Lost, place: &Vector2<f64>, time_s: f64| self.returns_nats(lost, place, time_s);
            let Some(renaming) = encounters.clearest(&self.smoother.moments, &room, &self.options) else {
                break;
            };
            self.smoother.exchange_names_since(renaming.ids, renaming.time_s);
            self.exchange_tracks(renaming.ids, renaming.sizes);
            encounters.exchange(&renaming);
            encounters.tracked = tracked(self);
        }
        self.encounters = encounters;
    }

    /// Exchanges the names of two people, of whom one may be lost, and sets the sizes learnt of each name.
    fn exchange_tracks(&mut self, ids: [TrackId; 2], sizes: [LearntSize; 2]) {
        let at = ids.map(|id| self.tracks.iter().position(|track| track.id == Some(id)));
        match at {
            [Some(a), Some(b)] => {
                let (left, right) = self.tracks.split_at_mut(a.max(b));
                left[a.min(b)].exchange_names(&mut right[0]);
                self.identities.exchange(ids[0], ids[1]);
            }
            [Some(a), None] => self.tracks[a].id = Some(ids[1]),
            [None, Some(b)] => self.tracks[b].id = Some(ids[0]),
            [None, None] => {}
        }
        for (id, size) in ids.iter().zip(sizes) {
            if let Some(track) = self.tracks.iter_mut().find(|track| track.id == Some(*id)) {
                track.learnt.size = size;
            }
        }
    }

    /// Log odds by time and place, nats, that the person whose track begins here is one who was lost.
    fn returns_nats(&self, lost: &Lost, place: &Vector2<f64>, time_s: f64) -> f64 {
        let floor = &self.stage.floor;
        let is_at_zone = !self.stage.zones.is_empty()
            && (floor.may_appear(place.x, place.y) || floor.may_disappear(lost.place.x, lost.place.y));
        let sigma_m = FOUND_AGAIN_M + FOUND_AGAIN_M_S * (time_s - lost.time_s);
        let squared_sigmas = (place - lost.place).norm_squared() / sigma_m.powi(2);
        let density = -0.5 * squared_sigmas - (std::f64::consts::TAU * sigma_m.powi(2)).ln();
        density + if is_at_zone { RETURNS_AT_ZONE_NATS } else { RETURNS_NATS }
    }
}

#[cfg(test)]
mod tests;
