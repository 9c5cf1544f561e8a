//! Tests of the page of a small run, made from files as `tracker run` writes them.

use super::*;
use crate::film::{Film, FilmOptions, Shot};
use crate::prepared_room::{PreparationOptions, PreparedRoom};
use crate::tracks::{Stopwatch, TrackFiles};
use crate::{PersonEstimate, TrackId};
use calib::{Camera, Intrinsics};
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point3, Vector3};
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera};
use std::fmt::Write;
use std::time::Duration;

/// Number of frames of the run, at 10 a second.
const FRAMES: u32 = 40;

/// Person 1 walks along x; `visible` in the camera falls to 0 in frames 15 to 25.
fn person(frame: u32) -> PersonEstimate {
    PersonEstimate {
        id: TrackId(1),
        x_m: 3.0 + 0.02 * f64::from(frame),
        y_m: 0.2,
        z_m: 0.0,
        radius_m: 0.25,
        height_m: 1.75,
        vx: 0.2,
        vy: 0.0,
        sigma_m: [0.02; 2],
        confidence: 1.0,
        visible: vec![if (15..=25).contains(&frame) { 0.0 } else { 0.4 }],
    }
}

/// A run in `folder`: room, tracks, timings, truth and, if asked for, the film.
fn run_in(folder: &Path, with_film: bool) -> ReportSources {
    let pose =
        Isometry3::face_towards(&Point3::new(0.0, 0.0, 1.6), &Point3::new(4.0, 0.0, 0.9), &-Vector3::z());
    let camera = Camera {
        intrinsics: Intrinsics::from_horizontal_fov(160, 120, 70.0),
        camera_from_world: pose.inverse(),
    };
    let floor = Polygon::rectangle(nalgebra::Point2::new(0.0, -2.0), nalgebra::Point2::new(6.0, 2.0));
    let room = Room {
        cameras: vec![RoomCamera { name: "a<b".into(), camera, reference: None }],
        walkable: Some(vec![floor]),
        ..Room::default()
    };
    let (room_dir, run) = (folder.join("room"), folder.join("out"));
    room.write(&room_dir).unwrap();
    let prepared = PreparedRoom::prepare(&room, &room_dir, &PreparationOptions::default()).unwrap();
    let mut files = TrackFiles::new(&run, &prepared);
    let mut film =
        with_film.then(|| Film::start(&run, &prepared, 10.0, &FilmOptions::default(), None).unwrap());
    let (mut truth, mut watch) = (String::new(), Stopwatch::default());
    for frame in 1..=FRAMES {
        let (who, time) = (person(frame), f64::from(frame - 1) / 10.0);
        writeln!(truth, "{frame},5,-1,-1,-1,-1,1,{:.3},{:.3},0", who.x_m + 0.1, who.y_m).unwrap();
        files.write(frame, time, std::slice::from_ref(&who), &[]).unwrap();
        watch.record("inference", Duration::from_millis(4));
        if let Some(film) = &mut film {
            let image = Some(RgbImage::from_pixel(160, 120, Rgb([120, 130, 140])));
            film.push(frame, time, vec![Shot { image: image.map(Into::into), mask: None }], &[who]).unwrap();
        }
    }
    files.finish().unwrap();
    film.map_or(Ok(()), Film::finish).unwrap();
    watch.timings(2, FRAMES as usize).write(&run.join("timings.json")).unwrap();
    std::fs::write(folder.join("truth.txt"), truth).unwrap();
    ReportSources {
        run,
        room: room_dir.clone(),
        truth: Some(folder.join("truth.txt")),
        truth_room: Some(room_dir),
    }
}

#[test]
fn the_page_is_whole_and_asks_for_nothing() {
    for with_film in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let sources = run_in(folder.path(), with_film);
        let page = folder.path().join("report.html");
        write(&sources, &page, &ReportOptions::default()).unwrap();
        let html = std::fs::read_to_string(&page).unwrap();
        for expected in [
            "<!doctype html>",
            "MOTA",
            "100.00 %",
            "inference",
            "1 person came",
            "People inside: 1 at most",
            "in the room for 3.9 s",
            "Heat map over the floor plan",
            "<summary><h2>How good it is</h2></summary>",
            "class=\"truth\"",
            "class=\"way\"",
            "hidden and still followed",
            "40\u{a0}% of person\u{a0}1 visible",
            "</html>",
        ] {
            assert!(html.contains(expected), "{expected} is missing (film: {with_film})");
        }
        // The plan, and a still of each kind of moment: all embedded in the page.
        assert!(html.matches("data:image/jpeg;base64,").count() >= 3);
        for outside in ["http://", "https://", "src=\"/", "url(", "<script", "@import"] {
            assert!(!html.contains(outside), "{outside}");
        }
        assert!(html.contains("a&lt;b") && !html.contains("a<b"), "names must not become markup");
        for tag in ["svg", "section", "figure", "table", "g"] {
            let (open, close) = (format!("<{tag}"), format!("</{tag}>"));
            let opened =
                html.matches(&format!("{open} ")).count() + html.matches(&format!("{open}>")).count();
            assert_eq!(opened, html.matches(&close).count(), "{tag}");
        }
    }
}

#[test]
fn informative_moments_are_hidden_ones_and_apart_in_time() {
    let folder = tempfile::tempdir().unwrap();
    let recording = RunRecording::read(&run_in(folder.path(), false)).unwrap();
    let chosen = moments::informative(&recording, "a<b", 3);
    assert_eq!(chosen.len(), 3);
    assert!(chosen.is_sorted());
    let visible: Vec<f64> = chosen.iter().map(|i| recording.frames[*i].people[0].visible["a<b"]).collect();
    assert!(visible.iter().any(|v| *v < 0.01) && visible.iter().any(|v| *v > 0.3), "{visible:?}");
    assert!(chosen.windows(2).all(|w| w[1] - w[0] >= 3), "{chosen:?}");
}

#[test]
fn a_run_without_people_or_timings_still_has_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let sources = run_in(folder.path(), false);
    std::fs::write(sources.run.join("tracks.jsonl"), "").unwrap();
    std::fs::write(sources.run.join("tracks.txt"), "").unwrap();
    std::fs::remove_file(sources.run.join("timings.json")).unwrap();
    let page = folder.path().join("report.html");
    write(&sources, &page, &ReportOptions::default()).unwrap();
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("0 frames") && !html.contains("NaN") && !html.contains("Where the time went"));
}

#[test]
fn missing_sources_are_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let sources = run_in(folder.path(), false);
    let page = folder.path().join("report.html");
    let said = |sources: &ReportSources| {
        let error = write(sources, &page, &ReportOptions::default()).unwrap_err().to_string();
        assert!(!page.exists() && error.lines().count() == 1, "{error}");
        error
    };
    let missing = ReportSources { run: folder.path().join("nowhere"), ..sources.clone() };
    assert!(said(&missing).contains("nowhere"));
    std::fs::write(sources.run.join("timings.json"), "{").unwrap();
    assert!(said(&sources).contains("timings.json"));
    std::fs::remove_file(sources.run.join("timings.json")).unwrap();
    std::fs::write(folder.path().join("truth.txt"), "1,1,-1,-1,-1,-1,1,x,0,0\n").unwrap();
    assert!(said(&sources).contains("line 1"));
}

#[test]
fn a_room_that_is_not_the_runs_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let sources = run_in(folder.path(), false);
    let page = folder.path().join("report.html");
    let said = |room: &Room| {
        let other = folder.path().join("other");
        room.write(&other).unwrap();
        let sources = ReportSources { room: other, truth: None, truth_room: None, ..sources.clone() };
        let refused = write(&sources, &page, &ReportOptions::default());
        refused.map_err(|e| e.to_string())
    };
    let mut room = Room::read(&sources.room).unwrap();
    // Half a centimetre aside is the same room for all that a page can show; 10 cm is not.
    room.cameras[0].camera.camera_from_world.translation.vector.x += 0.005;
    said(&room).unwrap();
    std::fs::remove_file(&page).unwrap();
    room.cameras[0].camera.camera_from_world.translation.vector.x += 0.2;
    let moved = said(&room).unwrap_err();
    assert!(
        moved.contains("other") && moved.contains("camera `a<b`") && moved.contains("frame 1"),
        "{moved}"
    );
    room.cameras[0].name = "b".into();
    let renamed = said(&room).unwrap_err();
    assert!(renamed.contains("other") && renamed.lines().count() == 1, "{renamed}");
    let second = RoomCamera { name: "c".into(), ..room.cameras[0].clone() };
    let mut lines = std::fs::read_to_string(sources.run.join("tracks.jsonl")).unwrap();
    lines = lines.replace("\"a<b\":", "\"b\":0.5,\"d\":");
    std::fs::write(sources.run.join("tracks.jsonl"), lines).unwrap();
    std::fs::remove_dir_all(sources.run.join("boxes")).unwrap();
    room.cameras.push(second);
    let missing = said(&room).unwrap_err();
    assert!(missing.contains("camera `d`") && missing.contains("not here"), "{missing}");
    assert!(!page.exists());
}
