//! Who is who: by the looks since people met.

use super::ModernOptions;
use super::assignment::{Assignment, Pair};
use super::people::{People, bits};
use super::person::LEARNT;
use super::signature::MeanLook;

/// Weight of looks since a meeting from which a body is compared with identities.
const ENOUGH_LOOKS: f64 = 5.0;

/// Notes who is so near whom that they may be mistaken for each other, and forgets the looks of those from before.
pub(super) fn note_meetings(people: &mut People, meet_m: f64) {
    for i in 0..people.len() {
        for j in 0..i {
            let distance = (people[i].motion.position - people[j].motion.position).norm();
            if distance >= meet_m {
                continue;
            }
            // Whoever may be either of two may be whomever these may be.
            let all = people[i].met | people[j].met | 1 << i | 1 << j;
            for k in [i, j] {
                people[k].met = all & !(1 << k);
                people[k].evidence = MeanLook::none();
            }
            for k in bits(all) {
                people[k].met |= all & !(1 << k);
            }
        }
    }
}

/// Gives each body the identity that the looks since the last crossing fit best, where the difference is large enough;
/// and where it is large enough in favour of what is, the matter is closed and the looks are learnt.
pub(super) fn decide(people: &mut People, assignment: &mut Assignment, options: &ModernOptions) {
    let mut is_open: u64 = 0;
    for (i, person) in people.iter().enumerate() {
        if person.met != 0 && person.is_learnt() && person.evidence.weight >= ENOUGH_LOOKS {
            is_open |= 1 << i;
        }
    }
    if is_open != 0 && is_suspicious(people, is_open, options) {
        permute(people, assignment, is_open, options);
    }
    close(people, is_open, options);
}

/// Whether any body fits another identity so much better that a permutation may be.
fn is_suspicious(people: &People, is_open: u64, options: &ModernOptions) -> bool {
    bits(is_open).any(|i| {
        let own = people[i].log_likelihood(&people[i].identity);
        bits(people[i].met & is_open)
            .any(|j| people[i].log_likelihood(&people[j].identity) - own > options.margin_nats / 2.0)
    })
}

/// Exchanges identities where the best permutation is better than what is by the margin.
fn permute(people: &mut People, assignment: &mut Assignment, is_open: u64, options: &ModernOptions) {
    /// Log-likelihood below the best at which looks do not count further: costs stay below those of no assignment.
    const LARGEST: f64 = 100.0;
    let mut pairs = Vec::new();
    for i in bits(is_open) {
        let may_be = people[i].met & is_open | 1 << i;
        let fits: Vec<(usize, f64)> =
            bits(may_be).map(|j| (j, people[i].log_likelihood(&people[j].identity))).collect();
        let best = fits.iter().map(|f| f.1).fold(f64::NEG_INFINITY, f64::max);
        pairs.extend(fits.iter().map(|(j, fit)| Pair {
            row: i,
            column: *j,
            cost: (best - fit).min(LARGEST),
        }));
    }
    let cost_now: f64 = pairs.iter().filter(|p| p.row == p.column).map(|p| p.cost).sum();
    let n = people.len();
    let chosen = assignment.solve(&pairs, n, n);
    let cost: f64 = chosen.iter().map(|p| p.cost).sum();
    if chosen.len() != is_open.count_ones() as usize || cost_now - cost <= options.margin_nats {
        return;
    }
    let before: Vec<_> = people.iter().map(|p| p.identity).collect();
    for pair in chosen {
        people[pair.row].identity = before[pair.column];
    }
}

/// Closes the question between two who met where looks tell them apart, or where they will never tell.
fn close(people: &mut People, is_open: u64, options: &ModernOptions) {
    for i in 0..people.len() {
        if people[i].met == 0 {
            continue;
        }
        for j in bits(people[i].met) {
            let are_open = is_open >> i & is_open >> j & 1 == 1;
            let is_told = are_open && people.gain(i, j) < -options.margin_nats;
            // Somebody who met others before anybody learnt their looks: these are their looks from now on.
            let is_unknown = (!people[i].is_learnt() || !people[j].is_learnt())
                && people[i].evidence.weight >= LEARNT
                && people[j].evidence.weight >= LEARNT;
            if is_told || is_unknown {
                people[i].met &= !(1 << j);
                people[j].met &= !(1 << i);
            }
        }
        if people[i].met == 0 {
            let evidence = people[i].evidence;
            people[i].identity.learnt.merge(&evidence);
        }
    }
}
