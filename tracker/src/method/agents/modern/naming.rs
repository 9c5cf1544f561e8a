//! One id for one person at all stations.
//!
//! Each station assigns its own ids, and an id may follow the wrong body. When a peer reports a person for some time
//! under another id than this station's, one of the two ids gives way, and both stations come to the same decision:
//!
//! * no person here carries the peer's id: the lower id, which is the older, stays; a station that does not measure the
//!   person itself adopts the id of those that do;
//! * another person here carries the peer's id: the looks and the stations' confidences decide; in doubt the station
//!   with the lower number is right.

use super::super::{StationId, TargetId};
use super::ModernOptions;
use super::existence;
use super::peer::{Claim, Peer};
use super::people::People;

/// Maximum weight of one station's id, nats.
const WORD_NATS: f64 = 3.0;
/// Score below which the station with the lower number is right, nats.
const DOUBT_NATS: f64 = 1.0;
/// Time after which a new person gets a peer's id, seconds.
const NEW_S: f64 = 0.3;
/// Time for which a claim is valid after it was last made, seconds.
const FRESH_S: f64 = 0.5;

/// Persistent claim of a peer that differs from this station's id.
struct Dispute {
    peer: StationId,
    claim: Claim,
}

/// Resolves different ids of this station and its peers for one person. Returns the number of ids that changed.
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
    // Stations decide at different times, so that two never give way to each other at once.
    let patience_s = options.naming_s * (1.0 + f64::from(own.0) / peers.len().max(1) as f64);
    let mut changed = 0;
    for Dispute { peer, claim } in disputes {
        let Some(here) = people.index_of(claim.mine) else { continue };
        let is_used_there = is_used(&peers[peer.0 as usize], &claim, now_s);
        let gives_way = match people.index_of(claim.theirs) {
            None => {
                // A new id is not established yet, so it changes sooner.
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
            adopt_id(people, here, &claim, options);
            drop_claims(peers, &claim);
            changed += 1;
        }
    }
    changed
}

/// Changes the id of a body from `claim.mine` to `claim.theirs`.
fn adopt_id(people: &mut People, here: usize, claim: &Claim, options: &ModernOptions) {
    match people.index_of(claim.theirs) {
        None => people[here].identity.target = claim.theirs,
        Some(other) if people[other].is_lost(options.birth_s) => {
            existence::take_over(people, here, other);
            people.remove(other);
        }
        Some(other) => people.exchange(here, other),
    }
}

/// Whether no station that measures a person uses this station's id: neither this station nor a peer.
fn is_only_heard(people: &People, peers: &[Peer], here: usize, now_s: f64) -> bool {
    let mine = people[here].identity.target;
    people[here].unseen_s > 1.0
        && !peers.iter().flat_map(|p| &p.claims).any(|c| c.theirs == mine && now_s - c.made_s <= FRESH_S)
}

/// Whether the peer uses this station's id for another person.
fn is_used(peer: &Peer, claim: &Claim, now_s: f64) -> bool {
    peer.claims.iter().any(|c| c.theirs == claim.mine && c.mine != claim.mine && now_s - c.made_s <= FRESH_S)
}

/// Whether the looks and the stations that use the peer's id for a body outweigh this station and those that use its
/// id. In doubt the station with the lower number is right, so that all come to agree with the lowest. As every station
/// counts the same claims, two that disagree do not both give way.
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

/// Shortens the duration of a claim, so that it has to last again before the next decision.
fn restart(peers: &mut [Peer], claim: &Claim) {
    for c in peers.iter_mut().flat_map(|p| &mut p.claims) {
        if c.theirs == claim.theirs && c.mine == claim.mine {
            c.lasting_s = c.lasting_s.min(0.35);
        }
    }
}

/// Drops all claims that concern two ids that have changed.
fn drop_claims(peers: &mut [Peer], claim: &Claim) {
    let is_about = |id: TargetId| id == claim.theirs || id == claim.mine;
    for peer in peers {
        peer.claims.retain(|c| !is_about(c.theirs) && !is_about(c.mine));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Point2, Vector2};

    use super::super::measurement::Measurement;
    use super::super::person::Person;
    use super::*;

    const NOW_S: f64 = 50.0;

    /// Two people of one station, with these ids, 4 m apart, of whose looks nothing is known.
    fn people(ids: [u32; 2]) -> People {
        let mut people = People::default();
        for (id, x_m) in ids.into_iter().zip([1.0, 5.0]) {
            let measurement = Measurement {
                position: Point2::new(x_m, 1.0),
                covariance: Matrix2::identity() * 0.01,
                velocity: Vector2::zeros(),
                height_m: 1.7,
                looks: None,
                signature: None,
                is_crowded: false,
                target: TargetId::ALONE,
                confidence: 0.0,
                track: 0,
            };
            let mut person = Person::new(TargetId(id), &measurement);
            (person.age_s, person.unseen_s) = (20.0, 0.0);
            people.add(person);
        }
        people
    }

    /// Peers of station `own` in a room of three; each gives these ids to the two people, whom the station calls `mine`.
    fn peers(own: usize, mine: [u32; 2], theirs: [[u32; 2]; 3]) -> Vec<Peer> {
        let claims = |ids: [u32; 2]| {
            let claim = |(theirs, mine): (u32, u32)| Claim {
                theirs: TargetId(theirs),
                mine: TargetId(mine),
                lasting_s: 3.0,
                confidence: 0.9,
                made_s: NOW_S,
            };
            ids.into_iter().zip(mine).map(claim).collect()
        };
        let peer = |(station, ids)| {
            let mut peer = Peer::default();
            if station != own {
                peer.claims = claims(ids);
            }
            peer
        };
        theirs.into_iter().enumerate().map(peer).collect()
    }

    fn ids(people: &People) -> Vec<u32> {
        people.iter().map(|p| p.identity.target.0).collect()
    }

    #[test]
    fn one_station_of_three_gives_way_to_the_two_others_and_they_stay() {
        let options = ModernOptions::default();
        for odd in 0..3 {
            let all: [[u32; 2]; 3] = std::array::from_fn(|s| if s == odd { [2, 1] } else { [1, 2] });
            for own in 0..3 {
                let mut here = people(all[own]);
                let mut peers = peers(own, all[own], all);
                settle(&mut here, &mut peers, StationId(own as u8), NOW_S, &options);
                assert_eq!(ids(&here), [1, 2], "station {own} with station {odd} against the others");
            }
        }
    }
}
