//! Lost people: their tracks ended far from every exit, or go on, but the cameras contradict them, or have not seen them
//! since an outage.
//!
//! Nobody vanishes from the middle of a room. A track that is confirmed some time later, where hardly anybody can have
//! come in, is more probably the lost person than another one, and keeps the id. With the time t since the person was last
//! seen, the motion model's belief about a person out of sight after t, and the rate of births b at the place (1/s, over
//! an area A):
//!
//! ```text
//! log p(the lost person) − log p(somebody new) = log N(place; belief after t) − log (b t / A)
//! ```

use super::Mcmc;
use super::outage::FORGOTTEN_AFTER_S;
use super::person::Key;
use super::sighting::Sighting;
use super::track::Track;

/// Probability of existence below which a followed person counts as lost.
const HARDLY_THERE: f64 = 0.1;

/// Index of a lost person's track.
#[derive(Debug, Clone, Copy)]
enum Lost {
    /// Among the tracks that ended.
    Ended(usize),
    /// Among the tracks that go on.
    Missing(usize),
}

/// Tracks that ended far from every exit.
#[derive(Debug, Clone, Default)]
pub(super) struct LostTracks(Vec<Track>);

impl LostTracks {
    /// Adds a track that ended, if its person is lost.
    pub(super) fn add(&mut self, track: Track) {
        if last_sighting(&track).is_some() {
            self.0.push(track);
        }
    }

    /// Forgets those who were seen too long ago.
    fn forget(&mut self, now_s: f64) {
        self.0
            .retain(|track| last_sighting(track).is_some_and(|seen| now_s - seen.time_s < FORGOTTEN_AFTER_S));
    }
}

/// Last sighting of a confirmed person; `None` of somebody who was at an exit then, and may have left.
fn last_sighting(track: &Track) -> Option<&Sighting> {
    track.sighting.as_ref().filter(|sighting| track.id.is_some() && !sighting.at_exit)
}

impl Mcmc {
    /// Gives the tracks that are now confirmed their ids: that of a lost person who more probably is there than somebody new,
    /// or a new one.
    pub(super) fn confirm_tracks(&mut self, now_s: f64) {
        self.lost.forget(now_s);
        let mut replaced: Vec<Key> = Vec::new();
        for new in 0..self.tracks.len() {
            let track = &self.tracks[new];
            let is_named = track.id.is_some() || replaced.contains(&track.key);
            if is_named || !track.is_confirmable(&self.options) {
                continue;
            }
            match self.most_probably_lost(new, now_s) {
                Some(Lost::Ended(i)) => {
                    self.tracks[new].exchange_names(&mut self.lost.0[i]);
                    self.lost.0.swap_remove(i);
                }
                Some(Lost::Missing(i)) => {
                    let (left, right) = self.tracks.split_at_mut(new.max(i));
                    left[new.min(i)].exchange_names(&mut right[0]);
                    replaced.push(self.tracks[i].key);
                }
                None => self.tracks[new].name_anew(&mut self.next_id),
            }
        }
        self.tracks.retain(|track| !replaced.contains(&track.key));
    }

    /// Lost person who is most probably where a new track is; `None` where somebody new is more probable.
    fn most_probably_lost(&self, new: usize, now_s: f64) -> Option<Lost> {
        // People come back by boxes alone as their traits tell ([`super::encounters`]).
        if !self.may_rescue() || self.observes_boxes_alone() {
            return None;
        }
        let place = self.tracks[new].motion.silhouette_place();
        let (rate, area_m2) = if self.tracks[new].may_have_come_in {
            (self.options.births_per_s, self.zones.area_m2())
        } else {
            (self.options.rescues_per_s, self.anywhere.area_m2())
        };
        let gain = |track: &Track| -> Option<f64> {
            let sighting = last_sighting(track).filter(|sighting| sighting.time_s < now_s)?;
            let newcomers = rate * (now_s - sighting.time_s) / area_m2.max(1e-3);
            Some(sighting.log_density(&place, now_s, &self.options.motion) - newcomers.ln())
        };
        let ended = self.lost.0.iter().enumerate().map(|(i, track)| (Lost::Ended(i), track));
        let outage_s = self.settling.outage_end_s().unwrap_or(f64::NEG_INFINITY);
        let is_missing = |track: &Track| {
            let seen_s = track.sighting.as_ref().map(|sighting| sighting.time_s);
            track.existence() < HARDLY_THERE || seen_s.is_some_and(|seen_s| seen_s < outage_s)
        };
        let missing = self.tracks.iter().enumerate().filter(|(_, track)| is_missing(track));
        let candidates = ended.chain(missing.map(|(i, track)| (Lost::Missing(i), track)));
        let best = candidates
            .filter_map(|(lost, track)| Some((gain(track)?, lost)))
            .max_by(|one, other| one.0.total_cmp(&other.0));
        best.filter(|(gain, _)| *gain > 0.0).map(|(_, lost)| lost)
    }
}
