//! Events of walks whose borders, times and gaps are known.

use std::collections::BTreeMap;

use mot::jsonl::{FrameLine, PersonLine};
use nalgebra::Point2;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use scenes::polygon::Polygon;
use scenes::room::{Line, Region, Room, Zone, ZoneKind};

use super::*;
use crate::TrackId;

/// Frames a second.
pub(super) const RATE: f64 = 10.0;

fn rectangle(low: (f64, f64), high: (f64, f64)) -> Polygon {
    Polygon::rectangle(Point2::new(low.0, low.1), Point2::new(high.0, high.1))
}

/// A door around the origin, a counter from x = 2 to 4, a gate at x = 6 that is crossed eastward.
pub(super) fn room() -> Room {
    Room {
        zones: vec![Zone {
            name: "door".into(),
            polygon: rectangle((-0.5, -1.0), (0.5, 1.0)),
            kind: ZoneKind::Both,
        }],
        regions: vec![Region {
            name: "counter".into(),
            polygon: rectangle((2.0, -1.0), (4.0, 1.0)),
            dwell_s: Some(5.0),
        }],
        lines: vec![Line {
            name: "gate".into(),
            points: vec![Point2::new(6.0, -1.0), Point2::new(6.0, 1.0)],
        }],
        ..Room::default()
    }
}

pub(super) fn person(id: u32, x: f64, y: f64) -> PersonLine {
    PersonLine {
        id: TrackId(id),
        x,
        y,
        radius: 0.25,
        height: 1.7,
        vx: 0.0,
        vy: 0.0,
        sigma: [0.03, 0.03],
        confidence: 0.9,
        visible: BTreeMap::new(),
    }
}

/// Line of a frame, from 1; 10 frames a second.
pub(super) fn line(frame: u32, people: Vec<PersonLine>) -> FrameLine {
    FrameLine {
        frame,
        time: f64::from(frame - 1) / RATE,
        people,
        count: vec![],
        set_aside: vec![],
        states: vec![],
        clock: None,
    }
}

/// Lines of one person, whose place at a time is given, or `None` while nobody sees them.
pub(super) fn walk(seconds: f64, place: impl Fn(f64) -> Option<(f64, f64)>) -> Vec<FrameLine> {
    let frames = 1..=(seconds * RATE) as u32 + 1;
    let of = |frame| {
        line(frame, place(f64::from(frame - 1) / RATE).map(|(x, y)| person(7, x, y)).into_iter().collect())
    };
    frames.map(of).collect()
}

pub(super) fn events_of(lines: &[FrameLine]) -> Vec<Event> {
    let mut events = Events::new(&room(), EventOptions::default());
    let mut all: Vec<Event> = lines.iter().flat_map(|line| events.step(line)).collect();
    all.extend(events.finish());
    all
}

/// Kind, place and time of each event, in words.
pub(super) fn words(events: &[Event]) -> Vec<String> {
    let word = |e: &Event| {
        let kind = e.revoked.map_or(e.kind.word().to_owned(), |kind| format!("revoke-{}", kind.word()));
        let direction = e.direction.map_or(String::new(), |d| format!(" {d:?}"));
        let seconds = e.seconds.map_or(String::new(), |s| format!(" {s:.2} s"));
        let place = e.place.as_deref().unwrap_or("-");
        format!("{kind} {place} {:.2}{direction}{seconds}", e.time)
    };
    events.iter().map(word).collect()
}

#[test]
fn a_walk_past_everything_is_told_at_the_moments_of_the_borders() {
    // From the door eastward at 1 m/s until x = 8, and out of sight there.
    let lines = walk(11.0, |t| (t <= 8.0).then_some((t, 0.0)));
    let events = events_of(&lines);
    assert_eq!(
        words(&events),
        [
            "appear door 0.00",
            "enter door 0.00",
            "leave door 0.50 0.50 s",
            "enter counter 2.00",
            "leave counter 4.00 2.00 s",
            "cross gate 6.00 In",
            "disappear - 8.00"
        ]
    );
    let cross = &events[5];
    assert_eq!((cross.id, cross.x, cross.y), (Some(TrackId(7)), Some(6.0), Some(0.0)));
    // Frame 60 is at 5.9 s, frame 61 at 6 s.
    assert_eq!(cross.frame, 61);
    let back = walk(9.0, |t| Some((8.0 - t, 0.0)));
    assert!(words(&events_of(&back)).contains(&"cross gate 2.00 Out".to_owned()));
}

#[test]
fn moments_between_frames_are_interpolated_and_bear_the_frame_before() {
    let lines = walk(9.0, |t| Some((0.03 + t * 0.97, 0.2)));
    for event in events_of(&lines).iter().filter(|e| e.place.as_deref() != Some("door")) {
        let border = match event.kind {
            EventKind::Enter => 2.0,
            EventKind::Leave => 4.0,
            EventKind::Cross => 6.0,
            _ => continue,
        };
        assert!((event.time - (border - 0.03) / 0.97).abs() < 1e-3, "{event:?}");
        assert_eq!(event.frame, (event.time * RATE).floor() as u32 + 1);
        assert_eq!(event.x, Some(border));
    }
}

#[test]
fn who_stands_on_a_border_makes_no_events() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let noise = Normal::new(0.0, 0.03).unwrap();
    for border in [2.0, 6.0] {
        let mut draws: Vec<(f64, f64)> =
            (0..6000).map(|_| (border + noise.sample(&mut rng), noise.sample(&mut rng))).collect();
        draws[0].0 = border + 0.5;
        let events = events_of(&walk(599.9, |t| Some(draws[(t * RATE).round() as usize])));
        // They came from one side, and that is where they are held to be.
        let of_border =
            events.iter().filter(|e| matches!(e.place.as_deref(), Some("counter" | "gate"))).count();
        assert!(of_border <= 1, "{:?}", words(&events));
    }
}

#[test]
fn somebody_lost_for_a_moment_stays_and_one_lost_for_longer_is_taken_back() {
    let standing = |gap: std::ops::Range<f64>| {
        walk(30.0, move |t| {
            (!gap.contains(&t)).then_some(if t < 20.0 { (3.0, 0.0) } else { (3.0 - (t - 20.0), 0.0) })
        })
    };
    let short = words(&events_of(&standing(6.05..7.5)));
    assert_eq!(short[..3], ["appear - 0.00", "enter counter 0.00", "dwell counter 5.00 5.00 s"]);
    assert_eq!(short[3], "leave counter 21.00 21.00 s");
    let events = events_of(&standing(6.05..11.0));
    assert_eq!(
        words(&events)[3..],
        [
            "leave counter 6.00 6.00 s",
            "disappear - 6.00",
            "revoke-disappear - 6.00",
            "revoke-leave counter 6.00 6.00 s",
            "leave counter 21.00 21.00 s",
            "enter door 22.50",
            "leave door 23.50 1.00 s"
        ]
    );
    assert_eq!(events[5].taken_back().as_ref(), Some(&events[4]), "the same fields");
    assert_eq!(events[6].taken_back().as_ref(), Some(&events[3]), "the same fields");
}

#[test]
fn who_goes_through_a_door_and_comes_back_visits_again() {
    let lines = walk(20.0, |t| match t {
        t if t <= 3.0 => Some((3.0 - t, 0.0)),
        t if t < 8.0 => None,
        t => Some(((t - 8.0).min(1.5), 0.0)),
    });
    let words = words(&events_of(&lines));
    assert_eq!(
        words,
        [
            "appear - 0.00",
            "enter counter 0.00",
            "leave counter 1.00 1.00 s",
            "enter door 2.50",
            "leave door 3.00 0.50 s",
            "disappear door 3.00",
            "appear door 8.00",
            "enter door 8.00",
            "leave door 8.50 0.50 s"
        ]
    );
}

#[test]
fn a_stay_that_ends_before_its_dwell_time_is_none_and_a_doubtful_one_is_decided_later() {
    // On the border from 4 s on, and off it after 6 s.
    let doubtful = |end: f64| {
        walk(12.0, move |t| {
            Some(if t < 4.0 {
                (3.0, 0.0)
            } else if t < 7.0 {
                (3.99, 0.0)
            } else {
                (end, 0.0)
            })
        })
    };
    assert!(words(&events_of(&doubtful(3.2))).contains(&"dwell counter 5.00 5.00 s".to_owned()));
    let outside = |t: f64| Some(if t < 4.0 { (3.0, 0.0) } else { (4.02 + 0.1 * (t - 4.0), 0.0) });
    let left = words(&events_of(&walk(12.0, outside)));
    assert!(!left.iter().any(|w| w.starts_with("dwell")), "{left:?}");
    assert!(left.iter().any(|w| w.starts_with("leave counter 4.0")), "{left:?}");
}

#[test]
fn a_change_is_dated_after_the_last_certain_return_and_after_the_dwell() {
    // Just outside from 4 s on, well inside again from 20 to 22 s, then away.
    let returning = |t: f64| match t {
        ..4.0 => (3.0, 0.0),
        ..20.0 => (4.04, 0.0),
        ..22.0 => (3.0, 0.0),
        _ => (5.0, 0.0),
    };
    let events = words(&events_of(&walk(25.0, |t| Some(returning(t)))));
    assert!(events.iter().any(|w| w.starts_with("leave counter 21.9")), "{events:?}");
    // On its inner side for one frame, at which the dwell is certain to have passed.
    let touching = |t: f64| match t {
        ..4.0 => (3.0, 0.0),
        t if (t - 6.0).abs() < 0.01 => (3.99, 0.0),
        ..7.0 => (4.04, 0.0),
        _ => (5.0, 0.0),
    };
    let events = words(&events_of(&walk(10.0, |t| Some(touching(t)))));
    assert!(events.contains(&"dwell counter 5.00 5.00 s".to_owned()), "{events:?}");
    assert!(events.iter().any(|w| w.starts_with("leave counter 6.0")), "{events:?}");
}

#[test]
fn a_stay_that_begins_with_the_path_is_one_however_short() {
    // First seen in the door, 0.2 s before leaving it.
    let lines = walk(5.0, |t| Some((0.3 + t, 0.0)));
    assert_eq!(
        words(&events_of(&lines))[..3],
        ["appear door 0.00", "enter door 0.00", "leave door 0.20 0.20 s"]
    );
    // A path that begins outside and comes in for no longer, is none.
    let wild = |t: f64| Some(if (t - 1.0).abs() < 0.01 { (0.3, 0.0) } else { (1.0, 0.0) });
    assert_eq!(words(&events_of(&walk(5.0, wild))), ["appear - 0.00"]);
}

#[test]
fn what_is_beyond_doubt_when_the_run_ends_is_decided_and_nobody_has_left() {
    // The last frame alone is beyond a border.
    let end = |from: f64| {
        words(&events_of(&walk(2.0, move |t| Some((from + t * 0.1 + 0.4 * (t - 1.95).max(0.0) / 0.05, 0.0)))))
    };
    assert_eq!(end(1.7), ["appear - 0.00", "enter counter 1.93"]);
    assert_eq!(end(3.7), ["appear - 0.00", "enter counter 0.00", "leave counter 1.93 1.93 s"]);
    assert_eq!(end(5.7), ["appear - 0.00", "cross gate 1.93 In"]);
    assert_eq!(end(2.7), ["appear - 0.00", "enter counter 0.00"]);
}

#[test]
fn short_and_doubtful_tracks_are_no_events() {
    assert_eq!(events_of(&walk(5.0, |t| (t < 0.45).then_some((3.0, 0.0)))), []);
    let mut lines = walk(5.0, |_| Some((3.0, 0.0)));
    for line in &mut lines {
        line.people[0].confidence = 0.3;
    }
    assert_eq!(events_of(&lines), []);
}

#[test]
fn narrow_regions_are_entered_however_uncertain_the_position() {
    let mut lines = walk(9.0, |t| Some((t, 0.0)));
    for line in &mut lines {
        line.people[0].sigma = [0.8, 0.8];
    }
    assert!(words(&events_of(&lines)).contains(&"enter counter 2.00".to_owned()));
}

#[test]
fn a_line_is_crossed_within_its_ends_and_once() {
    let around = |t: f64| {
        Some(if t < 1.0 {
            (5.5, 0.0)
        } else if t < 3.0 {
            (5.5 + (t - 1.0) * 0.5, 1.5)
        } else {
            (7.0, 0.0)
        })
    };
    let past = events_of(&walk(5.0, around));
    assert!(!past.iter().any(|e| e.kind == EventKind::Cross), "{:?}", words(&past));
    // Over it, back a little further, and over it again, before anybody could be certain.
    let hesitating = |t: f64| Some((6.0 + [-0.5, 0.03, -0.04, 0.03, 0.5][(t as usize).min(4)], 0.0));
    let crossings: Vec<String> =
        words(&events_of(&walk(8.0, hesitating))).into_iter().filter(|w| w.starts_with("cross")).collect();
    assert_eq!(crossings, ["cross gate 2.96 In"]);
}

#[test]
fn cameras_are_told_when_their_state_lasts() {
    let mut lines = walk(20.0, |_| None);
    let mut set = |seconds: std::ops::Range<f64>, state: Option<CameraState>| {
        for line in lines.iter_mut().filter(|line| seconds.contains(&line.time)) {
            (line.set_aside, line.states) = (vec!["cam1".into()], vec![state]);
        }
    };
    set(0.0..3.0, None);
    set(5.0..5.5, Some(CameraState::Moved));
    set(8.0..12.0, Some(CameraState::Dark));
    let events = events_of(&lines);
    assert_eq!(words(&events), ["camera cam1 8.00", "camera cam1 12.00"]);
    let states: Vec<_> = events.iter().map(|e| e.state).collect();
    assert_eq!(states, [Some(CameraState::Dark), Some(CameraState::Back)]);
    assert!(events[0].text(std::path::Path::new("e")).unwrap().contains(r#""where":"cam1","state":"dark""#));
}
