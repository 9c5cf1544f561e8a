//! Who is who: what meetings confuse, and looks tell apart.
//!
//! Each body has a probability of being each person (the identity belief matrix of J. Shin, L. J. Guibas and F. Zhao,
//! "A distributed algorithm for managing multi-target identities in wireless ad-hoc sensor networks", IPSN 2003). Two
//! bodies who meet mix theirs by how alike place and velocity become; the looks after the meeting part them again.

use super::ModernOptions;
use super::assignment::{Assignment, Pair};
use super::people::{People, bits};
use super::person::MOST_PEOPLE;

/// Weight of looks since a meeting from which a body is compared with identities.
const ENOUGH_LOOKS: f64 = 3.0;
/// Time after which two people who meet again do so anew, seconds.
const ANEW_S: f64 = 1.0;

/// Distance beyond which nobody meets, however little is known of where they are, metres.
const FARTHEST_M: f64 = 3.0;
/// Probability of being mistaken for somebody at the greatest distance of a meeting, however different the ways; and what
/// comes to it at no distance.
const LEAST_CONFUSED: f64 = 0.005;
const TURNED: f64 = 0.2;

/// Two bodies that are near each other.
#[derive(Debug, Clone, Copy)]
struct Meeting {
    /// Serial numbers of the bodies, the smaller first.
    bodies: (u32, u32),
    /// Probability that they were mistaken for each other so far.
    confused: f64,
    near_s: f64,
}

/// Meetings that go on.
#[derive(Debug, Clone, Default)]
pub(super) struct Meetings {
    list: Vec<Meeting>,
}

impl Meetings {
    /// Mixes up those who are so alike in place and velocity that they may be mistaken for each other.
    pub(super) fn note(&mut self, people: &mut People, now_s: f64, options: &ModernOptions) {
        for i in 0..people.len() {
            for j in 0..i {
                let (a, b) = (&people[i], &people[j]);
                let away = (a.motion.position - b.motion.position).norm_squared();
                if away >= FARTHEST_M * FARTHEST_M {
                    continue;
                }
                let unsure_m: f64 =
                    [a, b].iter().filter(|p| p.missed_s > 0.0).map(|p| p.motion.sigma_m()).sum();
                if away >= (options.meet_m + unsure_m).powi(2) {
                    continue;
                }
                // The Bhattacharyya bound of the error of telling two normal distributions apart.
                let bound = 0.5 * (-a.motion.distance(&b.motion) / (8.0 * options.confusion)).exp();
                // People turn where they meet, so that the ways that they come and go tell less than the filters know.
                let near = (1.0 - away.sqrt() / options.meet_m).max(0.0);
                let confused = bound.max(LEAST_CONFUSED + TURNED * near);
                let meeting = self.between(a.serial, b.serial);
                meeting.near_s = now_s;
                if confused < 1.2 * meeting.confused {
                    continue;
                }
                // Mixing by what is new and by what was before makes one mixing by `confused`.
                let new = (confused - meeting.confused) / (1.0 - 2.0 * meeting.confused).max(1e-3);
                meeting.confused = confused;
                people.mix(i, j, new.clamp(0.0, 0.5));
            }
        }
        self.list.retain(|m| now_s - m.near_s < ANEW_S);
    }

    fn between(&mut self, a: u32, b: u32) -> &mut Meeting {
        let bodies = (a.min(b), a.max(b));
        let index = self.list.iter().position(|m| m.bodies == bodies).unwrap_or_else(|| {
            self.list.push(Meeting { bodies, confused: 0.0, near_s: 0.0 });
            self.list.len() - 1
        });
        &mut self.list[index]
    }
}

/// Gives each body the identity of the best permutation, where it is better than what is by the margin; and where there
/// is no doubt about a body, its looks are learnt.
pub(super) fn decide(people: &mut People, assignment: &mut Assignment, dt: f64, options: &ModernOptions) {
    let mut is_known: u64 = 0;
    for (i, person) in people.iter_mut().enumerate() {
        if person.is_learnt() && person.evidence.weight >= ENOUGH_LOOKS {
            is_known |= 1 << i;
        }
    }
    question_misfits(people, is_known, dt, options);
    let is_suspicious = bits(is_known).any(|i| {
        let own = people.log_fit(i, i);
        let others = people[i].may_be & is_known & !(1 << i);
        bits(others).any(|j| people.log_fit(i, j) - own > options.margin_nats / 4.0)
    });
    if is_suspicious {
        permute(people, assignment, is_known, options);
    }
    for i in 0..people.len() {
        learn(people, i);
    }
}

/// Puts bodies in question whose looks are not those of their identity though they met nobody: what they may have met is
/// somebody whom nobody followed at that time.
fn question_misfits(people: &mut People, is_known: u64, dt: f64, options: &ModernOptions) {
    /// Time after which somebody who is nobody else has changed looks, as by other light, seconds.
    const CHANGED_S: f64 = 5.0;
    /// Distance up to which two bodies may have been mistaken for each other a little while ago, metres.
    const NEAR_M: f64 = 4.0;
    for i in 0..people.len() {
        let own = people[i].log_likelihood(&people[i].identity);
        if is_known >> i & 1 == 0 || own >= -options.margin_nats {
            people[i].misfit_s = 0.0;
            continue;
        }
        people[i].misfit_s += dt;
        if people[i].misfit_s > CHANGED_S {
            people[i].identity.learnt = people[i].evidence;
            continue;
        }
        for j in bits(is_known & !people[i].may_be) {
            let away_m = (people[i].motion.position - people[j].motion.position).norm();
            if away_m < NEAR_M && people[i].log_likelihood(&people[j].identity) - own > options.margin_nats {
                people.suspect(i, j);
            }
        }
    }
}

/// Exchanges identities along each cycle of the best permutation that is better than what is by the margin.
fn permute(people: &mut People, assignment: &mut Assignment, is_known: u64, options: &ModernOptions) {
    /// Log-likelihood below the best at which nothing counts further: costs stay below those of no assignment.
    const LARGEST: f64 = 100.0;
    let mut pairs = Vec::new();
    for i in bits(is_known) {
        let fits: Vec<(usize, f64)> =
            bits(people[i].may_be & is_known).map(|j| (j, people.log_fit(i, j))).collect();
        let best = fits.iter().map(|f| f.1).fold(f64::NEG_INFINITY, f64::max);
        pairs.extend(fits.iter().map(|(j, fit)| Pair {
            row: i,
            column: *j,
            cost: (best - fit).min(LARGEST),
        }));
    }
    let mut gets = [usize::MAX; MOST_PEOPLE];
    for pair in assignment.solve(&pairs, people.len(), people.len()) {
        gets[pair.row] = pair.column;
    }
    let mut left = is_known;
    while left != 0 {
        let first = left.trailing_zeros() as usize;
        let (mut cycle, mut gain, mut body) = (Vec::new(), 0.0, first);
        // A body that gets nobody's identity ends the walk: its identity stays where it is.
        while body < people.len() && left >> body & 1 == 1 {
            left &= !(1 << body);
            let from = gets[body];
            if from < people.len() {
                gain += people.log_fit(body, from) - people.log_fit(body, body);
                cycle.push((body, from));
            }
            body = from;
        }
        if body == first && cycle.len() > 1 && gain > margin(people, &cycle, options) {
            people.permute(&cycle);
        }
    }
}

/// What a cycle of identities has to gain, nats. At first it is much, as looks from near a meeting may be of the other;
/// later there is no more to wait for.
fn margin(people: &People, cycle: &[(usize, usize)], options: &ModernOptions) -> f64 {
    /// Time for which bodies have to be apart until half of the margin does, seconds.
    const HALF_S: f64 = 3.0;
    let apart_s = cycle.iter().map(|(body, _)| people[*body].apart_s).fold(f64::INFINITY, f64::min);
    options.margin_nats * (HALF_S / (HALF_S + apart_s)).max(0.25)
}

/// Ends the doubt about a body where there is next to none left, and learns its looks.
fn learn(people: &mut People, index: usize) {
    /// Probability of being somebody else from which there is doubt.
    const DOUBT: f64 = 2e-3;
    let evidence = people[index].evidence;
    if people[index].may_be == 1 << index || people.certainty(index) < 1.0 - DOUBT {
        return;
    }
    people.be_sure(index);
    people[index].identity.learnt.merge(&evidence);
}

/// Notes that somebody found again may as well be others who were lost.
pub(super) fn put_in_question(people: &mut People, index: usize, others: u64) {
    for other in bits(others) {
        people.mix(index, other, 0.25);
    }
}
