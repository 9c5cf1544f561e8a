//! State of another station, as far as this station receives its packets.

use super::super::{Packet, TargetId};

/// Maximum number of claims that are kept of one peer.
const MOST_CLAIMS: usize = 128;
/// Time without repetition after which a claim is dropped, seconds.
const FORGOTTEN_S: f64 = 2.0;

/// Claim of a peer that a person here carries the peer's id.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Claim {
    /// The peer's id.
    pub(super) theirs: TargetId,
    /// This station's id for the same body.
    pub(super) mine: TargetId,
    /// Duration of the claim, seconds.
    pub(super) lasting_s: f64,
    /// The peer's confidence in its id, 0 to 1.
    pub(super) confidence: f64,
    /// Time of the last repetition, seconds on this station's clock.
    pub(super) made_s: f64,
}

/// Another station.
#[derive(Debug, Clone, Default)]
pub(super) struct Peer {
    /// Time of the last packet, seconds on this station's clock; `None` before the first packet.
    pub(super) received_s: Option<f64>,
    /// Whether the peer's camera has no usable image.
    pub(super) is_blind: bool,
    /// The peer's ids for people here.
    pub(super) claims: Vec<Claim>,
    life: u32,
    sequence: u32,
    time_s: f64,
}

impl Peer {
    /// Updates the state with a packet. Returns the time since the previous packet, seconds; `None` for an old one.
    pub(super) fn update(&mut self, packet: &Packet, now_s: f64) -> Option<f64> {
        let is_new_life = packet.life != self.life;
        if self.received_s.is_some() {
            let is_old =
                if is_new_life { packet.time_s <= self.time_s } else { packet.sequence <= self.sequence };
            if is_old {
                return None;
            }
        }
        let since_s =
            if self.received_s.is_none() || is_new_life { 0.1 } else { packet.time_s - self.time_s };
        self.received_s = Some(now_s);
        self.is_blind = packet.is_blind;
        self.life = packet.life;
        self.sequence = packet.sequence;
        self.time_s = packet.time_s;
        Some(since_s.clamp(0.02, 0.5))
    }

    /// Whether the peer is running and its camera has a usable image.
    pub(super) fn is_watching(&self, now_s: f64) -> bool {
        /// Time without a packet after which a station has stopped, seconds.
        const DEAD_S: f64 = 2.0;
        !self.is_blind && self.received_s.is_some_and(|s| now_s - s <= DEAD_S)
    }

    /// Records a claim, `dt` seconds after the peer's previous packet; its duration grows to at most `most_s` seconds.
    pub(super) fn claim(&mut self, claim: Claim, dt: f64, most_s: f64) {
        let mut is_known = false;
        for known in &mut self.claims {
            if known.theirs == claim.theirs && known.mine == claim.mine {
                known.lasting_s = (known.lasting_s + dt).min(most_s);
                known.confidence = claim.confidence;
                known.made_s = claim.made_s;
                is_known = true;
            } else if known.theirs == claim.theirs || known.mine == claim.mine {
                known.lasting_s -= 2.0 * dt;
            }
        }
        if !is_known && self.claims.len() < MOST_CLAIMS {
            self.claims.push(Claim { lasting_s: dt, ..claim });
        }
    }

    /// Drops claims that are no longer made.
    pub(super) fn forget_old(&mut self, now_s: f64) {
        self.claims.retain(|c| c.lasting_s > 0.0 && now_s - c.made_s <= FORGOTTEN_S);
    }
}
