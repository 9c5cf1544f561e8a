//! Roster of a gatherer: its stations, enrolled, started, refused or gone.
//!
//! A state machine without a network: tokens, messages, feedback and the passage of time go in, [`RosterAction`]s come out.
//! One camera has one *holder*, the station whose observations count. A station is called as soon as its token appears;
//! its hello makes it the holder, a rival, or refused. A rival is refused when the holder answers a call, and takes its
//! place when the holder is silent or leaves: so a station that died silently never locks its successor out.

mod admission;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use super::encoding::{Limits, Malformed, Message, VERSION};
use super::keys::Token;
use super::{ExpectedStations, Hello};
use crate::Error;
use crate::observation::Feedback;
use crate::station::{Event, ObservedFrame};

/// Interval at which calls and starts are repeated until they are answered.
const REPEAT: Duration = Duration::from_millis(200);
/// Time without an answer after which a holder counts as gone: longer than a lease of the network.
const SILENCE: Duration = Duration::from_secs(3);
/// Largest number of stations that are known at a time; further ones are ignored.
const MOST_STATIONS: usize = 1024;

/// Action that the caller must carry out for the gatherer.
#[derive(Debug)]
pub(super) enum RosterAction {
    /// Send a message to a station.
    Send {
        /// Name of its camera.
        camera: String,
        /// Its id.
        station: String,
        /// The message.
        message: Message,
        /// Whether it may be lost where the network is slow, so that no other station waits for this one.
        may_drop: bool,
    },
    /// Put an event of a camera, by its number, into the inbox.
    Deliver(usize, Event),
    /// Write a line into the log.
    Log(String),
}

/// Stations by id, and the holder of each camera.
pub(super) struct Roster {
    expected: ExpectedStations,
    slots: Vec<Slot>,
    stations: BTreeMap<String, EnrolledStation>,
    is_running: bool,
    garbage: u64,
    is_full: bool,
}

/// Entry of one camera.
#[derive(Default)]
struct Slot {
    holder: Option<String>,
    hello: Option<Hello>,
    /// Offset added to a station's sequence numbers, so that they grow across restarts.
    offset: u64,
    latest: Option<Latest>,
    /// Whether a recording has ended or failed.
    is_over: bool,
}

/// The latest observation of a camera.
struct Latest {
    sequence: u64,
    time_s: f64,
    at: Instant,
    /// Whether it reports the loss of a station.
    is_loss: bool,
}

/// One station in the network.
struct EnrolledStation {
    camera: usize,
    hello: Option<Hello>,
    /// Time at which the station was last asked for the message that is due: its hello or, once started, its first
    /// observation.
    asked: Instant,
    heard: Instant,
    has_observed: bool,
    /// Start of the wait for another station of its camera to answer; `None` without a rival.
    rival_since: Option<Instant>,
    has_failed: bool,
    /// Reason why it is refused; `None` if it is not.
    refusal: Option<String>,
    has_sent_garbage: bool,
}

impl Roster {
    /// A roster without stations.
    pub(super) fn new(expected: ExpectedStations) -> Self {
        let slots = expected.cameras.iter().map(|_| Slot::default()).collect();
        Self { expected, slots, stations: BTreeMap::new(), is_running: false, garbage: 0, is_full: false }
    }

    /// Number of messages that were refused.
    pub(super) fn garbage(&self) -> u64 {
        self.garbage
    }

    /// Hello of each camera's holder, or of its holder before.
    pub(super) fn hellos(&self) -> impl Iterator<Item = Option<&Hello>> {
        self.slots.iter().map(|slot| slot.hello.as_ref())
    }

    /// Names of the cameras that no station holds.
    pub(super) fn missing(&self) -> Vec<&str> {
        let cameras = self.expected.cameras.iter().zip(&self.slots);
        cameras.filter(|(_, slot)| slot.holder.is_none()).map(|(camera, _)| camera.name.as_str()).collect()
    }

    /// Starts all holders together; stations that come later start when they come.
    pub(super) fn start(&mut self, now: Instant) -> Vec<RosterAction> {
        self.is_running = true;
        let holders: Vec<String> = self.slots.iter().filter_map(|slot| slot.holder.clone()).collect();
        holders.iter().filter_map(|id| self.send(id, Message::Start, now)).collect()
    }

    /// Handles the token of a station that has appeared.
    pub(super) fn token_appeared(&mut self, token: &Token, now: Instant) -> Vec<RosterAction> {
        let Some(name) = &token.camera else { return Vec::new() };
        if token.version != VERSION.to_string() {
            return vec![RosterAction::Log(format!(
                "station `{name}` speaks version {} of the encoding, this gatherer {VERSION}: it is left out; install the \
                 same version on both machines",
                token.version
            ))];
        }
        if token.room != self.expected.room.to_string() {
            return vec![RosterAction::Log(format!(
                "station `{name}` belongs to another room ({}, here {}): it is left out; if it should not, give both \
                 machines the same scene.toml",
                token.room, self.expected.room
            ))];
        }
        let Some(camera) = self.expected.cameras.iter().position(|camera| camera.name == *name) else {
            let line = format!("station `{name}`: its camera is not in use here: it is left out");
            return vec![RosterAction::Log(line)];
        };
        if self.stations.len() >= MOST_STATIONS {
            let is_news = !std::mem::replace(&mut self.is_full, true);
            let line = format!("{MOST_STATIONS} stations are there: others are left out");
            return is_news.then_some(RosterAction::Log(line)).into_iter().collect();
        }
        self.stations.entry(token.id.clone()).or_insert(EnrolledStation {
            camera,
            hello: None,
            asked: now,
            heard: now,
            has_observed: false,
            rival_since: None,
            has_failed: false,
            refusal: None,
            has_sent_garbage: false,
        });
        self.send(&token.id, Message::Call, now).into_iter().collect()
    }

    /// Handles the token of a station that has vanished: the station has ended, died, or cannot be reached.
    pub(super) fn token_vanished(&mut self, id: &str, now: Instant) -> Vec<RosterAction> {
        let Some(station) = self.stations.remove(id) else { return Vec::new() };
        let mut actions = Vec::new();
        if self.slots[station.camera].holder.as_deref() == Some(id) {
            actions.extend(self.release(station.camera, now));
            let rival =
                self.stations.iter().find(|(_, s)| s.camera == station.camera && s.rival_since.is_some());
            if let Some(rival) = rival.map(|(id, _)| id.clone()) {
                actions.extend(self.admit(&rival, now));
            }
        }
        actions
    }

    /// Handles a message under the key of a camera and a station.
    pub(super) fn message(
        &mut self,
        camera: &str,
        id: &str,
        bytes: &[u8],
        now: Instant,
    ) -> Vec<RosterAction> {
        let Some(station) = self.stations.get_mut(id) else {
            return self.count_garbage(camera, None, Malformed("the station is unknown"));
        };
        let expected = &self.expected.cameras[station.camera];
        if expected.name != camera {
            return self.count_garbage(camera, Some(id), Malformed("the station has another camera"));
        }
        let limits = Limits { width: expected.width, height: expected.height };
        let message = match Message::decode(bytes, limits) {
            Ok(message) => message,
            Err(malformed) => return self.count_garbage(camera, Some(id), malformed),
        };
        station.heard = now;
        let index = station.camera;
        let is_holder = self.slots[index].holder.as_deref() == Some(id);
        match message {
            Message::Hello(hello) => self.hello(id, hello, now),
            Message::Seen(seen) if is_holder && self.is_running => {
                station.has_observed = true;
                self.observed(index, seen, now)
            }
            Message::End | Message::Failure(_) if self.slots[index].is_over => {
                self.send(id, Message::Done, now).into_iter().collect()
            }
            Message::End if is_holder => self.end(id, Event::Ended, now),
            Message::Failure(line) if is_holder => {
                let failed = Event::Failed(Error::option(format!("station `{camera}`"), line));
                self.end(id, failed, now)
            }
            Message::Failure(line) => {
                let is_news = !std::mem::replace(&mut station.has_failed, true);
                let line = format!("station `{camera}`: {line}");
                is_news.then_some(RosterAction::Log(line)).into_iter().collect()
            }
            // Observations of a station that was refused, replaced or not yet started are ignored.
            Message::Seen(_) | Message::End => Vec::new(),
            _ => self.count_garbage(camera, Some(id), Malformed("stations do not send this kind")),
        }
    }

    /// Passes feedback of the tracker on to a camera's station.
    pub(super) fn feedback(&mut self, camera: usize, feedback: Feedback, now: Instant) -> Vec<RosterAction> {
        let slot = &self.slots[camera];
        // Feedback for a station that has left is not for its successor.
        let (Some(id), Some(sequence)) = (slot.holder.clone(), feedback.sequence.checked_sub(slot.offset))
        else {
            return Vec::new();
        };
        if sequence == 0 {
            return Vec::new();
        }
        self.send(&id, Message::Feedback(Feedback { sequence, ..feedback }), now).into_iter().collect()
    }

    /// Lets time pass: repeats messages without an answer, and decides between rivals.
    pub(super) fn tick(&mut self, now: Instant) -> Vec<RosterAction> {
        let mut actions = Vec::new();
        let due: Vec<String> =
            self.stations.iter().filter(|(_, s)| now - s.asked >= REPEAT).map(|(id, _)| id.clone()).collect();
        for id in due {
            let station = &self.stations[&id];
            let slot = &self.slots[station.camera];
            let is_holder = slot.holder.as_deref() == Some(&id);
            let is_challenged = is_holder
                && self.stations.values().any(|s| s.camera == station.camera && s.rival_since.is_some());
            let owes_observation = is_holder && self.is_running && !station.has_observed && !slot.is_over;
            if let Some(line) = &station.refusal {
                actions.extend(self.send(&id, Message::Refusal(line.clone()), now));
            } else if station.hello.is_none() || is_challenged {
                actions.extend(self.send(&id, Message::Call, now));
            } else if owes_observation {
                actions.extend(self.send(&id, Message::Start, now));
            }
        }
        actions.extend(self.decide_rivals(now));
        actions
    }

    fn observed(&mut self, camera: usize, mut seen: Box<ObservedFrame>, now: Instant) -> Vec<RosterAction> {
        let slot = &mut self.slots[camera];
        let sequence = seen.observation.sequence.checked_add(slot.offset);
        let before = slot.latest.as_ref().map_or(0, |latest| latest.sequence);
        let Some(sequence) = sequence.filter(|sequence| *sequence > before && !slot.is_over) else {
            let (name, id) = (self.expected.cameras[camera].name.clone(), slot.holder.clone());
            return self.count_garbage(&name, id.as_deref(), Malformed("a sequence number does not grow"));
        };
        seen.observation.sequence = sequence;
        slot.latest = Some(Latest { sequence, time_s: seen.observation.time_s, at: now, is_loss: false });
        vec![RosterAction::Deliver(camera, Event::Seen(seen))]
    }

    fn end(&mut self, id: &str, event: Event, now: Instant) -> Vec<RosterAction> {
        let Some(station) = self.stations.get_mut(id) else { return Vec::new() };
        let camera = station.camera;
        self.slots[camera].is_over = true;
        let mut actions = vec![RosterAction::Deliver(camera, event)];
        actions.extend(self.send(id, Message::Done, now));
        actions
    }

    fn send(&mut self, id: &str, message: Message, now: Instant) -> Option<RosterAction> {
        let station = self.stations.get_mut(id)?;
        station.asked = now;
        let is_recording = station.hello.as_ref().is_some_and(|hello| !hello.is_live);
        // All messages but a recording's feedback are repeated until they are answered, or replaced by the next one.
        let may_drop = !(is_recording && matches!(message, Message::Feedback(_)));
        let camera = self.expected.cameras[station.camera].name.clone();
        Some(RosterAction::Send { camera, station: id.to_owned(), message, may_drop })
    }

    fn count_garbage(&mut self, camera: &str, id: Option<&str>, malformed: Malformed) -> Vec<RosterAction> {
        let station = id.and_then(|id| self.stations.get_mut(id));
        let is_news = match station {
            Some(station) => !std::mem::replace(&mut station.has_sent_garbage, true),
            None => self.garbage == 0,
        };
        self.garbage += 1;
        let line = format!("a message of station `{camera}` is refused: {malformed}; more are counted");
        is_news.then_some(RosterAction::Log(line)).into_iter().collect()
    }
}
