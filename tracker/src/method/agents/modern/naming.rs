//! One id for one person at all stations.
//!
//! Each station gives its own ids, and may carry an id on with the wrong body. Where a peer measures for some time under
//! one id whom this station knows under another, one of the two gives way, and both find the same one:
//!
//! * the peer's id is nobody's here: the lower id, which is the older, stays; a station that only hears of a person goes
//!   by those who see the person;
//! * the peer's id is somebody else's here: whose looks fit better, and which of the two stations is surer; in doubt the
//!   station with the lower number is right.

use super::super::{StationId, TargetId};
use super::ModernOptions;
use super::existence;
use super::peer::{Claim, Peer};
use super::people::People;

/// What one station's word is worth at most, nats.
const WORD_NATS: f64 = 3.0;
/// Difference below which the station with the lower number is right, nats.
const DOUBT_NATS: f64 = 1.0;
/// Time after which somebody new gets the id that a peer gives, seconds.
const NEW_S: f64 = 0.3;
/// Time for which a claim counts after it was made, seconds.
const FRESH_S: f64 = 0.5;

/// A claim that has lasted, and whose it is.
struct Dispute {
    peer: StationId,
    claim: Claim,
}

/// Settles under which id people are known whom a peer knows under another. Returns the number of ids that changed.
pub(super) fn settle(
    people: &mut People,
    peers: &mut [Peer],
    own: StationId,
    now_s: f64,
    options: &ModernOptions,
) -> usize {
    for peer in peers.iter_mut().filter(|p| !p.claims.is_empty()) {
        peer.forget_old(now_s);
    }
    let disputes: Vec<Dispute> = peers
        .iter()
        .enumerate()
        .flat_map(|(index, peer)| peer.claims.iter().map(move |c| (index, *c)))
        .filter(|(_, c)| {
            c.theirs != c.mine && c.lasting_s >= options.naming_s.min(NEW_S) && now_s - c.made_s <= FRESH_S
        })
        .map(|(index, claim)| Dispute { peer: StationId(index as u8), claim })
        .collect();
    // Stations take their decisions at different times, so that two never give way to each other at once.
    let patience_s = options.naming_s * (1.0 + f64::from(own.0) / peers.len().max(1) as f64);
    let mut changed = 0;
    for Dispute { peer, claim } in disputes {
        let Some(here) = people.index_of(claim.mine) else { continue };
        let is_used_there = is_used(&peers[peer.0 as usize], &claim, now_s);
        let gives_way = match people.index_of(claim.theirs) {
            None => {
                // Ids just given have had no time to become somebody's.
                let is_new = people[here].age_s < 5.0;
                let enough_s = if is_new { options.naming_s.min(NEW_S) } else { options.naming_s };
                let gives_way = claim.theirs < claim.mine || is_only_heard(people, peers, here, now_s);
                gives_way && claim.lasting_s >= enough_s
                    || is_used_there
                        && claim.lasting_s >= patience_s
                        && is_outweighed(people, peers, own, &claim, 0.0, now_s)
            }
            Some(other) if people[other].is_lost(options.birth_s) => {
                claim.lasting_s >= options.naming_s
                    && (claim.theirs < claim.mine || is_used_there)
                    && people[here].log_likelihood(&people[other].identity)
                        - people[here].log_likelihood(&people[here].identity)
                        > -options.margin_nats
            }
            Some(other) => {
                let limit = 1.5 * options.margin_nats;
                let gain = people.gain(here, other).clamp(-limit, limit);
                let gives_way =
                    claim.lasting_s >= patience_s && is_outweighed(people, peers, own, &claim, gain, now_s);
                if claim.lasting_s >= patience_s {
                    restart(peers, &claim);
                }
                gives_way
            }
        };
        if gives_way {
            take_name(people, here, &claim, options);
            drop_claims(peers, &claim);
            changed += 1;
        }
    }
    changed
}

/// Gives the body that is known as `claim.mine` the id `claim.theirs`.
fn take_name(people: &mut People, here: usize, claim: &Claim, options: &ModernOptions) {
    match people.index_of(claim.theirs) {
        None => people[here].identity.target = claim.theirs,
        Some(other) if people[other].is_lost(options.birth_s) => {
            existence::take_over(people, here, other);
            people.remove(other);
        }
        // By looks both bodies are whom they were before: the stations named them differently, and nobody was mistaken.
        Some(other) if people.gain(here, other) < -DOUBT_NATS => people.exchange_targets(here, other),
        Some(other) => people.exchange(here, other),
    }
}

/// Whether nobody who sees a person gives it this station's id: neither the station itself nor a peer.
fn is_only_heard(people: &People, peers: &[Peer], here: usize, now_s: f64) -> bool {
    let mine = people[here].identity.target;
    people[here].unseen_s > 1.0
        && !peers.iter().flat_map(|p| &p.claims).any(|c| c.theirs == mine && now_s - c.made_s <= FRESH_S)
}

/// Whether the peer gives this station's id to somebody else.
fn is_used(peer: &Peer, claim: &Claim, now_s: f64) -> bool {
    peer.claims.iter().any(|c| c.theirs == claim.mine && c.mine != claim.mine && now_s - c.made_s <= FRESH_S)
}

/// Whether looks, and the stations that call a body as the peer does, outweigh this station's own word and that of the
/// stations that call the body as this one does; in doubt the station with the lower number is right, so that all come to
/// agree with the lowest. As every station counts the same words, two that disagree do not both give way.
fn is_outweighed(
    people: &People,
    peers: &[Peer],
    own: StationId,
    claim: &Claim,
    gain_nats: f64,
    now_s: f64,
) -> bool {
    let own_certainty = people.index_of(claim.mine).map_or(0.0, |i| people.certainty(i));
    let mut score = gain_nats - WORD_NATS * own_certainty;
    let (mut first_for, mut first_against) = (StationId(u8::MAX), own);
    for (index, peer) in peers.iter().enumerate() {
        let station = StationId(index as u8);
        let of_body = peer.claims.iter().filter(|c| c.mine == claim.mine && now_s - c.made_s <= FRESH_S);
        for c in of_body {
            if c.theirs == claim.theirs {
                score += WORD_NATS * c.confidence;
                first_for = first_for.min(station);
            } else if c.theirs == claim.mine {
                score -= WORD_NATS * c.confidence;
                first_against = first_against.min(station);
            }
        }
    }
    if score.abs() < DOUBT_NATS { first_for < first_against } else { score > 0.0 }
}

/// Lets a claim prove itself anew.
fn restart(peers: &mut [Peer], claim: &Claim) {
    for c in peers.iter_mut().flat_map(|p| &mut p.claims) {
        if c.theirs == claim.theirs && c.mine == claim.mine {
            c.lasting_s = c.lasting_s.min(0.35);
        }
    }
}

/// Drops the claims about two ids that have changed.
fn drop_claims(peers: &mut [Peer], claim: &Claim) {
    let is_about = |id: TargetId| id == claim.theirs || id == claim.mine;
    for peer in peers {
        peer.claims.retain(|c| !is_about(c.theirs) && !is_about(c.mine));
    }
}
