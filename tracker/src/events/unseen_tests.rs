//! Events of what no fix shows: ways through doors before a track begins and after it ends, and gaps of tracks.

use mot::jsonl::{FrameLine, PersonLine};
use nalgebra::Point2;
use scenes::room::{Line, Room, ZoneKind};

use super::tests::{RATE, events_of, line, person, room, walk, words};
use super::*;

#[test]
fn a_line_in_a_door_is_crossed_by_who_is_first_or_last_seen_behind_it() {
    let mut room = room();
    // Three sides of the door lie in walls; the line is 30 cm from the outer one.
    let points = vec![Point2::new(-0.2, -1.0), Point2::new(-0.2, 1.0)];
    room.lines = vec![Line { name: "threshold".into(), points }];
    let crossings = |lines: &[FrameLine], room: &Room| {
        let mut events = Events::new(room, EventOptions::default());
        let mut all: Vec<Event> = lines.iter().flat_map(|line| events.step(line)).collect();
        all.extend(events.finish());
        let crossed = all.into_iter().filter(|e| e.kind == EventKind::Cross);
        words(&crossed.collect::<Vec<_>>())
    };
    let walking = |from: f64, speed: f64| {
        let mut lines = walk(6.0, |t| (1.0..4.0).contains(&t).then_some((from + speed * (t - 1.0), 0.0)));
        for person in lines.iter_mut().flat_map(|line| &mut line.people) {
            person.vx = speed;
        }
        lines
    };
    assert_eq!(crossings(&walking(0.0, 1.0), &room), ["cross threshold 0.80 In"]);
    // The last fix is at 3.9 s.
    assert_eq!(crossings(&walking(2.9, -1.0), &room), ["cross threshold 4.10 Out"]);
    // A line on the outer border itself.
    let mut outer = room.clone();
    outer.lines[0].points = vec![Point2::new(-0.5, -1.0), Point2::new(-0.5, 1.0)];
    assert_eq!(crossings(&walking(0.0, 1.0), &outer), ["cross threshold 0.50 In"]);
    assert_eq!(crossings(&walking(2.9, -1.0), &outer), ["cross threshold 4.40 Out"]);
    // Nobody comes in through an exit; whoever stands has not walked.
    assert_eq!(crossings(&walking(0.0, 0.0), &room), Vec::<String>::new());
    room.zones[0].kind = ZoneKind::Exit;
    assert_eq!(crossings(&walking(0.0, 1.0), &room), Vec::<String>::new());
}

#[test]
fn a_person_last_seen_walking_to_a_door_has_left_through_it_unless_the_track_goes_on() {
    // From x = 3.2 toward the door at 1 m/s; last seen at 3 s, 70 cm before it.
    let lines = |speed: f64, back_s: f64| {
        let mut lines = walk(12.0, |t| {
            (1.0..3.05)
                .contains(&t)
                .then_some((1.2 + speed * (t - 3.0), 0.0))
                .or((t >= back_s).then_some((1.2, 0.0)))
        });
        for person in lines.iter_mut().flat_map(|line| &mut line.people) {
            person.vx = speed;
        }
        words(&events_of(&lines))
    };
    let left = lines(-1.0, 99.0);
    assert_eq!(left[3..], ["enter door 3.70", "leave door 4.70 1.00 s", "disappear door 3.00"], "{left:?}");
    let back = lines(-1.0, 7.0);
    assert_eq!(back[6..8], ["revoke-disappear door 3.00", "revoke-leave door 4.70 1.00 s"], "{back:?}");
    assert!(!lines(-0.1, 99.0).iter().any(|w| w.contains("door")), "too slow to get there");
    assert!(!lines(1.0, 99.0).iter().any(|w| w.contains("leave door 4")), "walking away from it");
}

#[test]
fn a_person_first_seen_walking_from_a_door_has_come_through_it() {
    // From x = 1.23, 73 cm behind the door, eastward at 1 m/s, first seen at 3 s.
    let mut lines = walk(6.0, |t| (t >= 3.0).then_some((1.23 + t - 3.0, 0.0)));
    for person in lines.iter_mut().flat_map(|line| &mut line.people) {
        person.vx = 1.0;
    }
    let events = events_of(&lines);
    let told = words(&events);
    assert_eq!(told[..3], ["appear door 3.00", "enter door 1.30", "leave door 2.27 0.97 s"], "{told:?}");
    // Each bears the last frame that is not after it, also where the person was not seen yet.
    for event in &events {
        assert_eq!(event.frame, (event.time * RATE + 1e-6).floor() as u32 + 1, "{event:?}");
    }
    // Somebody who is there in the first line has not come during the run.
    let since_first: Vec<FrameLine> = lines.split_off(30);
    assert_eq!(words(&events_of(&since_first))[0], "appear - 3.00");
}

/// Straight through the counter at 1.5 m/s, from 1.33 s to 2.67 s; the track has a gap meanwhile, and the run goes on.
#[test]
fn a_region_that_is_passed_in_a_gap_of_the_track_is_entered_and_left() {
    let mut lines = walk(5.0, |t| (!(1.15..2.85).contains(&t)).then_some((3.0, -3.0 + 1.5 * t)));
    for person in lines.iter_mut().flat_map(|line| &mut line.people) {
        person.vy = 1.5;
    }
    let events = events_of(&lines);
    assert_eq!(words(&events), ["appear - 0.00", "enter counter 1.33", "leave counter 2.67 1.33 s"]);
    assert_eq!(events.iter().map(|event| event.frame).collect::<Vec<_>>(), [1, 14, 27]);
    // Beside it, and when the run has no lines meanwhile, nothing is told.
    for line in &mut lines {
        line.people.iter_mut().for_each(|person| person.x = 4.3);
    }
    assert_eq!(words(&events_of(&lines)), ["appear - 0.00"]);
    lines.retain(|line| !line.people.is_empty());
    lines.iter_mut().flat_map(|line| &mut line.people).for_each(|person| person.x = 3.0);
    assert_eq!(words(&events_of(&lines)), ["appear - 0.00"]);
}

/// The path of a gap leads from where the person was seen to where they are seen next, and either may be wrong.
#[test]
fn a_single_wild_position_at_an_end_of_a_gap_decides_nothing() {
    for gap_s in [0.4, 1.0, 1.6] {
        let (begin_s, end_s) = (4.95 - gap_s, 4.95);
        for wild_s in [begin_s - 0.05, end_s + 0.05] {
            let mut lines = walk(8.0, |t| {
                let x = if (t - wild_s).abs() < 0.04 { 2.5 } else { 1.7 };
                (!(begin_s..end_s).contains(&t)).then_some((x, 0.0))
            });
            for person in lines.iter_mut().flat_map(|line| &mut line.people) {
                (person.vx, person.vy) = (0.3, 0.1);
            }
            assert_eq!(words(&events_of(&lines)), ["appear - 0.00"], "gap of {gap_s} s, wild at {wild_s} s");
        }
    }
}

/// Positions between the frames of a low rate lie on the path, but nobody was looked for there.
#[test]
fn a_single_wild_position_decides_nothing_at_a_low_rate_either() {
    let lines: Vec<FrameLine> = (1..=40)
        .map(|frame| {
            let time_s = f64::from(frame - 1) * 0.5;
            let x = if frame == 20 { 2.5 } else { 1.7 };
            let people = vec![PersonLine { vx: 0.3, vy: 0.1, ..person(7, x, 0.0) }];
            FrameLine { time: time_s, ..line(frame, people) }
        })
        .collect();
    assert_eq!(words(&events_of(&lines)), ["appear - 0.00"]);
}
