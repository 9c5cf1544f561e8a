//! Cameras on different clocks: office videos with another rate or start, against the truth.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use calib::video::{FilmWriter, FrameSource};
use image::RgbImage;
use synthetic::{RoomOptions, SequenceOptions, WalkerOptions};
use tests::chain::{StepResult, Tracking, evaluate_against, track_videos};
use tests::data::{office, program};

/// Every `step`-th frame of an office video from frame `first` (from 1) on, as a film of the rate that keeps its speed.
fn retimed(name: &str, first: usize, step: usize, folder: &Path) -> PathBuf {
    let path = folder.join(format!("{name}_{first}_{step}.mp4"));
    let video = office().join(format!("video/{name}.mp4"));
    let mut source = FrameSource::open(video.to_str().unwrap()).unwrap();
    let (width, height) = source.size();
    let mut film = FilmWriter::create(&path, width, height, 12.0 / step as f64).unwrap();
    let (mut frame, mut number) = (RgbImage::default(), 0);
    while source.read(&mut frame).unwrap() {
        number += 1;
        if number >= first && (number - first).is_multiple_of(step) {
            film.write(&frame).unwrap();
        }
    }
    film.finish().unwrap();
    path
}

/// The office's truth at every `step`-th frame, numbered as there.
fn truth(first: usize, step: usize, folder: &Path) -> PathBuf {
    let text = std::fs::read_to_string(office().join("truth.txt")).unwrap();
    let rows = text.lines().filter_map(|line| {
        let (frame, rest) = line.split_once(',')?;
        let frame: usize = frame.trim().parse().ok()?;
        let is_kept = frame >= first && (frame - first).is_multiple_of(step);
        is_kept.then(|| format!("{},{rest}\n", if step == 1 { frame } else { (frame - first) / step + 1 }))
    });
    let path = folder.join("truth.txt");
    std::fs::write(&path, rows.collect::<String>()).unwrap();
    path
}

fn tracked(videos: [&Path; 2], truth: &Path, folder: &Path, options: &[&str]) -> StepResult<Tracking> {
    let (room, out) = (office().join("room"), folder.join("out"));
    track_videos(&room, &[("cam0", videos[0]), ("cam1", videos[1])], &out, options)?;
    evaluate_against(truth, &room, &room, &out)
}

#[test]
fn a_camera_of_half_the_rate_is_matched_by_time() {
    let scratch = tempfile::tempdir().unwrap();
    let fast = office().join("video/cam0.mp4");
    let slow = retimed("cam1", 1, 2, scratch.path());
    let truth = truth(1, 1, scratch.path());
    let found = tracked([&fast, &slow], &truth, scratch.path(), &[]).unwrap();
    assert!(found.mota >= 85.0 && found.mean_m <= 0.12, "{found:?}");
    // With the rate of the film's header, frames do not match.
    let wrong = tracked([&fast, &slow], &truth, scratch.path(), &["--rate", "12"]).unwrap();
    assert!(wrong.mota < found.mota - 30.0, "{wrong:?}");
}

#[test]
fn a_camera_that_began_later_is_matched_by_its_offset() {
    let scratch = tempfile::tempdir().unwrap();
    let early = office().join("video/cam0.mp4");
    let late = retimed("cam1", 13, 1, scratch.path());
    let truth = truth(13, 1, scratch.path());
    let found = tracked([&early, &late], &truth, scratch.path(), &["--offset", "cam1=1"]).unwrap();
    assert!(found.mota >= 90.0 && found.mean_m <= 0.10, "{found:?}");
    // The same offset, given for the other camera: the tracks' frames are those of `cam0`.
    let same = tracked([&early, &late], &truth, scratch.path(), &["--offset", "cam0=-1"]).unwrap();
    assert!((same.mota - found.mota).abs() < 1e-9, "{same:?} against {found:?}");
    let wrong = tracked([&early, &late], &truth, scratch.path(), &[]).unwrap();
    assert!(wrong.mota < found.mota - 30.0, "{wrong:?}");
}

#[test]
fn three_frames_a_second_are_enough() {
    let scratch = tempfile::tempdir().unwrap();
    let videos = ["cam0", "cam1"].map(|name| retimed(name, 1, 4, scratch.path()));
    let truth = truth(1, 4, scratch.path());
    let found = tracked([&videos[0], &videos[1]], &truth, scratch.path(), &[]).unwrap();
    assert!(found.mota >= 80.0 && found.mean_m <= 0.12, "{found:?}");
}

#[test]
fn sixty_frames_a_second_are_not_too_many() {
    let scratch = tempfile::tempdir().unwrap();
    let made = RoomOptions { seed: 5, image_px: [160, 120], ..RoomOptions::default() }.build().unwrap();
    let walkers = made.walkers(&WalkerOptions { people: 2, first_s: 0.5, ..WalkerOptions::default() });
    let options = SequenceOptions { rate_hz: 60.0, frames: 480, images: false, ..SequenceOptions::default() };
    let sequence = made.sequence(walkers, options);
    let (room, out) = (scratch.path().join("room"), scratch.path().join("out"));
    made.room.write(&room).unwrap();
    let masks = |camera: usize| scratch.path().join(format!("cam{camera}"));
    for camera in [0, 1] {
        std::fs::create_dir(masks(camera)).unwrap();
    }
    // People count from the first frame in which a camera has seen them.
    let (mut seen_once, mut rows) = (BTreeSet::new(), String::new());
    for frame in sequence.frames() {
        for person in frame.people.iter().filter(|person| person.inside) {
            if seen_once.contains(&person.id) || person.visible.iter().any(|part| *part >= 0.2) {
                seen_once.insert(person.id);
                let (x, y) = (person.place.x, person.place.y);
                writeln!(rows, "{},{},-1,-1,-1,-1,1,{x:.4},{y:.4},0", frame.frame, person.id).unwrap();
            }
        }
        for (camera, seen) in frame.cameras.iter().enumerate() {
            seen.mask.save(masks(camera).join(format!("{:04}.png", frame.frame))).unwrap();
        }
    }
    let truth = scratch.path().join("truth.txt");
    std::fs::write(&truth, rows).unwrap();
    let output = program("tracker")
        .arg("run")
        .arg(&room)
        .args([0, 1].map(|camera| format!("--masks=cam{camera}={}", masks(camera).display())))
        .args(["--rate", "60", "--no-film", "--out"])
        .arg(&out)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found = evaluate_against(&truth, &room, &room, &out).unwrap();
    assert!(found.mota >= 90.0 && found.mean_m <= 0.10, "{found:?}");
}
