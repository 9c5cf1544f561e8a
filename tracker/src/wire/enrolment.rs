//! A station's side of enrolment: its gatherer, and whether the gatherer has started it, refused it or left.
//!
//! A state machine without a network, as [`super::roster`] is for the gatherer. A station works for the first gatherer
//! that calls it, until that gatherer leaves; other gatherers get a failure that says so.

use std::collections::BTreeSet;
use std::sync::mpsc::{SyncSender, TrySendError};

use super::Hello;
use super::encoding::{Limits, Message, VERSION};
use super::keys::Token;
use crate::observation::Feedback;

/// Action that the caller must carry out for the station.
#[derive(Debug)]
pub(super) enum EnrolmentAction {
    /// Send a message to the gatherer of this id.
    Send(String, Message),
    /// Write a line into the log.
    Log(String),
}

/// State of a station among gatherers.
pub(super) struct Enrolment {
    hello: Hello,
    gatherer: Option<String>,
    is_started: bool,
    is_done: bool,
    failure: Option<String>,
    /// Sender of feedback to the station; dropped with a failure, so that the station stops waiting.
    feedback: Option<SyncSender<Feedback>>,
    /// Latest line about a gatherer for which this station does not work.
    hint: Option<String>,
    logged: BTreeSet<String>,
    garbage: u64,
}

impl Enrolment {
    /// A station that no gatherer has called.
    pub(super) fn new(hello: Hello, feedback: SyncSender<Feedback>) -> Self {
        Self {
            hello,
            gatherer: None,
            is_started: false,
            is_done: false,
            failure: None,
            feedback: Some(feedback),
            hint: None,
            logged: BTreeSet::new(),
            garbage: 0,
        }
    }

    /// The gatherer that wants this station's observations.
    pub(super) fn started_by(&self) -> Option<&str> {
        self.gatherer.as_deref().filter(|_| self.is_started)
    }

    /// Whether the gatherer has received this station's end.
    pub(super) fn is_done(&self) -> bool {
        self.is_done
    }

    /// Reason why this station cannot go on; `None` while it can.
    pub(super) fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Possible reason why a gatherer that is present has not called.
    pub(super) fn hint(&self) -> Option<&str> {
        self.hint.as_deref()
    }

    /// Handles the token of a gatherer that has appeared.
    pub(super) fn token_appeared(&mut self, token: &Token) -> Vec<EnrolmentAction> {
        let line = if token.version != VERSION.to_string() {
            format!(
                "a gatherer speaks version {} of the encoding, this station {VERSION}; install the same version on both \
                 machines",
                token.version
            )
        } else if token.room != self.hello.room.to_string() {
            format!(
                "a gatherer is of another room ({}, here {}); if it should not be, give both machines the same scene.toml",
                token.room, self.hello.room
            )
        } else {
            return Vec::new();
        };
        self.hint = Some(line.clone());
        self.logged.insert(line.clone()).then_some(EnrolmentAction::Log(line)).into_iter().collect()
    }

    /// Handles the token of a gatherer that has vanished.
    pub(super) fn token_vanished(&mut self, id: &str) -> Vec<EnrolmentAction> {
        if self.gatherer.as_deref() != Some(id) {
            return Vec::new();
        }
        self.gatherer = None;
        let was_started = std::mem::take(&mut self.is_started);
        if self.hello.is_live {
            return vec![EnrolmentAction::Log("the gatherer has gone; waiting for it".to_owned())];
        }
        if was_started && !self.is_done {
            self.fail(
                "the gatherer has gone before the recording's end; see its own messages, and run again"
                    .to_owned(),
            );
        }
        Vec::new()
    }

    /// Handles a message of a gatherer.
    pub(super) fn message(&mut self, gatherer: &str, bytes: &[u8]) -> Vec<EnrolmentAction> {
        let message = match Message::decode(bytes, Limits::NO_MASK) {
            Ok(message) => message,
            Err(malformed) => {
                self.garbage += 1;
                let line = format!("a message of a gatherer is refused: {malformed}; more are counted");
                return (self.garbage == 1).then_some(EnrolmentAction::Log(line)).into_iter().collect();
            }
        };
        if self.failure.is_some() {
            return Vec::new();
        }
        let is_other = self.gatherer.as_deref().is_some_and(|id| id != gatherer);
        match message {
            Message::Call if is_other => {
                let line = "it works for another gatherer; stop one of the two".to_owned();
                vec![EnrolmentAction::Send(gatherer.to_owned(), Message::Failure(line))]
            }
            Message::Call => {
                self.gatherer = Some(gatherer.to_owned());
                vec![EnrolmentAction::Send(gatherer.to_owned(), Message::Hello(self.hello.clone()))]
            }
            // A refusal may arrive before a call.
            Message::Refusal(line) if !is_other => {
                self.fail(format!("the gatherer refuses it: {line}"));
                Vec::new()
            }
            _ if self.gatherer.as_deref() != Some(gatherer) => Vec::new(),
            Message::Start => {
                let is_news = !std::mem::replace(&mut self.is_started, true);
                let line = "the gatherer has started this station".to_owned();
                is_news.then_some(EnrolmentAction::Log(line)).into_iter().collect()
            }
            Message::Feedback(feedback) => self.feedback(feedback),
            Message::Done => {
                self.is_done = true;
                Vec::new()
            }
            _ => Vec::new(),
        }
    }

    /// Records the reason why this station cannot go on.
    pub(super) fn fail(&mut self, line: String) {
        self.failure.get_or_insert(line);
        self.feedback = None;
        self.is_started = false;
    }

    fn feedback(&mut self, feedback: Feedback) -> Vec<EnrolmentAction> {
        let Some(channel) = &self.feedback else { return Vec::new() };
        match channel.try_send(feedback) {
            Ok(()) | Err(TrySendError::Disconnected(_)) => {}
            // A live station that is behind needs the next feedback as much as this one.
            Err(TrySendError::Full(_)) if self.hello.is_live => {}
            Err(TrySendError::Full(_)) => {
                self.fail("the gatherer sends more feedback than there are observations".to_owned());
            }
        }
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{self, Receiver};

    use super::*;
    use crate::wire::Fingerprint;

    const ROOM: Fingerprint = Fingerprint([9; Fingerprint::BYTES]);

    fn station(is_live: bool) -> (Enrolment, Receiver<Feedback>) {
        let (sender, feedback) = mpsc::sync_channel(2);
        let hello = Hello {
            room: ROOM,
            camera: "a".into(),
            width: 16,
            height: 8,
            is_live,
            rate_hz: None,
            has_boxes_alone: false,
        };
        (Enrolment::new(hello, sender), feedback)
    }

    fn say(station: &mut Enrolment, gatherer: &str, message: &Message) -> Vec<EnrolmentAction> {
        station.message(gatherer, &message.encode().unwrap())
    }

    fn feedback(sequence: u64) -> Message {
        Message::Feedback(Feedback { sequence, people: Vec::new() })
    }

    #[test]
    fn the_first_gatherer_that_calls_is_worked_for_until_it_has_gone() {
        let (mut station, heard) = station(true);
        say(&mut station, "1", &Message::Start);
        assert_eq!(station.started_by(), None);
        let answer = say(&mut station, "1", &Message::Call);
        assert!(matches!(&answer[..], [EnrolmentAction::Send(to, Message::Hello(_))] if to == "1"));
        let answer = say(&mut station, "2", &Message::Call);
        assert!(matches!(&answer[..], [EnrolmentAction::Send(to, Message::Failure(_))] if to == "2"));
        say(&mut station, "2", &Message::Start);
        assert_eq!(station.started_by(), None);
        say(&mut station, "1", &Message::Start);
        say(&mut station, "2", &feedback(1));
        say(&mut station, "2", &Message::Refusal("no".into()));
        say(&mut station, "1", &feedback(2));
        assert_eq!((station.started_by(), station.failure()), (Some("1"), None));
        assert_eq!(heard.try_iter().map(|f| f.sequence).collect::<Vec<_>>(), [2]);
        station.token_vanished("2");
        assert_eq!(station.started_by(), Some("1"));
        station.token_vanished("1");
        assert_eq!((station.started_by(), station.failure()), (None, None));
        say(&mut station, "2", &Message::Call);
        say(&mut station, "2", &Message::Start);
        assert_eq!(station.started_by(), Some("2"));
    }

    #[test]
    fn a_recording_fails_when_its_gatherer_goes_or_refuses() {
        let (mut early, _) = station(false);
        say(&mut early, "1", &Message::Call);
        early.token_vanished("1");
        assert_eq!(early.failure(), None, "nothing was begun");
        let (mut left, heard) = station(false);
        say(&mut left, "1", &Message::Call);
        say(&mut left, "1", &Message::Start);
        left.token_vanished("1");
        assert!(left.failure().unwrap().contains("has gone") && heard.recv().is_err());
        let (mut refused, heard) = station(false);
        say(&mut refused, "1", &Message::Refusal("another has it".into()));
        assert!(refused.failure().unwrap().ends_with("another has it") && heard.recv().is_err());
        assert!(say(&mut refused, "1", &Message::Call).is_empty());
        let (mut done, _heard) = station(false);
        say(&mut done, "1", &Message::Call);
        say(&mut done, "1", &Message::Start);
        say(&mut done, "1", &Message::Done);
        done.token_vanished("1");
        assert_eq!((done.is_done(), done.failure()), (true, None));
    }

    #[test]
    fn feedback_that_is_not_taken_is_dropped_live_and_fails_a_recording() {
        for is_live in [true, false] {
            let (mut station, heard) = station(is_live);
            say(&mut station, "1", &Message::Call);
            for sequence in 1..=3 {
                say(&mut station, "1", &feedback(sequence));
            }
            assert_eq!(station.failure().is_none(), is_live);
            assert_eq!(heard.try_iter().map(|f| f.sequence).collect::<Vec<_>>(), [1, 2]);
        }
    }

    #[test]
    fn other_gatherers_and_garbage_are_told_once() {
        let (mut station, _heard) = station(true);
        let other = |version: &str, room: &str| Token {
            version: version.into(),
            room: room.into(),
            camera: None,
            id: "3".into(),
        };
        let room = ROOM.to_string();
        assert!(station.token_appeared(&other("1", &room)).is_empty());
        for token in [other("2", &room), other("1", "00")] {
            assert_eq!(station.token_appeared(&token).len(), 1);
            assert!(station.token_appeared(&token).is_empty());
        }
        assert!(station.hint().unwrap().contains("another room (00"));
        assert_eq!(station.message("1", b"garbage").len(), 1);
        assert!(station.message("1", b"garbage").is_empty());
        assert_eq!(station.failure(), None);
    }
}
