//! Estimates reported for the confirmed tracks.

use super::Mcmc;
use super::trace::Trace;
use super::track::Track;
use crate::PersonEstimate;
use crate::silhouette::Body;
use crate::silhouette::visibility::visible_fractions;

impl Mcmc {
    /// Snapshots of all tracks, confirmed or not.
    pub(super) fn traces(&self) -> Vec<Trace> {
        let bodies: Vec<Body> = self.tracks.iter().map(Track::body).collect();
        let visible = visible_fractions(&self.views, &bodies);
        let trace = |(track, visible): (&Track, Vec<f64>)| Trace {
            key: track.key,
            id: track.id.filter(|_| !track.is_doubted),
            motion: track.motion.clone(),
            radius_m: track.postures.size().radius.mean_m,
            height_m: track.postures.size().height.mean_m,
            confidence: track.presence(),
            visible,
            shown: track.shown.clone(),
            learnt: track.learnt.clone(),
        };
        self.tracks.iter().zip(visible).map(trace).collect()
    }

    /// Estimates of the confirmed tracks at their own time.
    pub(super) fn confirmed(&self, traces: &[Trace]) -> Vec<PersonEstimate> {
        let estimates =
            traces.iter().filter_map(|trace| Some(trace.estimate(trace.id?, &trace.motion.belief)));
        self.inside_room(estimates.collect())
    }

    /// Keeps the estimates inside the room, sorted by id. A person on a doorstep is in the room with a probability
    /// below 1, by which the confidence is multiplied.
    pub(super) fn inside_room(&self, mut people: Vec<PersonEstimate>) -> Vec<PersonEstimate> {
        people.retain(|person| self.stage.floor.is_inside(person.x_m, person.y_m));
        for person in &mut people {
            person.confidence *= self.stage.floor.share_inside(person.x_m, person.y_m, person.sigma_m);
        }
        people.sort_by_key(|person| person.id);
        people
    }
}
