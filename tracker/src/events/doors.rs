//! Doors: the zones in which people come into view and leave it, and the part of a way through them that no fix shows.
//!
//! A track begins some time after a person has come in, and ends some time before they have gone out, or with the last fix before
//! a gap. A person whose first fix is in a zone, or a second of walking from one that is behind them, has come through it. A person whose
//! last fix is in a zone, or a second of walking before one, has left through it unless they are seen again.

use nalgebra::{Point2, Vector2};
use scenes::room::{Zone, ZoneKind};

use super::EventOptions;
use super::fix::Fix;
use super::gap::FASTEST_M_S;

/// Longest time for which a person walks unseen to a zone, and from one border of it to the other, seconds.
const UNSEEN_S: f64 = 1.0;
/// Number of steps in which that time is searched for a zone's border.
const UNSEEN_STEPS: u32 = 20;
/// Speed below which a person waits or stands, metres a second: three standard deviations of a track's velocity. Chosen on synthetic
/// paths of seeds 101 to 120.
const STANDING_M_S: f64 = 0.5;

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
    /// Positions by time, between the fix and the zone's far border: where the person came in, or leaves. At least the fix itself.
    pub path: Vec<Fix>,
    /// One more step of the person, beyond that border: a line may lie on it.
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
        self.near(fix, options).min_by(|a, b| a.1.total_cmp(&b.1)).map(|(zone, _)| zone)
    }

    /// Whether people may leave the room where a track ended.
    pub(super) fn is_exit(&self, fix: &Fix, options: &EventOptions) -> bool {
        self.near(fix, options).any(|(zone, _)| zone.kind != ZoneKind::Entry)
    }

    /// Zones that a person at a fix may be in, with their distances, metres.
    fn near(&self, fix: &Fix, options: &EventOptions) -> impl Iterator<Item = (&Zone, f64)> {
        let reach_m = options.border_sigmas * fix.sigma_m.amax().hypot(options.path_sigma_m);
        let place = fix.place;
        let distances = self.zones.iter().map(move |zone| (zone, zone.polygon.distance_m(&place)));
        distances.filter(move |(_, distance_m)| *distance_m <= reach_m)
    }

    /// The unseen way of a person before or after a fix, at the fix's velocity, between two times, seconds. `None` where it does
    /// not lead to a zone that people use this way.
    pub(super) fn unseen_way(
        &self,
        part: UnseenPart,
        fix: &Fix,
        velocity: &Vector2<f64>,
        (from_s, to_s): (f64, f64),
    ) -> Option<UnseenWay> {
        let (sign, unused) = match part {
            UnseenPart::Arrival => (-1.0, ZoneKind::Exit),
            UnseenPart::Departure => (1.0, ZoneKind::Entry),
        };
        // The arrival time of a standing person is unknown; a speed above the fastest is an error of the track.
        let is_walking = (STANDING_M_S..=FASTEST_M_S).contains(&velocity.norm());
        let after = |step: u32| {
            let after_s = sign * UNSEEN_S * f64::from(step) / f64::from(UNSEEN_STEPS);
            let fix = Fix { time_s: fix.time_s + after_s, place: fix.place + velocity * after_s, ..*fix };
            (step == 0 || (is_walking && (from_s..=to_s).contains(&fix.time_s))).then_some(fix)
        };
        let usable = |place: &Point2<f64>| {
            self.zones.iter().find(|zone| zone.kind != unused && zone.polygon.contains(place))
        };
        let (zone, reached) =
            (0..=UNSEEN_STEPS).find_map(|step| usable(&after(step)?.place).map(|zone| (zone, step)))?;
        let is_within = |step: &u32| {
            let mut parts = self.zones.iter().filter(|other| other.name == zone.name);
            after(*step).is_some_and(|fix| parts.any(|part| part.polygon.contains(&fix.place)))
        };
        let border = (reached..=reached + UNSEEN_STEPS).rev().find(is_within)?;
        let mut path: Vec<Fix> = (0..=border).filter_map(after).collect();
        let beyond = after(border + 1).or(path.last().copied())?;
        if part == UnseenPart::Arrival {
            path.reverse();
        }
        Some(UnseenWay { zone: zone.name.clone(), path, beyond })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scenes::polygon::Polygon;

    fn zone(name: &str, x: f64, kind: ZoneKind) -> Zone {
        let polygon = Polygon::rectangle(Point2::new(x, -1.0), Point2::new(x + 0.6, 1.0));
        Zone { name: name.into(), polygon, kind }
    }

    fn fix(time_s: f64, x: f64) -> Fix {
        Fix { frame: 1, time_s, place: Point2::new(x, 0.0), sigma_m: Vector2::repeat(0.3) }
    }

    /// Zone, time and place at which the unseen way of a person ends or begins.
    fn end(
        zones: &[Zone],
        part: UnseenPart,
        x: f64,
        speed: f64,
        times: (f64, f64),
    ) -> Option<(String, f64, f64)> {
        let way = Doors::new(zones).unseen_way(part, &fix(10.0, x), &Vector2::new(speed, 0.0), times)?;
        let end = if part == UnseenPart::Arrival { way.path[0] } else { way.path[way.path.len() - 1] };
        let rounded = |value: f64| (value * 100.0).round() / 100.0;
        Some((way.zone, rounded(end.time_s), rounded(end.place.x)))
    }

    #[test]
    fn a_way_leads_to_the_far_border_of_a_zone_that_is_used_this_way() {
        use UnseenPart::{Arrival, Departure};
        let always = (0.0, 99.0);
        // A door from x = 0 to 1.2 of two parts; an entry and an exit drawn on the same place.
        let door = [zone("door", 0.0, ZoneKind::Both), zone("door", 0.6, ZoneKind::Both)];
        let pair = [zone("in", 0.0, ZoneKind::Entry), zone("out", 0.0, ZoneKind::Exit)];
        let found = |name: &str, time_s: f64, x: f64| Some((name.to_owned(), time_s, x));
        assert_eq!(end(&door, Departure, 1.72, -1.0, always), found("door", 11.55, 0.17));
        assert_eq!(end(&door, Arrival, 0.9, 1.0, always), found("door", 9.1, 0.0));
        assert_eq!(end(&pair, Departure, 0.9, -1.0, always), found("out", 10.9, 0.0));
        assert_eq!(end(&pair, Arrival, 0.9, 1.0, always), found("in", 9.1, 0.0));
        // Waiting in the door, and walking from it slowly.
        assert_eq!(end(&door, Arrival, 0.9, 0.4, always), found("door", 10.0, 0.9));
        assert_eq!(end(&door, Arrival, 0.3, 0.6, always), found("door", 9.5, 0.0));
        assert_eq!(end(&door, Departure, 1.3, -0.4, always), None);
        // Standing in the door; beside it; walking away; too far; faster than people.
        assert_eq!(end(&door, Departure, 0.5, 0.0, always), found("door", 10.0, 0.5));
        for (x, speed) in [(1.3, 0.0), (1.3, 1.0), (2.5, -1.0), (1.3, -8.0)] {
            assert_eq!(end(&door, Departure, x, speed, always), None, "{x} {speed}");
        }
        // Nothing happens before the run begins, or after it ends.
        assert_eq!(end(&door, Departure, 1.7, -1.0, (0.0, 10.3)), None);
        assert_eq!(end(&door, Arrival, 1.7, 1.0, (9.8, 99.0)), None);
        assert_eq!(end(&door, Arrival, 0.5, 1.0, (10.0, 99.0)), found("door", 10.0, 0.5));
    }
}
