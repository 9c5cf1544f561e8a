//! Tracks that went over to a person who had been lost.
//!
//! In a crowd, somebody whom no camera shows for a second is lost; when boxes show them again, the track of a neighbour may take
//! them, and the neighbour is found as somebody new. No two tracks met there. The log probability ratio, by the places, of the
//! track having gone over at a moment is
//!
//! ```text
//! log p(a track goes over)  +  log p(place | the lost person's last place)  −  log p(place | the track's prediction)
//! ```

use std::collections::VecDeque;

use nalgebra::Vector2;

use super::super::smoother::{LaggedMoment, WINDOW_S};
use super::super::trace::Trace;
use crate::TrackId;

/// Log probability that a track goes over to somebody else in one moment, nats. Chosen on eight generated crowds of 15 people,
/// where −7 gave IDF1 57.2 and −12 gave 59.2; crowds of 10 did not tell them apart.
const GOES_OVER_NATS: f64 = -12.0;
/// Longest time for which a person was lost before, seconds.
const LOST_FOR_S: f64 = 5.0;
/// Largest distance from the lost person's last place, metres.
const FARTHEST_M: f64 = 2.0;

/// Step of a track that may have taken it to another person.
pub(super) struct Jump {
    /// Name of the track until then.
    pub(super) id: TrackId,
    /// Time (seconds) and place (metres) of the last moment with its own person.
    pub(super) time_s: f64,
    pub(super) left: Vector2<f64>,
    /// Log probability ratio by the places, nats.
    pub(super) nats: f64,
}

/// Steps by which tracks may have gone over to a person who was last measured at this time (seconds) and place (metres).
/// `returns_nats`: log density (1/m²) of the person's coming back at a place and time.
pub(super) fn jumps_to(
    moments: &VecDeque<LaggedMoment>,
    (lost_s, lost_at): (f64, &Vector2<f64>),
    returns_nats: &impl Fn(&Vector2<f64>, f64) -> f64,
) -> Vec<Jump> {
    let Some(now) = moments.back() else { return Vec::new() };
    // Exchanges of tracks that met are looked for until then.
    let until_s = now.time_s - WINDOW_S;
    let first = moments.partition_point(|moment| moment.time_s <= lost_s);
    let last_s = until_s.min(lost_s + LOST_FOR_S);
    let steps = (first.max(1)..moments.len()).take_while(|i| moments[*i].time_s <= last_s);
    let jump = |before: &LaggedMoment, now: &LaggedMoment, trace: &Trace| {
        let place = trace.motion.measured.as_ref()?.place;
        if (place - lost_at).norm() > FARTHEST_M {
            return None;
        }
        let earlier = before.people.iter().find(|earlier| earlier.key == trace.key)?;
        let id = trace.id.filter(|id| earlier.id == Some(*id))?;
        let nats = GOES_OVER_NATS + returns_nats(&place, now.time_s) - trace.motion.log_evidence;
        Some(Jump { id, time_s: before.time_s, left: earlier.motion.place(), nats })
    };
    steps
        .flat_map(|i| {
            let (before, now) = (&moments[i - 1], &moments[i]);
            now.people.iter().filter_map(move |trace| jump(before, now, trace))
        })
        .collect()
}
