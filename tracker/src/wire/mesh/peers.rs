//! Peers of a station: acceptance of their packets, their clocks, and refusals.
//!
//! A state machine without a network: tokens and packets go in, packets on the own clock and lines for the log come
//! out. One camera has one *holder*, the life of a station whose packets count. Another life takes its place when the
//! holder has been silent for a second or its token is gone. Memory is bounded whatever arrives.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use super::super::keys::AgentsToken;
use super::super::packet::{LONGEST_PACKET, PACKET_VERSION, decode};
use super::clock::PeerClock;
use super::refusals::Refusals;
use super::{MeshCounts, Refusal};
use crate::method::agents::{Packet, StationId};

/// Time after which a silent holder may be replaced.
const SILENCE: Duration = Duration::from_secs(1);
/// Largest number of packets that wait; the oldest are dropped.
const MOST_WAITING: usize = 256;
/// Largest number of cameras of an unknown room.
const MOST_CAMERAS: usize = 255;
/// Number of past lives of a station whose sequence numbers are remembered.
const MOST_PAST_LIVES: usize = 8;
/// Largest offset of a clock that is corrected, seconds.
const MOST_OFFSET_S: f64 = 60.0;
/// Least offset of a clock that is logged, seconds.
const LOGGED_OFFSET_S: f64 = 0.1;
/// Number of packets after which an offset is logged: the first may have waited.
const LOGGED_AFTER: u32 = 5;
/// Longest time from capture to sending, seconds…
const MOST_DELAY_S: f64 = 60.0;
/// …and largest time by which a frame may seem to be sent before its capture, seconds.
const LEAST_DELAY_S: f64 = -1.0;
/// Largest delay of a packet, seconds: a later one shows where people were.
const LATEST_S: f64 = 2.0;

/// Peers of a station.
#[derive(Debug)]
pub(super) struct Peers {
    /// Digest of the room as in keys; `None` until the first packet, whose room is then taken.
    room: Option<String>,
    /// The room's cameras, in its order; empty if the room is unknown.
    cameras: Vec<String>,
    /// Camera and life of this station; `None` for a member that only listens.
    own: Option<(String, u32)>,
    /// Peers by camera.
    known: BTreeMap<String, PeerState>,
    waiting: VecDeque<Packet>,
    heard: u64,
    dropped: u64,
    refusals: Refusals,
    lines: Vec<String>,
}

/// State of one camera's station.
#[derive(Debug)]
struct PeerState {
    station: StationId,
    life: u32,
    sequence: u32,
    heard: Instant,
    /// Whether the life's token is gone.
    has_gone: bool,
    packets: u32,
    clock: PeerClock,
    is_corrected: bool,
    /// Past lives and their last sequence numbers.
    past: VecDeque<(u32, u32)>,
}

impl Peers {
    /// Peers of a room, none of them heard yet.
    pub(super) fn new(room: Option<String>, cameras: Vec<String>, own: Option<(String, u32)>) -> Self {
        Self {
            room,
            cameras,
            own,
            known: BTreeMap::new(),
            waiting: VecDeque::new(),
            heard: 0,
            dropped: 0,
            refusals: Refusals::default(),
            lines: Vec::new(),
        }
    }

    /// Waiting packets, in the order of their arrival, with times on the own clock.
    pub(super) fn take(&mut self) -> Vec<Packet> {
        self.waiting.drain(..).collect()
    }

    /// Whether no packet waits.
    pub(super) fn is_silent(&self) -> bool {
        self.waiting.is_empty()
    }

    /// Lines for the log.
    pub(super) fn lines(&mut self) -> Vec<String> {
        std::mem::take(&mut self.lines)
    }

    pub(super) fn counts(&self) -> MeshCounts {
        let refused = self.refusals.counts().clone();
        MeshCounts { heard: self.heard, dropped: self.dropped, refused, ..MeshCounts::default() }
    }

    /// Names of the cameras that have been heard, with their numbers.
    pub(super) fn names(&self) -> Vec<(StationId, String)> {
        self.known.iter().map(|(camera, peer)| (peer.station, camera.clone())).collect()
    }

    /// Handles the token of a station that has appeared.
    pub(super) fn token_appeared(&mut self, token: &AgentsToken) {
        let camera = &token.camera;
        if token.version != PACKET_VERSION.to_string() {
            let line = format!("speaks version {} of the packets, this one {PACKET_VERSION}", token.version);
            self.refuse(camera, Refusal::Version, &line, "install the same version on both machines");
        } else if !self.is_room(&token.room) {
            let line = format!("belongs to another room ({}, here {})", token.room, self.own_room());
            let mend = "if it should not, give both machines the same scene.toml";
            self.refuse(camera, Refusal::Room, &line, mend);
        } else if self.own.as_ref().is_some_and(|(own, life)| own == camera && *life != token.life) {
            let line = "is there twice, or has just gone: others hear only one of the two";
            self.refuse(camera, Refusal::Rival, line, "start one station a camera");
        } else if self.is_unknown(camera) {
            let line = "has a camera that the room does not have";
            self.refuse(camera, Refusal::Camera, line, "give both machines the same scene.toml");
        }
    }

    /// Handles the token of a station that has vanished.
    pub(super) fn token_vanished(&mut self, token: &AgentsToken) {
        if let Some(peer) = self.known.get_mut(&token.camera).filter(|peer| peer.life == token.life) {
            peer.has_gone = true;
        }
    }

    /// Handles bytes that arrived under a camera's key, at `arrived_s` on the own clock.
    pub(super) fn message(&mut self, room: &str, camera: &str, bytes: &[u8], arrived_s: f64, now: Instant) {
        if let Err((refusal, line, mend)) = self.take_in(room, camera, bytes, arrived_s, now) {
            self.refuse(camera, refusal, &line, mend);
        }
    }

    fn take_in(
        &mut self,
        room: &str,
        camera: &str,
        bytes: &[u8],
        arrived_s: f64,
        now: Instant,
    ) -> Result<(), (Refusal, String, &'static str)> {
        let same_room = "give both machines the same scene.toml";
        if bytes.len() > LONGEST_PACKET {
            let line = format!("sends {} bytes, more than a packet can have", bytes.len());
            return Err((Refusal::Oversized, line, "look for who sends them"));
        }
        if let Some(version) = bytes.first().filter(|version| **version != PACKET_VERSION) {
            let line = format!("sends version {version} of the packets, this one reads {PACKET_VERSION}");
            return Err((Refusal::Version, line, "install the same version on both machines"));
        }
        let (mut packet, sent_s) = decode(bytes).map_err(|malformed| {
            (Refusal::Malformed, format!("sends what cannot be read: {malformed}"), "look for who sends it")
        })?;
        if !self.is_room(room) {
            return Err((Refusal::Room, format!("belongs to another room ({room})"), same_room));
        }
        if self.own.as_ref().is_some_and(|(own, _)| own == camera) {
            let line = "is there twice: another one sends under this one's name".to_owned();
            return Err((Refusal::Rival, line, "start one station a camera"));
        }
        if self.is_unknown(camera) {
            return Err((Refusal::Camera, "has a camera that the room does not have".to_owned(), same_room));
        }
        if self.number(camera).is_some_and(|number| number != packet.station)
            || self.is_taken(camera, &packet)
        {
            let line = format!("says that its camera is number {}, which it is not here", packet.station.0);
            return Err((Refusal::Camera, line, same_room));
        }
        self.room.get_or_insert_with(|| room.to_owned());
        self.enrol(camera, &packet, now)?;
        let Some(peer) = self.known.get_mut(camera) else { return Ok(()) };
        peer.clock.note(sent_s, arrived_s);
        let offset_s = peer.clock.offset_s();
        let delay_s = sent_s - packet.time_s;
        if offset_s.abs() > MOST_OFFSET_S {
            let line = format!("has a clock that is {} the one here", difference(offset_s));
            return Err((Refusal::Clock, line, "set it right; until then it is not heard"));
        }
        if !(LEAST_DELAY_S..=MOST_DELAY_S).contains(&delay_s) {
            let line = format!("sends frames that were taken {delay_s:.1} s before");
            return Err((Refusal::Clock, line, "set the camera's clock right"));
        }
        if arrived_s - (sent_s + offset_s) > LATEST_S {
            let line = format!("is heard more than {LATEST_S} s late");
            return Err((Refusal::Late, line, "look at the network"));
        }
        packet.time_s = peer.clock.to_own_s(packet.time_s);
        self.log_clock(camera, offset_s);
        self.heard += 1;
        if self.waiting.len() >= MOST_WAITING {
            self.waiting.pop_front();
            self.dropped += 1;
        }
        self.waiting.push_back(packet);
        Ok(())
    }

    /// Makes the packet's life the holder of its camera if that is permitted, and its sequence number the latest.
    fn enrol(
        &mut self,
        camera: &str,
        packet: &Packet,
        now: Instant,
    ) -> Result<(), (Refusal, String, &'static str)> {
        let replayed =
            || (Refusal::Replayed, "sends packets again, or out of order".to_owned(), "look for who does");
        let Some(peer) = self.known.get_mut(camera) else {
            self.known.insert(camera.to_owned(), PeerState::new(packet, now));
            return Ok(());
        };
        if peer.life == packet.life {
            if packet.sequence <= peer.sequence {
                return Err(replayed());
            }
            peer.sequence = packet.sequence;
        } else {
            let before = peer.past.iter().find(|(life, _)| *life == packet.life);
            if before.is_some_and(|(_, sequence)| packet.sequence <= *sequence) {
                return Err(replayed());
            }
            if !peer.has_gone && now.saturating_duration_since(peer.heard) < SILENCE {
                let line = "is there twice: the one that is heard already stays".to_owned();
                return Err((Refusal::Rival, line, "start one station a camera"));
            }
            peer.replace(packet);
        }
        peer.heard = now;
        peer.has_gone = false;
        peer.packets = peer.packets.saturating_add(1);
        Ok(())
    }

    /// Logs when a clock is corrected from now on, and when one that was refused or corrected is right again.
    fn log_clock(&mut self, camera: &str, offset_s: f64) {
        let Some(peer) = self.known.get_mut(camera) else { return };
        if peer.packets < LOGGED_AFTER {
            return;
        }
        let is_corrected = offset_s.abs() > LOGGED_OFFSET_S;
        let was_corrected = std::mem::replace(&mut peer.is_corrected, is_corrected);
        let was_left_out = self.refusals.forget(camera, Refusal::Clock);
        if is_corrected && (was_left_out || !was_corrected) {
            self.lines.push(format!(
                "station `{camera}` has a clock that is {} the one here: its times are corrected",
                difference(offset_s)
            ));
        } else if was_left_out || was_corrected && !is_corrected {
            self.lines.push(format!("station `{camera}` has a clock that is right again"));
        }
    }

    /// Counts a refusal, and logs the first of its kind.
    fn refuse(&mut self, camera: &str, refusal: Refusal, line: &str, mend: &str) {
        if self.refusals.count(camera, refusal) {
            // Control characters in a name must not break the line.
            let camera: String = camera.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
            self.lines.push(format!("station `{camera}` {line}: left out; {mend}"));
        }
    }

    fn is_room(&self, room: &str) -> bool {
        self.room.as_ref().is_none_or(|own| own == room)
    }

    fn own_room(&self) -> &str {
        self.room.as_deref().unwrap_or("any")
    }

    fn number(&self, camera: &str) -> Option<StationId> {
        let known = self.cameras.iter().position(|name| name == camera).map(|index| StationId(index as u8));
        known.or_else(|| self.known.get(camera).map(|peer| peer.station))
    }

    /// Whether the room has no such camera, or no more of them can be stored.
    fn is_unknown(&self, camera: &str) -> bool {
        if self.cameras.is_empty() {
            return self.known.len() >= MOST_CAMERAS && !self.known.contains_key(camera);
        }
        !self.cameras.iter().any(|name| name == camera)
    }

    /// Whether another camera has the packet's station number.
    fn is_taken(&self, camera: &str, packet: &Packet) -> bool {
        self.known.iter().any(|(name, peer)| name != camera && peer.station == packet.station)
    }
}

impl PeerState {
    fn new(packet: &Packet, now: Instant) -> Self {
        Self {
            station: packet.station,
            life: packet.life,
            sequence: packet.sequence,
            heard: now,
            has_gone: false,
            packets: 1,
            clock: PeerClock::default(),
            is_corrected: false,
            past: VecDeque::new(),
        }
    }

    /// Makes another life the holder.
    fn replace(&mut self, packet: &Packet) {
        self.past.retain(|(life, _)| *life != packet.life);
        if self.past.len() >= MOST_PAST_LIVES {
            self.past.pop_front();
        }
        self.past.push_back((self.life, self.sequence));
        (self.life, self.sequence) = (packet.life, packet.sequence);
        (self.packets, self.clock) = (0, PeerClock::default());
    }
}

/// Describes an offset in words.
fn difference(offset_s: f64) -> String {
    let side = if offset_s < 0.0 { "ahead of" } else { "behind" };
    format!("{:.2} s {side}", offset_s.abs())
}
