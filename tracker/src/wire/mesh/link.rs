//! A member of the mesh in the network.

use std::collections::hash_map::RandomState;
use std::hash::{BuildHasher, Hasher};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::super::keys::{self, AgentsToken};
use super::super::network::session::{Arrival, Member, Subscriptions};
use super::super::packet::{LONGEST_PACKET, encode};
use super::super::{Endpoints, Fingerprint};
use super::peers::Peers;
use super::{Membership, MeshCounts, OwnClock};
use crate::method::agents::{Packet, StationId};
use crate::{Error, Result};

/// Longest message that is received, to be counted as too long, bytes. Longer ones are dropped in the network's code.
const LONGEST_RECEIVED: usize = 10 * LONGEST_PACKET;
/// Largest number of cameras of a room: their numbers are bytes.
const MOST_CAMERAS: usize = 255;

/// A member of the mesh. Dropping it leaves the network, within 2 s.
pub struct Mesh {
    shared: Arc<MeshState>,
    member: Member,
    /// Key of its packets, and its camera; `None` for a member that only listens.
    own: Option<(String, String)>,
    station: Option<StationId>,
    life: u32,
    clock: OwnClock,
    sent: u64,
    sent_bytes: u64,
}

struct MeshState {
    peers: Mutex<Peers>,
    heard: Condvar,
}

impl Mesh {
    /// Joins the network.
    ///
    /// # Errors
    /// An unusable endpoint or certificate, or a membership that names a station that does not exist.
    pub fn open(membership: &Membership, endpoints: &Endpoints) -> Result<Self> {
        let Membership { room, cameras, station, hears, clock } = membership;
        if cameras.len() > MOST_CAMERAS {
            return Err(Error::option("room", format!("{} cameras; at most {MOST_CAMERAS}", cameras.len())));
        }
        let name = |station: &StationId| -> Result<&str> {
            let camera = cameras.get(usize::from(station.0)).map(String::as_str);
            camera.ok_or_else(|| Error::option("room", format!("there is no camera number {}", station.0)))
        };
        let (own, room) = (station.as_ref().map(name).transpose()?, *room);
        let life = RandomState::new().build_hasher().finish() as u32;
        let token = own.zip(room).map(|(camera, room)| AgentsToken::new(room, camera, life).key());
        let messages = match own {
            Some(_) => hears
                .iter()
                .map(|station| name(station).map(|camera| keys::packets(room, Some(camera))))
                .collect::<Result<Vec<_>>>()?,
            None => vec![keys::packets(room, None)],
        };
        let peers = Peers::new(
            room.map(|room: Fingerprint| room.to_string()),
            cameras.clone(),
            own.map(|camera| (camera.to_owned(), life)),
        );
        let shared = Arc::new(MeshState { peers: Mutex::new(peers), heard: Condvar::new() });
        let (arrived, clock) = (Arc::clone(&shared), *clock);
        let member = Member::join(
            endpoints,
            LONGEST_RECEIVED,
            |_| Subscriptions { token, tokens: keys::AGENTS, messages },
            move |arrival| arrived.take_in(arrival, clock.now_s()),
        )?;
        let own = own.map(|camera| (keys::packets(room, Some(camera)), camera.to_owned()));
        Ok(Self { shared, member, own, station: *station, life, clock, sent: 0, sent_bytes: 0 })
    }

    /// Sends a packet at once, as one of this station's life. A packet that the network is too slow for is lost.
    ///
    /// # Errors
    /// A packet that cannot be decoded ([`encode`]) or is another station's, or a member that only listens.
    pub fn publish(&mut self, packet: &Packet) -> Result<()> {
        let Some((key, camera)) = &self.own else {
            return Err(Error::option("station", "this member only listens"));
        };
        if let Some(own) = self.station.filter(|own| *own != packet.station) {
            let problem = format!("the packet is of station {}, this is {}", packet.station.0, own.0);
            return Err(Error::option(format!("station `{camera}`"), problem));
        }
        let packet = Packet { life: self.life, ..packet.clone() };
        let bytes = encode(&packet, self.clock.now_s())
            .map_err(|malformed| Error::option(format!("station `{camera}`"), malformed.to_string()))?;
        self.sent += 1;
        self.sent_bytes += bytes.len() as u64;
        self.member.send(key, bytes, true);
        Ok(())
    }

    /// Packets that have arrived since the last call, in the order of their arrival, with times on the own clock.
    pub fn heard(&self) -> Vec<Packet> {
        self.shared.lock().take()
    }

    /// Packets that have arrived since the last call; while there are none, waits for one, at most for `longest`.
    pub fn wait_received(&self, longest: Duration) -> Vec<Packet> {
        let peers = self.shared.lock();
        let waited = self.shared.heard.wait_timeout_while(peers, longest, |peers| peers.is_silent());
        waited.unwrap_or_else(PoisonError::into_inner).0.take()
    }

    /// Names of the cameras that have been heard, with their numbers.
    pub fn names(&self) -> Vec<(StationId, String)> {
        self.shared.lock().names()
    }

    /// Counts of sent, received and refused packets.
    pub fn counts(&self) -> MeshCounts {
        MeshCounts { sent: self.sent, sent_bytes: self.sent_bytes, ..self.shared.lock().counts() }
    }
}

impl MeshState {
    fn lock(&self) -> MutexGuard<'_, Peers> {
        self.peers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Handles an arrival, on a thread of the network; unknown keys are ignored.
    fn take_in(&self, arrival: Arrival, arrived_s: f64) {
        let mut peers = self.lock();
        match arrival {
            Arrival::Appeared(key) => {
                if let Some(token) = AgentsToken::of(&key) {
                    peers.token_appeared(&token);
                }
            }
            Arrival::Vanished(key) => {
                if let Some(token) = AgentsToken::of(&key) {
                    peers.token_vanished(&token);
                }
            }
            Arrival::Message { key, bytes } => {
                if let Some((room, camera)) = keys::room_and_camera(&key) {
                    peers.message(&room, &camera, &bytes, arrived_s, Instant::now());
                }
            }
        }
        let lines = peers.lines();
        drop(peers);
        self.heard.notify_all();
        for line in lines {
            tracing::warn!("{line}");
        }
    }
}

impl std::fmt::Debug for Mesh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Mesh").field("own", &self.own).field("counts", &self.counts()).finish_non_exhaustive()
    }
}
