//! Tests of the roster's decisions, with a clock of their own and no network.

use super::*;
use crate::foreground::Verdict;
use crate::observation::Observation;
use crate::wire::{ExpectedCamera, Fingerprint};

const ROOM: Fingerprint = Fingerprint([9; Fingerprint::BYTES]);

/// Roster with a clock, and its actions.
struct TimedRoster {
    roster: Roster,
    now: Instant,
    lines: Vec<String>,
    sent: Vec<(String, Message)>,
    delivered: Vec<(usize, Event)>,
}

fn hello(camera: &str, is_live: bool) -> Hello {
    Hello {
        room: ROOM,
        camera: camera.into(),
        width: 16,
        height: 8,
        is_live,
        rate_hz: Some(12.0),
        has_boxes_alone: false,
    }
}

impl TimedRoster {
    fn new() -> Self {
        let camera = |name: &str| ExpectedCamera { name: name.into(), width: 16, height: 8 };
        let expected = ExpectedStations { room: ROOM, cameras: vec![camera("a"), camera("b")] };
        let (lines, sent, delivered) = Default::default();
        Self { roster: Roster::new(expected), now: Instant::now(), lines, sent, delivered }
    }

    fn take(&mut self, actions: Vec<RosterAction>) {
        for action in actions {
            match action {
                RosterAction::Log(line) => self.lines.push(line),
                RosterAction::Send { station, message, .. } => self.sent.push((station, message)),
                RosterAction::Deliver(camera, event) => self.delivered.push((camera, event)),
            }
        }
    }

    fn appear(&mut self, camera: &str, id: &str) {
        let actions = self.roster.token_appeared(&Token::new(ROOM, Some(camera), id), self.now);
        self.take(actions);
    }

    fn vanish(&mut self, id: &str) {
        let actions = self.roster.token_vanished(id, self.now);
        self.take(actions);
    }

    fn say(&mut self, camera: &str, id: &str, message: &Message) {
        let actions = self.roster.message(camera, id, &message.encode().unwrap(), self.now);
        self.take(actions);
    }

    /// Lets a station appear and answer its call.
    fn join(&mut self, camera: &str, id: &str, is_live: bool) {
        self.appear(camera, id);
        self.say(camera, id, &Message::Hello(hello(camera, is_live)));
    }

    fn start(&mut self) {
        let actions = self.roster.start(self.now);
        self.take(actions);
    }

    fn see(&mut self, camera: &str, id: &str, sequence: u64) {
        let observation = Observation::unusable(sequence, sequence as f64 / 10.0, Verdict::Dark);
        let (pictures, decode, foreground) = Default::default();
        self.say(
            camera,
            id,
            &Message::Seen(Box::new(ObservedFrame { observation, pictures, decode, foreground })),
        );
    }

    fn pass(&mut self, seconds: f64) {
        for _ in 0..(seconds / 0.05).round() as u32 {
            self.now += Duration::from_millis(50);
            let actions = self.roster.tick(self.now);
            self.take(actions);
        }
    }

    /// Sequence number, time and health of all delivered observations of a camera.
    fn seen(&self, camera: usize) -> Vec<(u64, f64, Verdict)> {
        let events = self.delivered.iter().filter(|(of, _)| *of == camera);
        events
            .filter_map(|(_, event)| match event {
                Event::Seen(seen) => {
                    Some((seen.observation.sequence, seen.observation.time_s, seen.observation.health))
                }
                _ => None,
            })
            .collect()
    }

    fn count(&self, station: &str, is_it: impl Fn(&Message) -> bool) -> usize {
        self.sent.iter().filter(|(id, message)| id == station && is_it(message)).count()
    }

    fn refusal(&self, station: &str) -> Option<&str> {
        self.sent.iter().find_map(|(id, message)| match message {
            Message::Refusal(line) if id == station => Some(line.as_str()),
            _ => None,
        })
    }
}

#[test]
fn recordings_are_called_until_they_answer_and_started_together() {
    let mut scene = TimedRoster::new();
    scene.appear("a", "1");
    scene.pass(1.0);
    assert_eq!(scene.count("1", |m| matches!(m, Message::Call)), 6);
    assert_eq!(scene.roster.missing(), ["a", "b"]);
    scene.say("a", "1", &Message::Hello(hello("a", false)));
    scene.see("a", "1", 1);
    assert_eq!(scene.roster.missing(), ["b"]);
    scene.join("b", "2", false);
    assert!(scene.roster.missing().is_empty() && scene.delivered.is_empty());
    scene.start();
    scene.pass(0.5);
    assert!(scene.count("1", |m| matches!(m, Message::Start)) > 1, "an unanswered start is repeated");
    scene.see("a", "1", 1);
    let starts = scene.count("1", |m| matches!(m, Message::Start));
    scene.pass(1.0);
    assert_eq!(scene.count("1", |m| matches!(m, Message::Start)), starts);
    scene.say("a", "1", &Message::End);
    scene.say("a", "1", &Message::End);
    scene.vanish("1");
    assert!(matches!(scene.delivered.last(), Some((0, Event::Ended))));
    assert_eq!(scene.delivered.len(), 2);
    assert_eq!(scene.count("1", |m| matches!(m, Message::Done)), 2);
}

#[test]
fn a_recording_that_goes_before_its_end_has_failed_and_cannot_come_back() {
    let mut scene = TimedRoster::new();
    scene.join("a", "1", false);
    scene.join("b", "2", false);
    scene.start();
    scene.see("a", "1", 1);
    scene.vanish("1");
    match scene.delivered.last() {
        Some((0, Event::Failed(error))) => {
            assert!(error.to_string().starts_with("station `a`: it has gone before its recording's end"));
        }
        other => panic!("{other:?}"),
    }
    scene.join("a", "3", false);
    assert!(scene.refusal("3").unwrap().contains("is over"));
    scene.say("b", "2", &Message::Failure("b.mp4: frame 7 cannot be decoded".into()));
    match scene.delivered.last() {
        Some((1, Event::Failed(error))) => {
            assert_eq!(error.to_string(), "station `b`: b.mp4: frame 7 cannot be decoded");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_live_station_that_goes_is_lost_once_and_its_numbers_go_on_growing() {
    let mut scene = TimedRoster::new();
    scene.join("a", "1", true);
    scene.start();
    scene.see("a", "1", 1);
    scene.see("a", "1", 2);
    scene.now += Duration::from_secs(3);
    scene.vanish("1");
    scene.join("a", "4", true);
    scene.vanish("4");
    scene.join("a", "5", true);
    scene.see("a", "5", 1);
    let feedback = |sequence| Feedback { sequence, people: Vec::new() };
    for sequence in 1..=4 {
        let actions = scene.roster.feedback(0, feedback(sequence), scene.now);
        scene.take(actions);
    }
    let seen = scene.seen(0);
    let expected =
        [(1, 0.1, Verdict::Dark), (2, 0.2, Verdict::Dark), (3, 3.2, Verdict::Lost), (4, 0.1, Verdict::Dark)];
    assert_eq!(seen.len(), expected.len());
    for (seen, expected) in seen.iter().zip(expected) {
        assert!(
            seen.0 == expected.0 && (seen.1 - expected.1).abs() < 1e-9 && seen.2 == expected.2,
            "{seen:?}"
        );
    }
    let heard = scene.sent.iter().filter_map(|(id, message)| match message {
        Message::Feedback(feedback) => Some((id.as_str(), feedback.sequence)),
        _ => None,
    });
    assert_eq!(heard.collect::<Vec<_>>(), [("5", 1)]);
}

#[test]
fn a_rival_is_refused_while_the_holder_answers() {
    let mut scene = TimedRoster::new();
    scene.join("a", "1", true);
    scene.start();
    scene.join("a", "2", true);
    assert!(scene.refusal("2").is_none());
    scene.pass(0.3);
    assert!(scene.count("1", |m| matches!(m, Message::Call)) > 1, "the holder is asked");
    scene.say("a", "1", &Message::Hello(hello("a", true)));
    scene.pass(0.3);
    assert!(scene.refusal("2").unwrap().contains("another station has camera `a`"));
    assert_eq!(scene.lines.iter().filter(|line| line.contains("refused")).count(), 1);
    scene.see("a", "2", 9);
    scene.see("a", "1", 1);
    assert_eq!(scene.seen(0), [(1, 0.1, Verdict::Dark)]);
}

#[test]
fn a_rival_takes_the_place_of_a_holder_that_is_silent_or_gone() {
    let mut scene = TimedRoster::new();
    scene.join("a", "1", true);
    scene.start();
    scene.see("a", "1", 1);
    scene.join("a", "2", true);
    scene.pass(4.0);
    assert!(scene.refusal("2").is_none() && scene.count("2", |m| matches!(m, Message::Start)) >= 1);
    scene.see("a", "2", 1);
    scene.join("a", "3", true);
    scene.vanish("2");
    assert_eq!(scene.count("3", |m| matches!(m, Message::Start)), 1);
    scene.see("a", "3", 1);
    let healths: Vec<_> = scene.seen(0).iter().map(|seen| seen.2).collect();
    assert_eq!(healths, [Verdict::Dark, Verdict::Lost, Verdict::Dark, Verdict::Lost, Verdict::Dark]);
}

#[test]
fn others_are_left_out_with_one_line() {
    let mut scene = TimedRoster::new();
    let token = |version: &str, room: &str, camera: &str| Token {
        version: version.into(),
        room: room.into(),
        camera: Some(camera.into()),
        id: "7".into(),
    };
    let room = ROOM.to_string();
    for (token, line) in [
        (token("2", &room, "a"), "station `a` speaks version 2"),
        (token("1", "00", "a"), "station `a` belongs to another room (00"),
        (token("1", &room, "c"), "station `c`: its camera is not in use here"),
    ] {
        let actions = scene.roster.token_appeared(&token, scene.now);
        scene.take(actions);
        assert!(
            scene.lines.pop().unwrap().starts_with(line) && scene.lines.is_empty() && scene.sent.is_empty()
        );
    }
    scene.appear("b", "8");
    scene.say("b", "8", &Message::Hello(Hello { width: 32, ..hello("b", true) }));
    assert!(scene.refusal("8").unwrap().contains("32 × 8 pixels, here 16 × 8"));
    scene.pass(1.0);
    assert_eq!(scene.lines.len(), 1);
    scene.appear("b", "9");
    scene.say("b", "9", &Message::Hello(Hello { room: Fingerprint([0; 16]), ..hello("b", true) }));
    assert!(scene.refusal("9").unwrap().contains("disagree"));
}

#[test]
fn garbage_is_counted_and_told_once_a_station() {
    let mut scene = TimedRoster::new();
    scene.join("a", "1", true);
    scene.start();
    let before = scene.lines.len();
    for bytes in [&b"garbage"[..], &[], &[1, 2, 3], &Message::Call.encode().unwrap()] {
        let actions = scene.roster.message("a", "1", bytes, scene.now);
        scene.take(actions);
    }
    scene.see("a", "1", 5);
    scene.see("a", "1", 5);
    scene.see("b", "1", 6);
    assert_eq!((scene.roster.garbage(), scene.lines.len()), (6, before + 1));
    let actions = scene.roster.message("a", "unknown", b"x", scene.now);
    scene.take(actions);
    scene.see("a", "1", 6);
    assert_eq!(scene.roster.garbage(), 7);
    assert_eq!(scene.seen(0).iter().map(|seen| seen.0).collect::<Vec<_>>(), [5, 6]);
    for id in 0..2 * MOST_STATIONS {
        scene.appear("b", &format!("x{id}"));
    }
    assert_eq!(scene.roster.stations.len(), MOST_STATIONS);
}
