//! Identity management: meetings mix the identity probabilities of bodies, and looks separate them again.
//!
//! Each body has a probability of carrying each identity (the identity belief matrix of J. Shin, L. J. Guibas and
//! F. Zhao, "A distributed algorithm for managing multi-target identities in wireless ad-hoc sensor networks", IPSN
//! 2003). A meeting of two bodies mixes their probabilities by the similarity of place and velocity; looks measured
//! after the meeting resolve them.

use super::ModernOptions;
use super::assignment::{Assignment, Pair};
use super::people::{People, bits};
use super::person::MOST_PEOPLE;

/// Weight of looks since the last meeting from which a body is compared with identities.
const ENOUGH_LOOKS: f64 = 3.0;
/// Time apart after which a meeting of two bodies ends, seconds.
const ANEW_S: f64 = 1.0;

/// Distance beyond which no bodies meet, whatever their covariances, metres.
const FARTHEST_M: f64 = 3.0;
/// Least probability of a swap at the greatest distance of a meeting, whatever the velocities.
const LEAST_CONFUSED: f64 = 0.005;
/// Increase of that probability from the greatest distance to distance 0.
const TURNED: f64 = 0.2;

/// Meeting of two bodies near each other.
#[derive(Debug, Clone, Copy)]
struct Meeting {
    /// Serial numbers of the bodies, the smaller first.
    bodies: (u32, u32),
    /// Probability that the bodies have been swapped so far.
    confused: f64,
    /// Time at which the bodies were last near each other, seconds.
    near_s: f64,
}

/// Current meetings.
#[derive(Debug, Clone, Default)]
pub(super) struct Meetings {
    list: Vec<Meeting>,
}

impl Meetings {
    /// Begins, continues and ends meetings, and mixes the identities of bodies that may have been swapped because their
    /// places and velocities are similar.
    pub(super) fn update(&mut self, people: &mut People, now_s: f64, options: &ModernOptions) {
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
                // Bhattacharyya bound of the error probability of discriminating two normal distributions.
                let bound = 0.5 * (-a.motion.distance(&b.motion) / (8.0 * options.confusion)).exp();
                // People turn where they meet, so that velocities discriminate less than their covariances say.
                let near = (1.0 - away.sqrt() / options.meet_m).max(0.0);
                let confused = bound.max(LEAST_CONFUSED + TURNED * near);
                let meeting = self.between(a.serial, b.serial);
                meeting.near_s = now_s;
                if confused < 1.2 * meeting.confused {
                    continue;
                }
                // The earlier mixing followed by a mixing by `new` equals one mixing by `confused`.
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

/// Gives each body its identity by the best permutation, if that is better than the current one by the margin, and
/// learns the looks of bodies whose identity is certain. `dt` is the time since the last call, seconds.
pub(super) fn decide(people: &mut People, assignment: &mut Assignment, dt: f64, options: &ModernOptions) {
    let mut is_known: u64 = 0;
    for (i, person) in people.iter_mut().enumerate() {
        if person.is_comparable() && person.evidence.weight >= ENOUGH_LOOKS {
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

/// Allows swaps of bodies whose looks contradict their identity although no meeting was observed: they may have met a
/// person who was not tracked at that time.
fn question_misfits(people: &mut People, is_known: u64, dt: f64, options: &ModernOptions) {
    /// Duration of a contradiction after which the new looks are learnt, seconds: the light may have changed.
    const CHANGED_S: f64 = 5.0;
    /// Distance up to which two bodies may have been swapped shortly before, metres.
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
                people.allow_swap(i, j);
            }
        }
    }
}

/// Exchanges identities along each cycle of the best permutation that gains more than the margin.
fn permute(people: &mut People, assignment: &mut Assignment, is_known: u64, options: &ModernOptions) {
    /// Maximum cost of a pair, nats: it stays below the cost of leaving a body unassigned.
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
        // A body without an assigned identity ends the walk and keeps its own.
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

/// Gain of log-likelihood that an exchange along a cycle needs, nats. It decreases with the time since the meeting: at
/// first looks may be of the other person.
fn margin(people: &People, cycle: &[(usize, usize)], options: &ModernOptions) -> f64 {
    /// Time apart after which half of the margin is enough, seconds.
    const HALF_S: f64 = 3.0;
    let apart_s = cycle.iter().map(|(body, _)| people[*body].apart_s).fold(f64::INFINITY, f64::min);
    options.margin_nats * (HALF_S / (HALF_S + apart_s)).max(0.25)
}

/// Resolves the identity of a body that is almost certain, and learns its looks.
fn learn(people: &mut People, index: usize) {
    /// Probability of another identity above which a body's identity is uncertain.
    const DOUBT: f64 = 2e-3;
    let evidence = people[index].evidence;
    if people[index].may_be == 1 << index || people.certainty(index) < 1.0 - DOUBT {
        return;
    }
    people.resolve(index);
    people[index].identity.learnt.merge(&evidence);
}

/// Mixes the identity of a recovered person with those of the other lost people who match.
pub(super) fn mix_with_lost(people: &mut People, index: usize, others: u64) {
    for other in bits(others) {
        people.mix(index, other, 0.25);
    }
}
