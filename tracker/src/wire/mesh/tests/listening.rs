//! Tests of the acceptance and refusal of packets.

use std::time::{Duration, Instant};

use proptest::prelude::*;

use super::super::super::keys::AgentsToken;
use super::super::super::packet::{LONGEST_PACKET, encode};
use super::super::Refusal;
use super::super::peers::Peers;
use super::*;

/// Peers of station 0, and the passing time.
struct TimedPeers {
    peers: Peers,
    begun: Instant,
    room: String,
    /// Time since the start, seconds.
    at_s: f64,
}

/// Own clock at the start, seconds.
const START_S: f64 = 1.7e9;

impl TimedPeers {
    fn new() -> Self {
        let room = ROOM.to_string();
        let cameras = CAMERAS.map(str::to_owned).to_vec();
        let peers = Peers::new(Some(room.clone()), cameras, Some((CAMERAS[0].to_owned(), 1)));
        Self { peers, begun: Instant::now(), room, at_s: 0.0 }
    }

    /// Lets bytes of a camera arrive.
    fn bytes(&mut self, camera: &str, bytes: &[u8]) {
        let now = self.begun + Duration::from_secs_f64(self.at_s);
        self.peers.message(&self.room, camera, bytes, START_S + self.at_s, now);
    }

    /// Lets a packet arrive that was sent just now on a clock that is ahead, 50 ms after its capture; returns whether
    /// it counts.
    fn send(&mut self, station: u8, life: u32, sequence: u32, ahead_s: f64) -> bool {
        let sent_s = START_S + self.at_s + ahead_s;
        let bytes = encode(&packet(station, life, sequence, sent_s - 0.05), sent_s).unwrap();
        self.bytes(CAMERAS[usize::from(station)], &bytes);
        !self.peers.take().is_empty()
    }

    /// Sends packets of a life at 12 a second; returns the number that count.
    fn stream(&mut self, station: u8, life: u32, sequences: std::ops::Range<u32>, ahead_s: f64) -> usize {
        let counted = sequences.map(|sequence| {
            self.at_s += 1.0 / 12.0;
            usize::from(self.send(station, life, sequence, ahead_s))
        });
        counted.sum()
    }

    fn refused(&self, refusal: Refusal) -> u64 {
        self.peers.counts().refused.get(&refusal).copied().unwrap_or(0)
    }

    fn lines(&mut self) -> Vec<String> {
        self.peers.lines()
    }

    fn token(camera: &str, life: u32) -> AgentsToken {
        AgentsToken::new(ROOM, camera, life)
    }
}

/// Asserts that there is one line, which begins with `begin`.
fn assert_line(lines: &[String], begin: &str) {
    assert!(lines.len() == 1 && lines[0].starts_with(begin) && !lines[0].contains('\n'), "{lines:?}");
}

#[test]
fn every_refusal_is_counted_and_told_once() {
    let mut bench = TimedPeers::new();
    let good = encode(&packet(1, 9, 1, START_S), START_S).unwrap();
    let mut version = good.clone();
    version[0] = 2;
    let other = encode(&packet(3, 9, 1, START_S), START_S).unwrap();
    let stale = encode(&packet(1, 9, 1, START_S - 100.0), START_S).unwrap();
    let (malformed, camera) = (Refusal::Malformed, Refusal::Camera);
    let cases: [(&str, &[u8], Refusal, Option<&str>); 8] = [
        ("cam1", &[1; LONGEST_PACKET + 1], Refusal::Oversized, Some("`cam1` sends 6145 bytes")),
        ("cam1", &version, Refusal::Version, Some("`cam1` sends version 2 of the packets, this one reads 1")),
        ("cam1", &good[..30], malformed, Some("`cam1` sends what cannot be read: the message is cut off")),
        ("cam1", &[], malformed, None),
        ("cam9", &good, camera, Some("`cam9` has a camera that the room does not have")),
        ("cam1", &other, camera, Some("`cam1` says that its camera is number 3")),
        ("cam0", &good, Refusal::Rival, Some("`cam0` is there twice")),
        ("cam1", &stale, Refusal::Clock, Some("`cam1` sends frames that were taken 100.0 s before")),
    ];
    for (camera, bytes, refusal, logged) in cases {
        let before = bench.refused(refusal);
        for _ in 0..3 {
            bench.bytes(camera, bytes);
        }
        let lines = bench.lines();
        if refusal == Refusal::Clock {
            // The second time it is a replayed one.
            assert!(lines[0].contains(logged.unwrap_or_default()), "{lines:?}");
            assert_eq!((bench.refused(refusal), bench.refused(Refusal::Replayed), lines.len()), (1, 2, 2));
            continue;
        }
        assert_eq!(bench.refused(refusal) - before, 3, "{refusal:?}");
        match logged {
            Some(logged) => assert_line(&lines, &format!("station {logged}")),
            None => assert!(lines.is_empty(), "{lines:?}"),
        }
    }
    assert!(bench.peers.take().is_empty());
}

#[test]
fn replayed_packets_and_those_out_of_order_count_once() {
    let mut bench = TimedPeers::new();
    let truth: Vec<bool> = [1, 2, 2, 1, 4, 3, 5].map(|sequence| bench.send(1, 9, sequence, 0.0)).into();
    assert_eq!(truth, [true, true, false, false, true, false, true]);
    assert_eq!(bench.refused(Refusal::Replayed), 3);
    assert_line(&bench.lines(), "station `cam1` sends packets again, or out of order");
}

#[test]
fn a_second_station_of_a_camera_is_left_out_until_the_first_is_silent() {
    let mut bench = TimedPeers::new();
    for sequence in 1..=24 {
        assert_eq!(bench.stream(1, 9, sequence..sequence + 1, 0.0), 1);
        assert!(!bench.send(1, 8, sequence, 0.0));
    }
    assert_eq!(bench.refused(Refusal::Rival), 24);
    assert_line(&bench.lines(), "station `cam1` is there twice");
    bench.at_s += 1.1;
    assert!(bench.send(1, 8, 25, 0.0));
    // The first comes back, and is the second now; its earlier packets never count again.
    assert!(!bench.send(1, 9, 26, 0.0));
    bench.at_s += 1.1;
    assert!(!bench.send(1, 9, 24, 0.0));
    assert!(bench.send(1, 9, 25, 0.0));
}

#[test]
fn a_restarted_station_is_heard_at_once_when_its_token_is_gone() {
    let mut bench = TimedPeers::new();
    assert!(bench.send(1, 9, 500, 0.0));
    assert!(!bench.send(1, 8, 1, 0.0));
    bench.peers.token_vanished(&TimedPeers::token("cam1", 7));
    assert!(!bench.send(1, 8, 1, 0.0), "another life's token");
    bench.peers.token_vanished(&TimedPeers::token("cam1", 9));
    assert!(bench.send(1, 8, 1, 0.0));
    assert!(!bench.send(1, 9, 501, 0.0));
}

#[test]
fn a_life_that_comes_back_goes_on() {
    let mut bench = TimedPeers::new();
    assert!(bench.send(1, 9, 1, 0.0));
    bench.peers.token_vanished(&TimedPeers::token("cam1", 9));
    bench.at_s += 60.0;
    assert!(bench.send(1, 9, 2, 0.0) && !bench.send(1, 8, 1, 0.0));
}

#[test]
fn tokens_of_others_are_told() {
    let mut bench = TimedPeers::new();
    for _ in 0..2 {
        bench.peers.token_appeared(&AgentsToken { version: "9".into(), ..TimedPeers::token("cam1", 9) });
        bench.peers.token_appeared(&AgentsToken { room: "ab".into(), ..TimedPeers::token("cam1", 9) });
        bench.peers.token_appeared(&TimedPeers::token("cam9", 9));
        bench.peers.token_appeared(&TimedPeers::token("cam0", 9));
        bench.peers.token_appeared(&TimedPeers::token("cam0", 1));
        bench.peers.token_appeared(&TimedPeers::token("cam1", 1));
    }
    let lines = bench.lines();
    let begins = ["speaks version 9", "belongs to another room (ab", "has a camera that", "is there twice"];
    assert_eq!(lines.len(), begins.len(), "{lines:?}");
    for (line, begin) in lines.iter().zip(begins) {
        assert!(line.contains(begin), "{line}");
    }
}

#[test]
fn a_clock_half_a_second_ahead_is_corrected_and_told() {
    let mut bench = TimedPeers::new();
    for sequence in 1..20 {
        bench.at_s += 1.0 / 12.0;
        let sent_s = START_S + bench.at_s + 0.5;
        let bytes = encode(&packet(1, 9, sequence, sent_s - 0.05), sent_s).unwrap();
        bench.bytes("cam1", &bytes);
        let heard = bench.peers.take();
        assert!((heard[0].time_s - (START_S + bench.at_s - 0.05)).abs() < 1e-5);
    }
    assert_line(
        &bench.lines(),
        "station `cam1` has a clock that is 0.50 s ahead of the one here: its times are corrected",
    );
    assert_eq!(bench.stream(1, 9, 20..100, 0.0), 80);
    assert_line(&bench.lines(), "station `cam1` has a clock that is right again");
}

#[test]
fn a_clock_that_is_an_hour_off_is_told_and_left_out_until_it_is_right() {
    for ahead_s in [3600.0, -3600.0] {
        let mut bench = TimedPeers::new();
        assert_eq!(bench.stream(1, 9, 1..120, ahead_s), 0);
        let side = if ahead_s > 0.0 { "ahead of" } else { "behind" };
        assert_line(
            &bench.lines(),
            &format!("station `cam1` has a clock that is 3600.00 s {side} the one here"),
        );
        let counted = bench.stream(1, 9, 120..240, 0.0);
        assert!(counted >= 80, "{counted}");
        assert_line(&bench.lines(), "station `cam1` has a clock that is right again");
    }
}

#[test]
fn packets_that_were_held_back_are_left_out() {
    let mut bench = TimedPeers::new();
    bench.stream(1, 9, 1..30, 0.0);
    let sent_s = START_S + bench.at_s;
    bench.at_s += 5.0;
    let held = encode(&packet(1, 9, 30, sent_s - 0.05), sent_s).unwrap();
    bench.bytes("cam1", &held);
    assert!(bench.peers.take().is_empty());
    assert_eq!(bench.refused(Refusal::Late), 1);
    assert!(bench.send(1, 9, 31, 0.0));
}

#[test]
fn the_oldest_waiting_packets_are_dropped() {
    let mut bench = TimedPeers::new();
    for sequence in 1..=300 {
        let bytes = encode(&packet(1, 9, sequence, START_S), START_S).unwrap();
        bench.bytes("cam1", &bytes);
    }
    let waiting: Vec<u32> = bench.peers.take().iter().map(|packet| packet.sequence).collect();
    assert_eq!(waiting, (45..=300).collect::<Vec<u32>>());
    assert_eq!((bench.peers.counts().heard, bench.peers.counts().dropped), (300, 44));
}

#[test]
fn a_listener_without_a_room_takes_the_first() {
    let mut peers = Peers::new(None, Vec::new(), None);
    let bytes = encode(&packet(1, 9, 1, START_S), START_S).unwrap();
    peers.message("aa", "front", &bytes, START_S, Instant::now());
    peers.message("bb", "back", &bytes, START_S, Instant::now());
    peers.message("aa", "side", &bytes, START_S, Instant::now());
    assert_eq!(peers.take().len(), 1);
    assert_eq!(peers.names(), [(StationId(1), "front".to_owned())]);
    let lines = peers.lines();
    assert!(
        lines[0].contains("`back` belongs to another room") && lines[1].contains("`side` says"),
        "{lines:?}"
    );
}

proptest! {
    #[test]
    fn memory_is_bounded_for_any_packets_and_lines_stay_lines(
        messages in proptest::collection::vec(
            (0_usize..6, 0_u8..5, any::<u32>(), any::<u32>(), -1e4..1e4, proptest::collection::vec(any::<u8>(), 0..80), any::<bool>()),
            0..200,
        ),
    ) {
        let mut bench = TimedPeers::new();
        for (camera, station, life, sequence, ahead_s, bytes, is_packet) in messages {
            bench.at_s += 0.01;
            let camera = ["cam0", "cam1", "cam 2/ä", "cam3", "x", "y\n"][camera];
            let sent_s = START_S + ahead_s;
            let bytes = if is_packet { encode(&packet(station, life, sequence, sent_s), sent_s)? } else { bytes };
            bench.bytes(camera, &bytes);
            bench.peers.token_vanished(&TimedPeers::token(camera, life));
        }
        prop_assert!(bench.peers.take().len() <= 256);
        prop_assert!(bench.lines().len() <= 6 * 9 * 3);
    }
}
