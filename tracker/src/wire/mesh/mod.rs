//! Stations that track together without a gatherer: each sends its packets to those whose fields of view overlap its
//! own.
//!
//! * [`Membership`] — the station's room, camera, and the stations that it hears.
//! * [`Mesh`] — a member of the network: packets out, the others' packets in, on this station's clock.
//! * [`PeerClock`] — offset of a peer's clock.
//! * [`MeshCounts`], [`Refusal`] — counts of received packets, and of refused ones by reason.
//!
//! Every pair of stations that are to hear each other needs a link: one of the two listens and the other connects, or
//! both discover others by multicast. Stations do not forward packets, unless all connect to a router.
//!
//! A station is distinguished from others of its camera by its *life*, a number drawn when it starts. While one life is
//! heard, another is refused; a second after its last packet, or when its token is gone, the other takes its place.
//! Packets whose sequence number does not grow are refused, so that nothing counts twice.

mod clock;
#[cfg(feature = "zenoh")]
mod link;
#[cfg(feature = "zenoh")]
mod peers;
mod refusal;
#[cfg(feature = "zenoh")]
mod refusals;
#[cfg(feature = "zenoh")]
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::time::SystemTime;

pub use self::clock::PeerClock;
#[cfg(feature = "zenoh")]
pub use self::link::Mesh;
pub use self::refusal::Refusal;
use super::Fingerprint;
use crate::method::agents::StationId;
use crate::source::utc_s;

/// Role of a member in the mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct Membership {
    /// Room; `None` to listen to that of the first station heard.
    pub room: Option<Fingerprint>,
    /// Names of the room's cameras; their indices are the stations' numbers. Empty if the room is unknown.
    pub cameras: Vec<String>,
    /// Number of this station; `None` for a member that only listens.
    pub station: Option<StationId>,
    /// Numbers of the stations that are heard; a member that only listens hears all.
    pub hears: Vec<StationId>,
    /// The member's clock.
    pub clock: OwnClock,
}

/// Clock of this machine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OwnClock {
    /// Seconds added to the machine's clock, for tests of wrong clocks.
    pub shift_s: f64,
}

impl OwnClock {
    /// Seconds since 1970, UTC.
    pub fn now_s(self) -> f64 {
        utc_s(SystemTime::now()) + self.shift_s
    }
}

/// Counts of a mesh.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MeshCounts {
    /// Number of packets sent.
    pub sent: u64,
    /// Number of bytes sent to one receiver, without the network's overhead.
    pub sent_bytes: u64,
    /// Number of packets received and accepted.
    pub heard: u64,
    /// Number of packets that were dropped from a full queue.
    pub dropped: u64,
    /// Number of refused packets and stations, by reason.
    pub refused: BTreeMap<Refusal, u64>,
}
