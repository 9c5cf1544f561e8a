//! Events of the office: written by the run and by `tracker events` alike, told by `tracker stats`; and refusals.

use std::fs;
use std::path::Path;

use tests::chain::{run, track};
use tests::data::{office, program};
use tracker::events::{Event, EventKind};

use crate::folder::Folder;
use crate::refusal::refused;

/// A region in the middle of the office, and a line across it; doors are at its two ends.
const MARKINGS: &str = r#"
[[region]]
name = "middle"
polygon = [[1.5, 1.0], [4.5, 1.0], [4.5, 4.0], [1.5, 4.0]]
dwell_s = 2.0

[[line]]
name = "half"
points = [[3.0, 0.0], [3.0, 5.0]]
"#;

const FILES: [&str; 5] = ["events.jsonl", "counts.csv", "heat.csv", "heat.png", "groups.csv"];

fn marked_office(room: &Path) {
    fs::create_dir_all(room).unwrap();
    let office = office().join("room");
    fs::copy(office.join("room.ply"), room.join("room.ply")).unwrap();
    let scene = fs::read_to_string(office.join("scene.toml")).unwrap();
    fs::write(room.join("scene.toml"), scene + MARKINGS).unwrap();
}

#[test]
fn a_run_tells_what_happened_and_tracker_events_tells_the_same() {
    let scratch = tempfile::tempdir().unwrap();
    let (room, out) = (scratch.path().join("room"), scratch.path().join("out"));
    marked_office(&room);
    let options = ["--start", "2026-11-26T08:59:50+01:00", "--counts-every", "10"];
    track(&office(), &room, &out, &options).unwrap();
    let files = || FILES.map(|name| fs::read(out.join(name)).unwrap());
    let of_the_run = files();
    for name in FILES {
        fs::remove_file(out.join(name)).unwrap();
    }
    let mut events = program("tracker");
    let told =
        run(events.arg("events").arg(&out).arg("--room").arg(&room).args(["--counts-every", "10"])).unwrap();
    assert!(files() == of_the_run, "the bytes differ");
    assert!(told.contains("half: ") && told.contains("09:00:"), "{told}");
    assert_eq!(run(program("tracker").arg("stats").arg(&out)).unwrap(), told);

    let text = fs::read_to_string(out.join("events.jsonl")).unwrap();
    let events: Vec<Event> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(events.iter().all(|event| event.clock.as_deref().is_some_and(|c| c.starts_with("2026-11-26T"))));
    // Each of the three people crosses the room from door to door, by the truth; ids may change on the way.
    let appeared: Vec<&Event> = events.iter().filter(|e| e.kind == EventKind::Appear).collect();
    assert!(appeared.len() >= 3, "{text}");
    assert!(
        appeared.iter().take(3).all(|e| e.place.as_deref().is_some_and(|p| p.starts_with("door"))),
        "{text}"
    );
    let rows = fs::read_to_string(out.join("counts.csv")).unwrap();
    assert!(rows.starts_with("time,where,inside,in,out\n10,room,"), "{rows}");
    let csv = run(program("tracker").arg("stats").arg(&out).arg("--csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 5, "{csv}");

    // Events of an earlier run would not belong to the new tracks.
    track(&office(), &room, &out, &["--events=off", "--seed", "2"]).unwrap();
    assert!(FILES.iter().all(|name| !out.join(name).exists()));
}

#[test]
fn what_cannot_be_told_is_refused_with_its_place_and_mend() {
    let folder = Folder::new();
    marked_office(&folder.path("room"));
    let frame = "{\"frame\":1,\"time\":0.0,\"people\":[]}\n";
    folder.write("out/tracks.jsonl", frame.to_owned() + "{\"frame\":2}\n");
    let tracker = |arguments: &[&str]| folder.run_program("tracker", arguments);
    refused(&tracker(&["events", "out", "--room", "room"]), &["tracks.jsonl: line 2", "time"]);
    refused(&tracker(&["events", "nowhere", "--room", "room"]), &["nowhere/tracks.jsonl"]);
    refused(&tracker(&["stats", "out"]), &["events.jsonl", "tracker events OUT --room DIR"]);
    folder.write("out/tracks.jsonl", frame);
    let never = ["events", "out", "--room", "room", "--counts-every", "0"];
    refused(&tracker(&never), &["--counts-every: is 0", "at least 0.1"]);
    let scene = fs::read_to_string(folder.path("room/scene.toml")).unwrap();
    for (bad, words) in [
        (
            scene.replace("[[3.0, 0.0], [3.0, 5.0]]", "[[3.0, 0.0]]"),
            "line 1 (`half`): a line needs at least 2 points",
        ),
        (scene.replace("\"half\"", "\"middle\""), "another region has the same name"),
        (scene.replace("dwell_s = 2.0", "dwell_s = nan"), "region 1 (`middle`): dwell_s is NaN"),
        (scene.replace("dwell_s = 2.0", "dwel_s = 2.0"), "dwel_s"),
    ] {
        assert_ne!(bad, scene);
        folder.write("room/scene.toml", bad);
        refused(&tracker(&["events", "out", "--room", "room"]), &["scene.toml", words]);
    }
    assert!(!folder.path("out/events.jsonl").exists());
}
