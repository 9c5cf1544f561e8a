//! Outputs of a room whose day ends while people are there, and while the service is stopped.

use std::collections::BTreeSet;
use std::path::Path;

use mot::jsonl::{self, FrameLine};
use scenes::polygon::Polygon;
use scenes::room::{Region, Room};
use scenes::walkable::WalkableMap;

use super::{DailyOutputs, Day, RoomJournal};
use crate::events::{EventFileOptions, EventFiles};
use crate::gathering::LeftOut;
use crate::prepared_room::{Floor, PreparedRoom};
use crate::run::{EventLog, Output, ProcessedMoment};
use crate::tracks::{Persistence, TrackFiles};
use crate::{Moment, PersonEstimate};

const RATE_HZ: f64 = 10.0;

fn day(text: &str) -> Day {
    text.parse().unwrap()
}

/// A room with one region, in which everybody of these tests stands.
fn room() -> Room {
    let polygon = Polygon::rectangle([0.5, 0.5].into(), [3.5, 3.5].into());
    Room { regions: vec![Region { name: "till".into(), polygon, dwell_s: None }], ..Room::default() }
}

/// The same for the outputs, without cameras.
fn prepared() -> PreparedRoom {
    let floor = WalkableMap::of_polygons(&[Polygon::rectangle([0.0, 0.0].into(), [4.0, 4.0].into())]);
    PreparedRoom { cameras: Vec::new(), floor: Floor::new(floor, &[], &[]), zones: Vec::new() }
}

/// Follows one person, with this run's first id, from `first_s` to `last_s` (seconds since 1970); then the run ends, or is
/// cut off.
fn follow(out: &Path, [first_s, last_s]: [f64; 2], is_finished: bool) -> u32 {
    let (prepared, room) = (prepared(), room());
    let journal = RoomJournal::open(out, Day::of(first_s)).unwrap();
    let (clock, id, earlier) = (journal.clock(), journal.next_id(), journal.last_folder());
    let begin = |folder: &Path| {
        let persistence = Persistence::lasting();
        let tracks = TrackFiles::new(folder, &prepared).with_clock(Some(clock)).kept(&persistence);
        let files = EventFiles::new(folder, &room, Path::new("room"), &EventFileOptions::default())?;
        let log = EventLog::new(files.kept(&persistence)?.after(earlier.as_deref())?, &prepared, Some(clock));
        Ok(vec![Box::new(tracks) as Box<dyn Output>, Box::new(log)])
    };
    let mut outputs = DailyOutputs::new(journal, Box::new(begin));
    for frame in 1..=((last_s - first_s) * RATE_HZ) as u32 {
        let time_s = f64::from(frame) / RATE_HZ;
        outputs
            .put(&ProcessedMoment {
                moment: Moment { frame, time_s, cameras: &[] },
                people: &[PersonEstimate::standing(id, 2.0, 2.0)],
                verdicts: &[],
                pictures: &[],
                packets: &[],
                utc_s: Some(first_s + time_s),
                left_out: LeftOut::default(),
            })
            .unwrap();
    }
    if is_finished {
        Box::new(outputs).finish().unwrap();
    }
    id
}

fn rows(out: &Path, day: Day) -> Vec<FrameLine> {
    jsonl::read(&day.folder(out).join(jsonl::NAME)).unwrap()
}

/// Kinds of the events of a day, in their order.
fn events(out: &Path, day: Day) -> Vec<String> {
    let text = std::fs::read_to_string(day.folder(out).join("events.jsonl")).unwrap_or_default();
    let kind = |line: &str| {
        let event: serde_json::Value = serde_json::from_str(line).unwrap();
        event["kind"].as_str().unwrap().to_owned()
    };
    text.lines().map(kind).collect()
}

#[test]
fn a_day_that_ends_while_somebody_is_there_loses_and_doubles_nothing() {
    let out = tempfile::tempdir().unwrap();
    let (first, second) = (day("2026-11-27"), day("2026-11-28"));
    let midnight_s = second.begin_s();
    let id = follow(out.path(), [midnight_s - 5.0, midnight_s + 5.0], true);
    let [before, after] = [first, second].map(|day| rows(out.path(), day));
    assert!(before.iter().all(|row| row.clock.as_deref().unwrap().starts_with("2026-11-27T23:59:5")));
    assert!(after.iter().all(|row| row.clock.as_deref().unwrap().starts_with("2026-11-28T00:00:0")));
    let frames: Vec<u32> = before.iter().chain(&after).map(|row| row.frame).collect();
    assert_eq!(frames, (1..=100).collect::<Vec<u32>>(), "every moment stands in one of the two files");
    let ids: BTreeSet<u32> =
        before.iter().chain(&after).flat_map(|row| &row.people).map(|person| person.id.0).collect();
    assert_eq!(ids, BTreeSet::from([id]));
    // One stay: it begins on the one day and ends on the other.
    let [on_first, on_second] = [first, second].map(|day| events(out.path(), day));
    assert!(
        on_first.contains(&"appear".to_owned()) && on_first.contains(&"enter".to_owned()),
        "{on_first:?}"
    );
    assert!(!on_first.iter().any(|kind| kind == "disappear" || kind == "leave"), "{on_first:?}");
    assert!(!on_second.iter().any(|kind| kind == "appear" || kind == "enter"), "{on_second:?}");
}

#[test]
fn a_service_that_was_cut_off_before_midnight_goes_on_in_the_next_days_folder() {
    let out = tempfile::tempdir().unwrap();
    let (first, second) = (day("2026-11-27"), day("2026-11-28"));
    let midnight_s = second.begin_s();
    let before = follow(out.path(), [midnight_s - 20.0, midnight_s - 10.0], false);
    let after = follow(out.path(), [midnight_s + 10.0, midnight_s + 20.0], true);
    assert!(after > before, "{after} after {before}");
    let [earlier, later] = [first, second].map(|day| rows(out.path(), day));
    assert_eq!((earlier.len(), later.len()), (100, 100));
    assert_eq!(later[0].frame, earlier[99].frame + 1);
    assert!((later[0].time - earlier[99].time - 20.1).abs() < 1e-3, "the times go on with the clock");
}

/// Kinds of the events of several days that are about one person, without crossings.
fn stay(out: &Path, days: &[Day]) -> Vec<String> {
    days.iter().flat_map(|day| events(out, *day)).collect()
}

#[test]
fn a_stay_that_was_cut_off_on_the_day_before_ends_on_that_day() {
    let out = tempfile::tempdir().unwrap();
    let (first, second) = (day("2026-11-27"), day("2026-11-28"));
    let midnight_s = second.begin_s();
    follow(out.path(), [midnight_s - 20.0, midnight_s - 10.0], false);
    assert_eq!(stay(out.path(), &[first]), ["appear", "enter"]);
    follow(out.path(), [midnight_s + 10.0, midnight_s + 20.0], false);
    assert_eq!(stay(out.path(), &[first]), ["appear", "enter", "leave", "disappear"]);
}

#[test]
fn a_stay_that_outlasted_midnight_and_was_then_cut_off_ends_once() {
    let out = tempfile::tempdir().unwrap();
    let (first, second, third) = (day("2026-11-27"), day("2026-11-28"), day("2026-11-29"));
    let midnight_s = second.begin_s();
    follow(out.path(), [midnight_s - 10.0, midnight_s + 10.0], false);
    // The service starts again on the same day, and once more on the next one.
    follow(out.path(), [midnight_s + 60.0, midnight_s + 70.0], false);
    assert_eq!(stay(out.path(), &[first]), ["appear", "enter"]);
    assert_eq!(stay(out.path(), &[second])[..4], ["leave", "disappear", "appear", "enter"]);
    follow(out.path(), [third.begin_s() + 60.0, third.begin_s() + 70.0], true);
    let on_second = stay(out.path(), &[second]);
    assert_eq!(on_second, ["leave", "disappear", "appear", "enter", "leave", "disappear"]);
}
