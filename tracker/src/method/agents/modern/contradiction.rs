//! Correction of image tracks that contradict other stations.
//!
//! # One person at two distances
//! A camera measures the direction of a person well and the range badly, above all where feet are hidden. This station
//! then tracks a person whom no other station measures, though some should, and misses a person whom others measure in
//! the same direction. The image track is moved to the place of the other stations' measurements; in the next frames it
//! measures there or is lost.
//!
//! # A person who has left
//! The image track of a person who leaves beside others may switch to one of them. No other station measures such a
//! person, who was on the way out when last measured apart from others.

use nalgebra::Matrix2;

use super::super::{FieldOfView, StationId};
use super::existence::PLAINLY_VISIBLE;
use super::measurement::Measurement;
use super::people::People;
use super::person::Person;

/// Time without another station's measurement after which only this station has a person, seconds.
const ALONE_S: f64 = 0.6;
/// Time without an own measurement after which this station misses a person, seconds.
const UNSEEN_S: f64 = 0.4;
/// Age up to which other stations' measurements are current, seconds.
const FRESH_S: f64 = 0.3;
/// Distance across the line of sight below which two people are in one direction, metres.
const ACROSS_M: f64 = 0.4;
/// Maximum range error of one camera, metres.
const FARTHEST_M: f64 = 3.0;
/// Duration of a contradiction after which an image track moves, seconds: for the newer of the two ids, and for the
/// older. They differ so that two stations never move their tracks to each other's place at once.
const GIVES_WAY_S: [f64; 2] = [0.3, 1.2];
/// Time for which only this station measures a leaving person, near others, until the person has left, seconds.
const HAS_LEFT_S: f64 = 0.15;
/// Squared distance of looks above which two people are different: three standard deviations.
const LOOKS_ALIKE: f64 = 9.0;

/// Measurements and fields of view of one station at one moment.
pub(super) struct Moment<'a> {
    /// The station's own measurements, each with the index of the associated person.
    pub(super) seen: &'a [(Measurement, Option<usize>)],
    /// Fields of view.
    pub(super) fields: &'a dyn FieldOfView,
    /// This station.
    pub(super) own: StationId,
    /// Stations that run and have a usable image.
    pub(super) watching: &'a [StationId],
}

/// Moves contradicted image tracks to the place of other stations' measurements and removes people who have left, `dt`
/// seconds after the last call. Returns the image tracks of the people removed because they have left.
pub(super) fn settle(people: &mut People, moment: &Moment, dt: f64) -> Vec<u32> {
    let (mut elsewhere, mut left) = (Vec::new(), Vec::new());
    for (measurement, of) in moment.seen {
        let Some(alone) = *of else { continue };
        let has_left = may_have_left(&mut people[alone], measurement, moment.fields);
        let other = find_other(people, alone, measurement, moment);
        let target = people[alone].identity.target;
        let person = &mut people[alone];
        person.contradicted_s = if has_left || other.is_some() { person.contradicted_s + dt } else { 0.0 };
        let lasting_s = person.contradicted_s;
        if let Some(other) = other.map(|i| people[i].identity.target) {
            if lasting_s >= GIVES_WAY_S[usize::from(target < other)] {
                elsewhere.push((target, other, measurement.track));
            }
        } else if has_left && lasting_s >= HAS_LEFT_S {
            left.push((target, measurement.track));
        }
    }
    for (alone, other, track) in elsewhere {
        if let (Some(alone), Some(other)) = (people.index_of(alone), people.index_of(other)) {
            people.follow(other, track);
            people.remove(alone);
        }
    }
    for (target, _) in &left {
        if let Some(index) = people.index_of(*target) {
            people.remove(index);
        }
    }
    left.into_iter().map(|(_, track)| track).collect()
}

/// Whether a person who was on the way out is measured only by this station, and only near others.
fn may_have_left(person: &mut Person, measurement: &Measurement, fields: &dyn FieldOfView) -> bool {
    if !measurement.is_crowded {
        let is_leaving = fields.may_leave(measurement.position);
        person.was_inside |= !is_leaving;
        person.was_leaving = is_leaving && person.was_inside;
        return false;
    }
    person.was_leaving && person.unheard_s >= ALONE_S
}

/// Nearest person whom others measure and this station misses, in the direction of a measurement of a person whom only
/// this station measures; `None` if there is no such person.
fn find_other(people: &People, alone: usize, measurement: &Measurement, moment: &Moment) -> Option<usize> {
    let Moment { fields, own, watching, .. } = *moment;
    let person = &people[alone];
    let should_see = |station: StationId, of: usize| {
        let p = &people[of];
        fields.visible(station, p.motion.position, p.height_m) >= PLAINLY_VISIBLE
    };
    if person.unheard_s < ALONE_S || !watching.iter().any(|s| *s != own && should_see(*s, alone)) {
        return None;
    }
    let across = short_axis(&measurement.covariance);
    let candidates = people.iter().enumerate().filter(|(i, p)| {
        let offset = p.motion.position - measurement.position;
        *i != alone
            && p.unheard_s < FRESH_S
            && p.unseen_s >= UNSEEN_S
            && p.spare_s.is_none()
            && offset.norm() < FARTHEST_M
            && across.dot(&offset).abs() < ACROSS_M
            && should_see(own, *i)
            && !(p.is_learnt()
                && person.is_learnt()
                && p.identity.learnt.mean_distance(&person.identity.learnt) > LOOKS_ALIKE)
    });
    let away = |i: usize| (people[i].motion.position - measurement.position).norm();
    candidates.map(|(i, _)| i).min_by(|a, b| away(*a).total_cmp(&away(*b)))
}

/// Unit vector across the line of sight: the minor axis of a covariance.
fn short_axis(covariance: &Matrix2<f64>) -> nalgebra::Vector2<f64> {
    let eigen = covariance.symmetric_eigen();
    let shorter = eigen.eigenvalues.imin();
    eigen.eigenvectors.column(shorter).into()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point2, Vector2};

    use super::super::super::test_views::Views;
    use super::super::super::{AgentId, Packet, Report, Rule, Sighting, Sightings, TargetId};
    use super::super::{Modern, ModernOptions};
    use super::*;

    /// Runs station 0, which looks along x and measures a person 2 m too far, beyond the gate, with reports of station
    /// 1, which looks along y and measures the right place. Returns the targets of station 0 after 3 s, and the x,
    /// metres, of its image track.
    fn follow(views: Views) -> (Vec<TargetId>, Option<f64>) {
        let options = ModernOptions { listen_s: 0.0, ..ModernOptions::default() };
        let mut station = Modern::new(StationId(0), 2, Arc::new(views), options);
        let covariance = |along_x_m: f64, along_y_m: f64| {
            Matrix2::from_diagonal(&Vector2::new(along_x_m.powi(2), along_y_m.powi(2)))
        };
        for frame in 0..36_u32 {
            let time_s = f64::from(frame) / 12.0;
            let sighting = Sighting {
                track: 1,
                position: Point2::new(5.0, 2.0),
                covariance: covariance(0.3, 0.05),
                height_m: 1.7,
                looks: None,
                is_crowded: false,
            };
            let report = Report {
                agent: AgentId { station: StationId(1), number: 1 },
                target: TargetId(2),
                position: Point2::new(3.0, 2.0),
                covariance: covariance(0.05, 0.3),
                velocity: Vector2::zeros(),
                height_m: 1.7,
                looks: None,
                confidence: 1.0,
                is_crowded: false,
            };
            let received = Packet {
                station: StationId(1),
                life: 1,
                sequence: frame + 1,
                time_s: time_s - 0.05,
                greatest: TargetId(2),
                reports: vec![report],
                ..Packet::default()
            };
            // Image tracking measures at the place to which its track was moved.
            let tracked = station.followed().into_iter().flatten().find(|f| f.track == 1);
            let position = tracked.map_or(sighting.position, |f| {
                if (f.mean.x - 3.0).abs() < 0.3 { Point2::new(3.0, 2.0) } else { sighting.position }
            });
            let people = vec![Sighting { position, ..sighting }];
            station.step(&Sightings { time_s, people, is_usable: true }, &[received]);
        }
        let tracked = station.followed().into_iter().flatten().find(|f| f.track == 1);
        (station.people().iter().map(|p| p.target).collect(), tracked.map(|f| f.mean.x))
    }

    #[test]
    fn a_track_at_too_large_a_range_moves_to_the_other_stations_place() {
        let (targets, x_m) = follow(Views::OPEN);
        assert_eq!(targets, [TargetId(2)]);
        assert!((x_m.unwrap() - 3.0).abs() < 0.1, "{x_m:?}");
    }

    #[test]
    fn a_track_out_of_view_of_other_stations_is_not_moved() {
        let (targets, x_m) =
            follow(Views(|station, place| if station == 1 && place.x > 4.0 { 0.0 } else { 1.0 }));
        assert_eq!(targets.len(), 2);
        assert!((x_m.unwrap() - 5.0).abs() < 0.1, "{x_m:?}");
    }
}
