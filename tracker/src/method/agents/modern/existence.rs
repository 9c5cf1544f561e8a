//! Existence of people: births, duplicates, deaths, and people who are occluded from all stations.

use nalgebra::{Point2, Vector2};

use super::super::{FieldOfView, StationId, TargetId};
use super::ModernOptions;
use super::measurement::Measurement;
use super::nursery::Newcomer;
use super::people::People;
use super::person::{Identity, Person};

/// Visible fraction of a person from which a station should measure the person.
pub(super) const PLAINLY_VISIBLE: f64 = 0.6;
/// Visible fraction of a person below which no station measures the person.
const HIDDEN: f64 = 0.15;
/// Distance below which two bodies would overlap, metres.
const BODY_M: f64 = 0.5;
/// Distance below which a person may occlude another, metres.
const COVER_M: f64 = 1.0;
/// Time after which a duplicate that was set aside is removed, seconds: until then it may be behind the other person.
const SPARE_S: f64 = 3.0;
/// Time after which a person in view only of stations whose packets do not arrive is left to them, seconds.
const HANDED_OVER_S: f64 = 10.0;
/// Maximum walking speed of a lost person, m/s.
const WALK_M_S: f64 = 2.0;
/// Squared distance of looks above which a newcomer is not a lost person: three standard deviations.
const LOOKS_ALIKE: f64 = 9.0;

/// Set of people measured by one packet, or by the station's own sightings of a moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured {
    /// Station that measured.
    pub(super) by: StationId,
    /// Bits of the people's indices.
    pub(super) people: u64,
}

/// Sets aside one of two people at one place, the one with the worse fit of looks, when a station that sees both places
/// measures only one of them. `dt` is the time since the last call, seconds.
pub(super) fn set_twins_aside(
    people: &mut People,
    measured: &[Measured],
    fields: &dyn FieldOfView,
    dt: f64,
    options: &ModernOptions,
) {
    for i in 0..people.len() {
        let mut is_twin = false;
        for j in 0..people.len() {
            let (a, b) = (&people[i], &people[j]);
            if i == j
                || b.spare_s.is_some()
                || (a.motion.position - b.motion.position).norm() >= BODY_M
                || a.measured_with >> j & 1 == 1
            {
                continue;
            }
            let sees_one = |m: &Measured| {
                (m.people >> i ^ m.people >> j) & 1 == 1
                    && [a, b]
                        .iter()
                        .all(|p| fields.visible(m.by, p.motion.position, p.height_m) >= PLAINLY_VISIBLE)
            };
            if !measured.iter().any(sees_one) {
                continue;
            }
            is_twin = true;
            if a.twin_s > options.birth_s && b.twin_s > options.birth_s && is_worse(a, b) {
                people[i].spare_s = Some(0.0);
                break;
            }
        }
        let person = &mut people[i];
        person.twin_s = if is_twin { person.twin_s + dt } else { (person.twin_s - 2.0 * dt).max(0.0) };
        if let Some(spare_s) = &mut person.spare_s {
            *spare_s += dt;
        }
    }
}

/// Whether the looks of `a` fit its identity worse than those of `b` fit theirs; where they do not differ, whether `a`
/// is newer.
fn is_worse(a: &Person, b: &Person) -> bool {
    let fit = |p: &Person| {
        if p.is_learnt() && p.evidence.weight >= 1.0 {
            p.log_likelihood(&p.identity) / p.evidence.weight
        } else {
            0.0
        }
    };
    let (of_a, of_b) = (fit(a), fit(b));
    if (of_a - of_b).abs() > 0.1 { of_a < of_b } else { a.identity.target > b.identity.target }
}

/// Finds the lost person who matches a newcomer best. Returns the person's index and the set of the other matches.
pub(super) fn find_lost(
    people: &People,
    newcomer: &Newcomer,
    options: &ModernOptions,
) -> Option<(usize, u64)> {
    let mut alike: u64 = 0;
    let mut best: Option<(usize, f64)> = None;
    for (i, person) in people.iter().enumerate().filter(|(_, p)| p.is_lost(options.birth_s)) {
        let away_m = (newcomer.measurement.position - person.motion.position).norm();
        let reach_m =
            1.0 + WALK_M_S * person.missed_s.max(options.birth_s).min(5.0) + person.motion.sigma_m();
        if away_m > reach_m {
            continue;
        }
        let mut cost = (away_m / reach_m).powi(2);
        if person.is_learnt() && newcomer.looks.weight > 0.5 {
            let distance = -2.0
                * newcomer.looks.log_likelihood(&person.identity.learnt)
                * (1.0 / newcomer.looks.weight + 1.0 / person.identity.learnt.weight);
            if distance > LOOKS_ALIKE {
                continue;
            }
            cost += distance * newcomer.looks.weight.min(10.0);
        }
        alike |= 1 << i;
        if best.is_none_or(|b| cost < b.1) {
            best = Some((i, cost));
        }
    }
    best.map(|(i, _)| (i, alike & !(1 << i)))
}

/// Whether a measurement is outside the bodies of all people who are currently measured.
pub(super) fn is_apart(people: &People, measurement: &Measurement) -> bool {
    people.iter().all(|p| p.missed_s > 0.3 || (p.motion.position - measurement.position).norm() >= BODY_M)
}

/// Stations of the room, as far as this station receives their packets.
pub(super) struct Watch<'a> {
    /// Fields of view.
    pub(super) fields: &'a dyn FieldOfView,
    /// Stations that run and have a usable image, this one included.
    pub(super) watching: &'a [StationId],
    /// Number of stations of the room.
    pub(super) stations: u8,
}

/// Removes people who have gone, `dt` seconds after the last call. Moves missed people who may have stepped behind an
/// occluder towards the hidden places.
pub(super) fn remove_gone(people: &mut People, watch: &Watch, dt: f64, options: &ModernOptions) {
    for i in (0..people.len()).rev() {
        let person = &people[i];
        if person.missed_s < 0.3 {
            continue;
        }
        let is_covered = person.spare_s.is_none()
            && people.iter().enumerate().any(|(j, other)| {
                j != i
                    && other.missed_s < 0.3
                    && (other.motion.position - person.motion.position).norm() < COVER_M
            });
        let is_gone = match look_for(person, watch) {
            View::Plain => {
                let overdue_s = person.overdue_s + if is_covered { dt / 4.0 } else { dt };
                people[i].overdue_s = overdue_s;
                overdue_s >= options.death_s
            }
            View::Partly(hidden) => {
                let person = &mut people[i];
                let step = (hidden - person.motion.position) * (dt / 0.5).min(1.0);
                person.motion.position += step;
                person.overdue_s = (person.overdue_s - dt).max(0.0);
                person.missed_s >= options.carry_s
            }
            View::Hidden => {
                person.missed_s >= options.carry_s
                    || person.missed_s >= HANDED_OVER_S && is_seen_elsewhere(person, watch)
            }
        };
        if is_gone || people[i].spare_s.is_some_and(|s| s > SPARE_S) {
            if let Some(young) = find_young(people, i, person_gone_s(&people[i])) {
                take_over(people, young, i);
            }
            people.remove(i);
        }
    }
}

/// Time for which a person about to be removed may have been elsewhere, seconds.
fn person_gone_s(person: &Person) -> f64 {
    person.missed_s.max(person.spare_s.unwrap_or(0.0))
}

/// Finds the newer duplicate of a person whose body has followed no one, or another person, for `since_s` seconds: a
/// person born since then whose looks and place match.
fn find_young(people: &People, gone: usize, since_s: f64) -> Option<usize> {
    /// Delay until a body that follows another person is noticed, seconds.
    const NOTING_S: f64 = 4.0;
    let old = &people[gone];
    if !old.is_learnt() {
        return None;
    }
    let is_young = |p: &Person| {
        p.age_s < (since_s + NOTING_S).min(old.age_s)
            && p.identity.target > old.identity.target
            && p.missed_s < 0.3
            && p.is_learnt()
            && (p.motion.position - old.motion.position).norm() <= 2.0 * WALK_M_S * (p.age_s + 2.0)
    };
    let likely = people.iter().enumerate().filter(|(i, p)| *i != gone && is_young(p));
    likely
        .map(|(i, p)| (i, p.identity.learnt.mean_distance(&old.identity.learnt)))
        .filter(|(_, distance)| *distance <= LOOKS_ALIKE / 2.0)
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| i)
}

/// Returns the id of each body whose looks contradict it to the newer duplicate whose looks match, by exchanging the
/// two identities.
pub(super) fn reclaim(people: &mut People) {
    for i in 0..people.len() {
        if people[i].misfit_s > 0.0
            && let Some(young) = find_young(people, i, people[i].misfit_s)
        {
            people.exchange(i, young);
            people.resolve(i);
            people.resolve(young);
            people[i].identity.learnt = people[i].evidence;
            people[i].misfit_s = 0.0;
        }
    }
}

/// Transfers id, looks and age from a person to be removed to a duplicate of the same person.
pub(super) fn take_over(people: &mut People, person: usize, gone: usize) {
    let mut learnt = people[gone].identity.learnt;
    learnt.merge(&people[person].identity.learnt);
    let target = people[gone].identity.target;
    // Ids stay unique until the other is removed.
    people[gone].identity.target = people[person].identity.target;
    people[person].identity = Identity { target, learnt };
    people[person].age_s = people[gone].age_s;
}

/// Visibility of a missed person over the places where the person may be.
enum View {
    /// Hidden at none of the places, or at an exit.
    Plain,
    /// Plainly visible at the predicted place and hidden at others; the mean of the hidden places, metres.
    Partly(Point2<f64>),
    /// Not plainly visible at the predicted place.
    Hidden,
}

fn look_for(person: &Person, watch: &Watch) -> View {
    let spread_m = person.motion.sigma_m().clamp(0.3, 1.0);
    let centre = person.motion.position;
    let around = [Vector2::x(), -Vector2::x(), Vector2::y(), -Vector2::y()];
    let best_at = |place: Point2<f64>| {
        let mut best = 0.0f64;
        for station in watch.watching {
            best = best.max(watch.fields.visible(*station, place, person.height_m));
            if best >= PLAINLY_VISIBLE {
                break;
            }
        }
        best
    };
    if watch.fields.may_leave(centre) {
        return View::Plain;
    }
    let at_centre = best_at(centre);
    if at_centre < PLAINLY_VISIBLE {
        return View::Hidden;
    }
    let mut hidden = Vector2::zeros();
    let mut count = 0.0;
    for direction in around {
        let place = centre + direction * spread_m;
        if best_at(place) < HIDDEN {
            hidden += place.coords;
            count += 1.0;
        }
    }
    if count > 0.0 { View::Partly(Point2::from(hidden / count)) } else { View::Plain }
}

/// Whether a station whose packets do not arrive sees the person's place.
fn is_seen_elsewhere(person: &Person, watch: &Watch) -> bool {
    (0..watch.stations).map(StationId).any(|station| {
        !watch.watching.contains(&station)
            && watch.fields.visible(station, person.motion.position, person.height_m) >= PLAINLY_VISIBLE
    })
}

/// Returns the next unused id of this station: ids of different stations differ modulo the number of stations.
pub(super) fn mint(greatest: TargetId, station: StationId, stations: u8, people: &People) -> TargetId {
    let (station, stations) = (u32::from(station.0), u32::from(stations.max(1)));
    let first = |above: u32| above.saturating_sub(station).div_ceil(stations) * stations + station + 1;
    let mut id = first(greatest.0);
    if id > super::measurement::LARGEST_TARGET {
        // All ids have been used: reuse the first that no person carries.
        id = first(0);
        while people.index_of(TargetId(id)).is_some() {
            id += stations;
        }
    }
    TargetId(id)
}

/// Calls `ask` for each person whom others measure and this station should measure, and does not.
pub(super) fn find_restarts(
    people: &mut People,
    fields: &dyn FieldOfView,
    station: StationId,
    mut ask: impl FnMut(&Person),
) {
    /// Time without a measurement after which image tracking is asked, and interval between requests, seconds.
    const ASK_S: f64 = 0.5;
    for person in people.iter_mut() {
        let is_missing = person.unheard_s < ASK_S
            && person.unseen_s >= ASK_S
            && person.asked_s >= ASK_S
            && person.spare_s.is_none()
            && !person.is_crowded;
        if is_missing {
            person.asked_s = 0.0;
            if fields.visible(station, person.motion.position, person.height_m) >= PLAINLY_VISIBLE {
                ask(person);
            }
        }
    }
}
