//! Cameras that freeze or go dark for a while are excluded, taken back, and reported.

use std::path::Path;

use image::RgbImage;
use synthetic::{RoomOptions, SequenceOptions, WalkerOptions};
use tests::data::program;

/// Frames, from 1, in which `cam0` repeats frame 19…
const FROZEN: std::ops::RangeInclusive<u32> = 20..=36;
/// …and in which `cam1` is covered.
const COVERED: std::ops::RangeInclusive<u32> = 45..=52;

/// Two cameras' pictures of a room with a person in it, with the failures.
fn recorded(folder: &Path) {
    let made = RoomOptions { seed: 5, image_px: [160, 120], ..RoomOptions::default() }.build().unwrap();
    let walkers = made.walkers(&WalkerOptions { people: 1, first_s: 0.0, ..WalkerOptions::default() });
    let options = SequenceOptions { rate_hz: 10.0, frames: 70, ..SequenceOptions::default() };
    made.room.write(&folder.join("room")).unwrap();
    let mut latest = RgbImage::default();
    for frame in made.sequence(walkers, options).frames() {
        for (camera, seen) in frame.cameras.into_iter().enumerate() {
            let mut picture = seen.image.unwrap();
            match camera {
                0 if FROZEN.contains(&frame.frame) => picture.clone_from(&latest),
                0 => latest.clone_from(&picture),
                _ if COVERED.contains(&frame.frame) => picture.fill(2),
                _ => {}
            }
            let own = folder.join(format!("cam{camera}"));
            std::fs::create_dir_all(&own).unwrap();
            picture.save(own.join(format!("{:03}.png", frame.frame))).unwrap();
        }
    }
}

#[test]
fn a_frozen_and_a_covered_camera_are_set_aside_and_taken_back() {
    let folder = tempfile::tempdir().unwrap();
    recorded(folder.path());
    let output = program("tracker")
        .current_dir(folder.path())
        .args(["run", "room", "--video", "cam0=cam0", "--video", "cam1=cam1", "--rate", "10"])
        .args(["--no-film", "--out", "out"])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    for line in [
        "camera `cam0`: taken back at frame 37",
        "camera `cam1`: set aside from frame 45: dark",
        "camera `cam1`: taken back at frame 53",
    ] {
        assert!(said.contains(line), "`{line}` is not in: {said}");
    }
    let lines = std::fs::read_to_string(folder.path().join("out/tracks.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> =
        lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines.len(), 70);
    for line in &lines {
        let frame = u32::try_from(line["frame"].as_u64().unwrap()).unwrap();
        let aside = &line["set_aside"];
        // A camera is frozen when it has repeated itself for half a second.
        let expected = match frame {
            26..=36 => serde_json::json!(["cam0"]),
            45..=52 => serde_json::json!(["cam1"]),
            20..=25 => continue,
            _ => serde_json::Value::Null,
        };
        assert_eq!(*aside, expected, "frame {frame}");
    }
    assert!(said.contains("camera `cam0`: set aside from frame 2"), "{said}");
}
