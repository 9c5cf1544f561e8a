//! Track management after sampling: turns a moment's states into tracks, updates their probability of existence and
//! restores exchanged identities.

use super::Mcmc;
use super::blackout::LEAVES_WITHIN_M;
use super::boxes::BoxMeasurement;
use super::evidence::{Evidence, worst_filled};
use super::options::Spread;
use super::person::Key;
use super::posture::Size;
use super::reassociation::reassociate;
use super::rescue::is_person_shown;
use super::sighting::Sighting;
use super::tally::{Sums, Tally};
use super::track::{BirthPhase, Track};
use crate::identity::NamedPerson;
use crate::likelihood::Counts;
use crate::likelihood::prior::log_separation;
use crate::silhouette::visibility::visible_fractions;
use crate::silhouette::{Body, Silhouette};
use crate::{CameraFrame, TrackId};

/// A person counts as detected when the boxes support them by at least this log-likelihood ratio, nats.
const DETECTED_NATS: f64 = 3.0;

impl Mcmc {
    /// Updates the tracks from the tally: people who are in more than half of the states survive or are born, the
    /// others end.
    pub(super) fn update_tracks(&mut self, tally: &Tally, found: BirthPhase) {
        let lives = |states: u32| states * 2 > tally.states();
        let ended = self.tracks.extract_if(.., |track| !tally.of(track.key).is_some_and(|s| lives(s.states)));
        ended.for_each(|track| self.lost.add(track));
        let is_known = |sums: &Sums| self.tracks.iter().any(|t| t.key == sums.key);
        let new: Vec<&Sums> = tally.all().iter().filter(|s| lives(s.states) && !is_known(s)).collect();
        let shown = self.measurements(tally, &new);
        let alone = self.observes_boxes_alone();
        let visible = if self.simulation.sees_anything() {
            let bodies: Vec<Body> = self.tracks.iter().map(Track::body).collect();
            visible_fractions(self.layers.views(), &bodies)
        } else {
            vec![Vec::new(); self.tracks.len()]
        };
        for (person, (track, visible)) in self.tracks.iter_mut().zip(visible).enumerate() {
            let looking = (0..visible.len()).filter(|c| self.simulation.in_use(self.layers.innermost(*c)));
            let best = looking.map(|c| visible[c]).fold(self.boxes.visible(person), f64::max);
            if alone {
                track.see(best);
                if let Some(shown) = &shown[person] {
                    track.measure(shown, &self.options);
                }
            } else if let Some(sums) = tally.of(track.key) {
                track.update(sums, best, &self.options);
            }
        }
        let known = self.tracks.len();
        for (i, sums) in new.into_iter().enumerate() {
            // The number of people in more than half of the states can exceed the number in any one of them.
            if self.capacity.has_room(self.tracks.len()) {
                let mut track = Track::born(sums, found, &self.options);
                let place = sums.place();
                track.may_have_come_in = self.stage.floor.may_appear(place.x, place.y);
                if let Some(Some(shown)) = shown.get(known + i) {
                    track.appear(shown, &self.options);
                }
                self.tracks.push(track);
            }
        }
        self.capacity.note(self.tracks.len());
    }

    /// Measurements by the boxes of each track and then of each newborn person, who become the people of the boxes'
    /// state at their mean place in the tally. Empty if masks are observed, too: the tally then accounts for both.
    fn measurements(&mut self, tally: &Tally, new: &[&Sums]) -> Vec<Option<BoxMeasurement>> {
        self.boxes.clear();
        let of_track = |track: &Track| {
            let place = tally.of(track.key).map_or(track.motion.silhouette_place(), Sums::place);
            let (x_m, y_m) = tally.most_probable(track.key).map_or((place.x, place.y), |b| (b.x_m, b.y_m));
            let Size { radius, height } = *track.postures.size();
            (Body { x_m, y_m, ..track.body() }, radius, height)
        };
        let of_new = |sums: &&Sums| {
            let place = sums.place();
            let (radius_m, height_m) = (sums.radius_m(), sums.height_m());
            let body = Body { x_m: place.x, y_m: place.y, radius_m, height_m };
            (body, self.options.radius, self.options.height)
        };
        let people: Vec<(Body, Spread, Spread)> =
            self.tracks.iter().map(of_track).chain(new.iter().map(of_new)).collect();
        for (body, ..) in &people {
            self.boxes.insert(body);
        }
        if self.observes_boxes_alone() { self.boxes.measurements(&people) } else { Vec::new() }
    }

    /// Updates each track's probability of existence by the log-likelihood ratio of the observations with and without
    /// the person, and notes who was seen.
    pub(super) fn update_existence(&mut self, masks: &[Option<Vec<u64>>], time_s: f64, dt_s: f64) {
        self.simulation.restart(masks);
        let drawn: Vec<Vec<Silhouette>> = self
            .tracks
            .iter()
            .map(|t| self.layers.silhouettes(&t.body(), |l| self.simulation.in_use(l)))
            .collect();
        for silhouettes in &drawn {
            self.simulation.insert(silhouettes);
        }
        self.boxes.clear();
        self.tracks.iter().for_each(|track| self.boxes.insert(&track.body()));
        if self.may_rescue() && !self.observes_boxes_alone() {
            self.rescue.observe(&self.layers, &self.simulation, &drawn, &self.anywhere, dt_s);
        }
        let rule = self.options.likelihood;
        let nats = |counts: &mut dyn Iterator<Item = Option<Counts>>| {
            let counts = counts.zip(&self.typical_px).enumerate();
            self.rule.log_likelihood(counts.filter_map(|(i, (c, px))| Some((self.layers.shape(i), c?, *px))))
        };
        let with = nats(&mut self.simulation.counts());
        let alone = self.observes_boxes_alone();
        let crowding = if alone { self.crowding() } else { Vec::new() };
        for (person, (track, silhouettes)) in self.tracks.iter_mut().zip(&drawn).enumerate() {
            let by_boxes = self.boxes.log_likelihood() - self.boxes.try_change(Some(person), None)
                + crowding.get(person).copied().unwrap_or(0.0);
            self.simulation.try_change(Some(silhouettes), None);
            let average = Body { height_m: self.options.height.mean_m, ..track.body() };
            let evidence = Evidence {
                support_nats: with - nats(&mut self.simulation.tried()) + by_boxes,
                chance_nats: if alone { 0.0 } else { rule.worth_of(self.options.birth_evidence) },
                is_upright: track.may_be_furniture()
                    && (by_boxes > DETECTED_NATS
                        || is_person_shown(&self.simulation, &self.layers, &average)),
                worst_filled: worst_filled(&self.simulation, &self.layers, silhouettes),
                in_sight: track.in_sight,
                is_by_boxes: alone,
            };
            track.update_existence(&evidence, dt_s);
            if !alone && track.in_sight && !evidence.is_against() {
                let place = track.motion.silhouette_place();
                let at_exit = self.stage.floor.touches_exit(place.x, place.y);
                track.sighting = Some(Sighting { time_s, motion: track.motion.clone(), at_exit });
            }
        }
        if self.simulation.sees_anything() {
            self.blackout.expect(self.pixels_far_from_exits(&drawn));
        }
        let existence: Vec<f64> = self.tracks.iter().map(Track::existence).collect();
        self.boxes.learn(&existence);
        for (track, vector) in self.tracks.iter_mut().zip(self.boxes.vectors()) {
            track.learn_traits(vector);
        }
    }

    /// Pixels of the full images in which the cameras see people who cannot leave from one moment to the next.
    fn pixels_far_from_exits(&self, drawn: &[Vec<Silhouette>]) -> u64 {
        let is_far = |track: &Track| {
            let body = track.body();
            !track.is_tentative()
                && track.in_sight
                && track.existence() > 0.5
                && self.stage.floor.exit_distance_m(body.x_m, body.y_m) > LEAVES_WITHIN_M
        };
        let far = self.tracks.iter().zip(drawn).filter(|(track, _)| is_far(track));
        far.map(|(_, silhouettes)| {
            let of_camera = |camera: usize| {
                let layer = self.layers.innermost(camera);
                let block_px = u64::from(self.layers.views()[camera].block).pow(2);
                if self.simulation.in_use(layer) {
                    u64::from(silhouettes[layer].visible_px) * block_px
                } else {
                    0
                }
            };
            (0..self.layers.views().len()).map(of_camera).sum::<u64>()
        })
        .sum()
    }

    /// Log repulsion `log R` of each track against the others, nats, as it is weighted where boxes are the only
    /// observations.
    fn crowding(&self) -> Vec<f64> {
        let bodies: Vec<Body> = self.tracks.iter().map(Track::body).collect();
        let options = &self.options;
        let of_one = |i: usize| -> f64 {
            let others = (0..bodies.len()).filter(|j| *j != i);
            others.map(|j| log_separation(&bodies[i], &bodies[j], options.repulsion_per_m)).sum()
        };
        (0..bodies.len()).map(|i| options.boxes.repulsion_weight * of_one(i)).collect()
    }

    /// Exchanges back the tracks of people who met, where the moments since then tell.
    pub(super) fn reassociate(&mut self) {
        let Self { smoother, options, encounters, .. } = self;
        for exchange in reassociate(&mut smoother.moments, options, encounters.population()) {
            let of = |key: Key| self.tracks.iter().position(|track| track.key == key);
            let [Some(a), Some(b)] = exchange.keys.map(of) else { continue };
            let (left, right) = self.tracks.split_at_mut(a.max(b));
            let (low, high) = (&mut left[a.min(b)], &mut right[0]);
            low.exchange_names(high);
            std::mem::swap(&mut low.key, &mut high.key);
            let [of_a, of_b] = exchange.motions;
            // The tracks now have each other's keys.
            (self.tracks[b].motion, self.tracks[a].motion) = (of_a, of_b);
            if let (Some(a), Some(b)) = (self.tracks[a].id, self.tracks[b].id) {
                self.identities.exchange(a, b);
            }
            [self.tracks[b].learnt, self.tracks[a].learnt] = exchange.learnt;
        }
    }

    /// Re-identifies tracks whose people exchanged ids in an encounter: swaps ids and sizes back.
    pub(super) fn reidentify(&mut self, cameras: &[CameraFrame], time_s: f64) {
        let named = self.tracks.iter().filter_map(|track| {
            let vector = track.shown.vector.clone();
            Some(NamedPerson { id: track.id?, body: track.body(), vector })
        });
        let named: Vec<NamedPerson> = named.collect();
        for (a, b) in self.identities.observe(cameras, self.layers.views(), &named, time_s) {
            let of = |id: TrackId| self.tracks.iter().position(|track| track.id == Some(id));
            if let (Some(a), Some(b)) = (of(a), of(b)) {
                let (left, right) = self.tracks.split_at_mut(a.max(b));
                left[a.min(b)].exchange_names(&mut right[0]);
                if self.observes_boxes_alone() {
                    let keys = [self.tracks[a].key, self.tracks[b].key];
                    if let Some(exchanged_s) = self.smoother.exchange_names(keys) {
                        self.encounters.carried_out(keys, exchanged_s);
                    }
                }
            }
        }
    }
}
