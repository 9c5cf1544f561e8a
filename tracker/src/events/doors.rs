//! Doors: the zones in which people come into view and leave it, and the part of a way through them that no fix shows.
//!
//! A track begins some time after a person has come in, and ends some time before they have gone out, or with the last fix before
//! a gap. Whoever is first seen in a zone, or walking away from one that is near, has come through it; whoever is last seen in one, or
//! walking to one that is near, and does not come back, has left through it. At their velocity, the way there takes a second at most.

use nalgebra::Vector2;
use scenes::room::{Zone, ZoneKind};

use super::EventOptions;
use super::passing::Fix;

/// Longest time for which a person walks unseen to a zone, and from one border of it to the other, seconds.
const UNSEEN_S: f64 = 1.0;
/// Number of steps in which that time is searched for a zone's border, and beyond it.
const UNSEEN_STEPS: u32 = 20;
const STEPS_BEYOND: u32 = 1;
/// Speed below which a person stands, metres a second.
const STANDING_M_S: f64 = 0.2;

/// Part of a person's path that no fix shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum UnseenPart {
    /// Before the first fix.
    Arrival,
    /// After the last fix.
    Departure,
}

/// An unseen way through a zone.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct UnseenWay {
    /// Name of the zone.
    pub zone: String,
    /// Positions by time, between the fix and the zone's far border, both included: where the person came in, or leaves.
    pub path: Vec<Fix>,
    /// A step of the person beyond that border: a line may lie on it.
    pub beyond: Fix,
}

/// Zones of a room in which people come into view and leave it.
#[derive(Debug, Clone)]
pub(super) struct Doors {
    zones: Vec<Zone>,
}

impl Doors {
    pub(super) fn new(zones: &[Zone]) -> Self {
        Self { zones: zones.to_vec() }
    }

    /// Zone of a place at which a track begins or ends: the one around it, or one whose border is near.
    pub(super) fn at(&self, fix: &Fix, options: &EventOptions) -> Option<&Zone> {
        let distances = self.zones.iter().map(|zone| (zone, zone.polygon.distance_m(&fix.place)));
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
        let reach_m = options.border_sigmas * fix.sigma_m.amax().hypot(options.path_sigma_m);
        nearest.filter(|(_, distance_m)| *distance_m <= reach_m).map(|(zone, _)| zone)
    }

    /// Whether people may leave the room where a track ended.
    pub(super) fn is_exit(&self, fix: &Fix, options: &EventOptions) -> bool {
        self.at(fix, options).is_some_and(|zone| zone.kind != ZoneKind::Entry)
    }

    /// The unseen way of a person before or after a fix, at the fix's velocity. `None` away from zones that people use this way.
    /// Nothing happens before the run, or after `now_s`.
    pub(super) fn unseen_way(
        &self,
        part: UnseenPart,
        fix: &Fix,
        velocity: &Vector2<f64>,
        now_s: f64,
        options: &EventOptions,
    ) -> Option<UnseenWay> {
        let (sign, unused) = match part {
            UnseenPart::Arrival => (-1.0, ZoneKind::Exit),
            UnseenPart::Departure => (1.0, ZoneKind::Entry),
        };
        let is_standing = velocity.norm() < STANDING_M_S;
        let after = |step: u32| {
            let after_s = sign * UNSEEN_S * f64::from(step) / f64::from(UNSEEN_STEPS);
            let time_s = (fix.time_s + after_s).max(0.0).min(now_s);
            Fix { time_s, place: fix.place + velocity * after_s, ..*fix }
        };
        let (zone, reached) = match self.at(fix, options) {
            Some(zone) => (zone, 0),
            None if is_standing => return None,
            None => (1..=UNSEEN_STEPS).find_map(|step| {
                let place = after(step).place;
                self.zones.iter().find(|zone| zone.polygon.contains(&place)).map(|zone| (zone, step))
            })?,
        };
        if zone.kind == unused {
            return None;
        }
        // Nobody knows when somebody who stands has come.
        let is_within = |step: &u32| !is_standing && zone.polygon.contains(&after(*step).place);
        let border = (reached..=reached + UNSEEN_STEPS).rev().find(is_within).unwrap_or(0);
        let mut path: Vec<Fix> = (0..=border).map(after).collect();
        if part == UnseenPart::Arrival {
            path.reverse();
        }
        Some(UnseenWay { zone: zone.name.clone(), path, beyond: after(border + STEPS_BEYOND) })
    }
}
