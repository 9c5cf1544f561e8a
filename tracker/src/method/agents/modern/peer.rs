//! What this station knows of another station.

use super::super::{Packet, TargetId};

/// Most claims of one peer that are kept.
const MOST_CLAIMS: usize = 128;
/// Time after which a claim that is not repeated is forgotten, seconds.
const FORGOTTEN_S: f64 = 2.0;

/// A peer's id for somebody here.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Claim {
    /// The peer's id.
    pub(super) theirs: TargetId,
    /// This station's id of the same body.
    pub(super) mine: TargetId,
    /// Time for which it has been so, seconds.
    pub(super) lasting_s: f64,
    /// How sure the peer is of its id.
    pub(super) confidence: f64,
    /// When it was made last.
    pub(super) made_s: f64,
}

/// Another station.
#[derive(Debug, Clone, Default)]
pub(super) struct Peer {
    /// When it was heard last, seconds on this station's clock; `None`: never.
    pub(super) heard_s: Option<f64>,
    /// Whether its camera shows nothing usable.
    pub(super) is_blind: bool,
    /// Its ids for people here.
    pub(super) claims: Vec<Claim>,
    life: u32,
    sequence: u32,
    time_s: f64,
}

impl Peer {
    /// Takes note of a packet. Returns the time since the packet before, seconds, or `None` where it is an old one.
    pub(super) fn note(&mut self, packet: &Packet, now_s: f64) -> Option<f64> {
        let is_new_life = packet.life != self.life;
        if self.heard_s.is_some() {
            let is_old =
                if is_new_life { packet.time_s <= self.time_s } else { packet.sequence <= self.sequence };
            if is_old {
                return None;
            }
        }
        let since_s = if self.heard_s.is_none() || is_new_life { 0.1 } else { packet.time_s - self.time_s };
        self.heard_s = Some(now_s);
        self.is_blind = packet.is_blind;
        self.life = packet.life;
        self.sequence = packet.sequence;
        self.time_s = packet.time_s;
        Some(since_s.clamp(0.02, 0.5))
    }

    /// Whether it is running, and its camera sees.
    pub(super) fn is_watching(&self, now_s: f64) -> bool {
        /// Time after which a station that is not heard is taken for dead, seconds.
        const DEAD_S: f64 = 2.0;
        !self.is_blind && self.heard_s.is_some_and(|s| now_s - s <= DEAD_S)
    }

    /// The peer has measured somebody here under an id, `dt` seconds after its last packet.
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

    /// Forgets claims that are no longer made.
    pub(super) fn forget_old(&mut self, now_s: f64) {
        self.claims.retain(|c| c.lasting_s > 0.0 && now_s - c.made_s <= FORGOTTEN_S);
    }
}
