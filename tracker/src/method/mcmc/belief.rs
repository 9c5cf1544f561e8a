//! From a moment's states to what is believed: who lives, how sure that is, who is who.

use super::Mcmc;
use super::evidence::{Evidence, worst_filled};
use super::rescue::is_person_shown;
use super::tally::Tally;
use super::track::{Found, Track};
use crate::likelihood::Counts;
use crate::silhouette::visibility::visible_fractions;
use crate::silhouette::{Body, Silhouette};
use crate::{CameraFrame, TrackId};

impl Mcmc {
    /// Turns the tally into tracks: people in most of the states live, the others are gone.
    pub(super) fn take_in(&mut self, tally: &Tally, found: Found) {
        let lives = |states: u32| states * 2 > tally.states();
        self.tracks.retain(|track| tally.of(track.key).is_some_and(|s| lives(s.states)));
        let bodies: Vec<Body> = self.tracks.iter().map(Track::body).collect();
        let visible = visible_fractions(self.layers.views(), &bodies);
        for (track, visible) in self.tracks.iter_mut().zip(visible) {
            if let Some(sums) = tally.of(track.key) {
                let looking =
                    (0..visible.len()).filter(|c| self.simulation.in_use(self.layers.innermost(*c)));
                let best = looking.map(|c| visible[c]).fold(0.0, f64::max);
                track.update(sums, best, &self.options);
            }
        }
        for sums in tally.all().iter().filter(|s| lives(s.states)) {
            let is_new = self.tracks.iter().all(|t| t.key != sums.key);
            // More may live in most of the states than in any one of them.
            if is_new && self.capacity.has_room(self.tracks.len()) {
                self.tracks.push(Track::born(sums, found, &self.options));
            }
        }
        self.capacity.note(self.tracks.len());
    }

    /// Takes in, for each person, how much better the masks are explained with them than without; believes in those who
    /// have become likely enough.
    pub(super) fn weigh(&mut self, masks: &[Option<Vec<u64>>], dt_s: f64) {
        self.simulation.restart(masks);
        let drawn: Vec<Vec<Silhouette>> = self
            .tracks
            .iter()
            .map(|t| self.layers.silhouettes(&t.body(), |l| self.simulation.in_use(l)))
            .collect();
        for silhouettes in &drawn {
            self.simulation.insert(silhouettes);
        }
        if self.may_rescue() {
            self.rescue.observe(&self.layers, &self.simulation, &drawn, &self.anywhere, dt_s);
        }
        let rule = self.options.likelihood;
        let nats = |counts: &mut dyn Iterator<Item = Option<Counts>>| {
            let counts = counts.zip(&self.typical_px).enumerate();
            self.rule.log_likelihood(counts.filter_map(|(i, (c, px))| Some((self.layers.shape(i), c?, *px))))
        };
        let with = nats(&mut self.simulation.counts());
        for (track, silhouettes) in self.tracks.iter_mut().zip(&drawn) {
            self.simulation.try_change(Some(silhouettes), None);
            let average = Body { height_m: self.options.height.mean_m, ..track.body() };
            let evidence = Evidence {
                support_nats: with - nats(&mut self.simulation.tried()),
                chance_nats: rule.worth_of(self.options.birth_evidence),
                is_upright: track.may_be_furniture()
                    && is_person_shown(&self.simulation, &self.layers, &average),
                worst_filled: worst_filled(&self.simulation, &self.layers, silhouettes),
                in_sight: track.in_sight,
            };
            track.weigh(&evidence, dt_s);
            if track.id.is_none() && track.is_believable(&self.options) {
                track.id = Some(TrackId(self.next_id));
                self.next_id += 1;
            }
        }
    }

    /// Gives people who have exchanged their names in an encounter their own ones back, with what is known of their sizes.
    pub(super) fn tell_apart(&mut self, cameras: &[CameraFrame]) {
        let named: Vec<(TrackId, Body)> =
            self.tracks.iter().filter_map(|track| Some((track.id?, track.body()))).collect();
        for (a, b) in self.identities.observe(cameras, self.layers.views(), &named) {
            let of = |id: TrackId| self.tracks.iter().position(|track| track.id == Some(id));
            if let (Some(a), Some(b)) = (of(a), of(b)) {
                let (left, right) = self.tracks.split_at_mut(a.max(b));
                left[a.min(b)].exchange_names(&mut right[0]);
            }
        }
    }
}
