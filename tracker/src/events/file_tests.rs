//! Event files: the same during the run and after it, complete, and consistent with each other.

use std::path::Path;

use mot::jsonl::FrameLine;

use super::event::EVENTS;
use super::stats::DayStats;
use super::tests::{line, room, walk};
use super::*;

/// A minute in which person 7 walks from the door to the gate, back to the counter, and stays.
fn minute() -> Vec<FrameLine> {
    walk(70.0, |t| {
        Some(match t {
            t if t < 7.0 => (t, 0.0),
            t if t < 11.0 => (7.0 - (t - 7.0), 0.0),
            t if t < 65.0 => (3.0, 0.0),
            _ => return None,
        })
    })
}

/// Folder with a room and the run's `tracks.jsonl`.
fn run(lines: &[FrameLine]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera = scenes::room::RoomCamera {
        name: "cam1".into(),
        camera: calib::Camera {
            intrinsics: calib::Intrinsics::from_horizontal_fov(320, 240, 70.0),
            camera_from_world: nalgebra::Isometry3::translation(0.0, 0.0, 2.0),
        },
        reference: None,
    };
    scenes::room::Room { cameras: vec![camera], ..room() }.write(&folder.path().join("room")).unwrap();
    let text: String = lines.iter().map(|line| line.text(Path::new("tracks.jsonl")).unwrap()).collect();
    std::fs::write(folder.path().join("tracks.jsonl"), text).unwrap();
    folder
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn a_finished_run_gives_the_bytes_of_the_run_itself() {
    let mut lines = minute();
    let clock = Clock::parse("2026-11-26T08:59:50+01:00").unwrap();
    for line in &mut lines {
        line.clock = Some(clock.at(line.time));
    }
    let folder = run(&lines);
    let (online, room_dir) = (folder.path().join("online"), folder.path().join("room"));
    let room = scenes::room::Room::read(&room_dir).unwrap();
    let options = EventFileOptions { counts_every_s: 20.0, ..EventFileOptions::default() };
    let mut files = EventFiles::new(&online, &room, &room_dir, &options).unwrap();
    for (i, line) in lines.iter().enumerate() {
        files.step(line).unwrap();
        if i == 300 {
            // Events and settled counts are on disk while the run goes on.
            assert!(read(&online, EVENTS).contains("cross"));
        }
    }
    files.finish().unwrap();
    of_run(folder.path(), &room_dir, &options).unwrap();
    for name in ["events.jsonl", "counts.csv", "heat.csv", "heat.png", "groups.csv"] {
        assert_eq!(
            std::fs::read(folder.path().join(name)).unwrap(),
            std::fs::read(online.join(name)).unwrap(),
            "{name}"
        );
    }
    let left = std::fs::read_dir(folder.path())
        .unwrap()
        .filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(left.count(), 0, "nothing temporary is left");
    let first: Event = serde_json::from_str(read(folder.path(), EVENTS).lines().next().unwrap()).unwrap();
    assert_eq!(first.clock.as_deref(), Some("2026-11-26T08:59:50.000+01:00"));
}

/// Folder of a run of a minute with its event files, counted every 10 s.
fn minute_with_events() -> tempfile::TempDir {
    let folder = run(&minute());
    let options = EventFileOptions { counts_every_s: 10.0, ..EventFileOptions::default() };
    of_run(folder.path(), &folder.path().join("room"), &options).unwrap();
    folder
}

#[test]
fn counts_and_heat_add_up_to_the_events() {
    let folder = minute_with_events();
    let counts = read(folder.path(), "counts.csv");
    let rows: Vec<Vec<&str>> = counts.lines().skip(1).map(|row| row.split(',').collect()).collect();
    assert_eq!(rows.len(), 7 * 4, "{counts}");
    let at = |time: &str, place: &str| {
        rows.iter().find(|r| r[0] == time && r[1] == place).map(|r| r[2..].join(" "))
    };
    assert_eq!(at("10", "room").as_deref(), Some("1 1 0"));
    assert_eq!(at("10", "gate").as_deref(), Some("0 1 1"), "{counts}");
    assert_eq!(at("10", "counter").as_deref(), Some("1 2 1"), "{counts}");
    assert_eq!(at("70", "counter").as_deref(), Some("0 0 1"), "{counts}");
    assert_eq!(at("70", "room").as_deref(), Some("0 0 1"), "{counts}");
    for place in ["room", "door", "counter", "gate"] {
        let sum: i64 = rows
            .iter()
            .filter(|r| r[1] == place)
            .map(|r| r[3].parse::<i64>().unwrap() - r[4].parse::<i64>().unwrap())
            .sum();
        assert_eq!(at("70", place).unwrap().split(' ').next(), Some(sum.to_string().as_str()), "{place}");
    }
    let heat = read(folder.path(), "heat.csv");
    let seconds = |row: &str| row.rsplit(',').next().unwrap().parse::<f64>().unwrap();
    let total: f64 = heat.lines().skip(1).map(seconds).sum();
    assert!((total - 64.9).abs() < 0.1, "{total}");
    let hottest = heat.lines().skip(1).max_by(|a, b| seconds(a).total_cmp(&seconds(b))).unwrap();
    assert!(hottest.starts_with("3.125,0.125,"), "{hottest}");
}

#[test]
fn the_day_is_told_in_words_and_numbers() {
    let folder = minute_with_events();
    let stats = DayStats::read(folder.path()).unwrap();
    let text = stats.text();
    for words in [
        "00:00:00 to 00:01:10 (1 min 10 s)",
        "People: 1 person came and 1 went; at most 1 at once, first at 00:00:00.",
        "counter: 2 stays, 28 s on average; the longest 55 s (person 7, from 00:00:10)",
        "1 was longer than its dwell_s",
        "gate: 1 in, 1 out, balance 0.",
        "Groups: nobody walked together.",
    ] {
        assert!(text.contains(words), "{words} is not in {text}");
    }
    let csv = stats.csv();
    let counter: Vec<&str> =
        csv.lines().find(|row| row.starts_with("counter,")).unwrap().split(',').collect();
    assert_eq!(counter[1..6], ["2", "2", "0", "1", "2"], "{csv}");
}

#[test]
fn missing_and_malformed_files_are_named_with_the_mend_and_old_results_stay() {
    let folder = run(&minute());
    let room = folder.path().join("room");
    let said = DayStats::read(folder.path()).unwrap_err().to_string();
    assert!(said.contains("events.jsonl") && said.contains("tracker events"), "{said}");
    of_run(folder.path(), &room, &EventFileOptions::default()).unwrap();
    let before = read(folder.path(), EVENTS);
    let tracks = read(folder.path(), "tracks.jsonl");
    std::fs::write(
        folder.path().join("tracks.jsonl"),
        tracks.replacen("\"frame\":9,", "\"frame\":\"x\",", 1),
    )
    .unwrap();
    let said = of_run(folder.path(), &room, &EventFileOptions::default()).unwrap_err().to_string();
    assert!(said.contains("tracks.jsonl: line 9"), "{said}");
    assert_eq!(read(folder.path(), EVENTS), before);
    std::fs::write(folder.path().join(EVENTS), "{\"time\":1}\n").unwrap();
    let said = DayStats::read(folder.path()).unwrap_err().to_string();
    assert!(said.contains("events.jsonl: line 1"), "{said}");
    let nan = EventFileOptions { counts_every_s: f64::NAN, ..EventFileOptions::default() };
    assert!(of_run(folder.path(), &room, &nan).is_err());
}

#[test]
fn people_who_walk_together_are_a_group() {
    let mut groups = Groups::default();
    for frame in 1..=200 {
        let t = f64::from(frame) / 10.0;
        let walker = |id: u32, x: f64, y: f64, vx: f64| {
            let mut lines = walk(0.0, |_| Some((x, y)));
            let mut person = lines.remove(0).people.remove(0);
            (person.id, person.vx) = (crate::TrackId(id), vx);
            person
        };
        // Three abreast, one against them, one who stands.
        let people = vec![
            walker(1, t, 0.0, 1.0),
            walker(2, t, 0.8, 1.0),
            walker(3, t - 0.2, 1.7, 1.0),
            walker(4, 20.0 - t, -0.8, -1.0),
            walker(5, 5.0, -0.5, 0.0),
        ];
        groups.step(&line(frame, people));
    }
    let found = groups.finish();
    assert_eq!(found.len(), 1);
    assert_eq!(found[0].ids, [1, 2, 3].map(crate::TrackId));
    assert!((found[0].first_s - 0.0).abs() < 0.2 && (found[0].last_s - 19.9).abs() < 0.2);
}
