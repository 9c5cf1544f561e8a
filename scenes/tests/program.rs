//! The program `scenes` as a person runs it: output, exit status, and what it says when something is wrong.
#![allow(clippy::unwrap_used)] // a test that cannot go on should stop

use std::path::Path;
use std::process::{Command, Output, Stdio};

use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use scenes::depth::png;
use scenes::geometry::{Disc, Geometry};
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera, Zone, ZoneKind};
use tempfile::TempDir;

/// A floor of four square metres below a camera that looks straight down at its middle.
fn room() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (eye, target) = (Point3::new(1.0, 1.0, 2.5), Point3::new(1.0, 1.0, 0.0));
    let camera_from_world = Isometry3::face_towards(&eye, &target, &-Vector3::y()).inverse();
    let camera = Camera { intrinsics: Intrinsics::from_horizontal_fov(64, 48, 60.0), camera_from_world };
    let disc = |i: u32| Disc {
        center: Vec3::new(0.05 + 0.1 * (i % 20) as f32, 0.05 + 0.1 * (i / 20) as f32, 0.0),
        normal: Vec3::Z,
        radius: 0.08,
        color: [100; 3],
        filled: false,
    };
    let zone = |name: &str, x: f64| Zone {
        name: name.into(),
        polygon: Polygon::rectangle(Point2::new(x, 0.2), Point2::new(x + 0.5, 0.7)),
        kind: ZoneKind::Entry,
    };
    Room {
        cameras: vec![RoomCamera { name: "up".into(), camera, reference: Some("reference/up.jpg".into()) }],
        zones: vec![zone("door", 0.1)],
        walkable: None,
        geometry: Some(Geometry::Discs((0..400).map(disc).collect())),
    }
    .write(folder.path())
    .unwrap();
    folder
}

fn scenes(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_scenes")).args(arguments).output().unwrap()
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The error of a failed run: a line (warnings aside), no panic.
fn complaint(arguments: &[&str], status: i32) -> String {
    let output = scenes(arguments);
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(status), "{said}");
    assert_eq!(said.lines().filter(|line| !line.contains("WARN")).count(), 1, "{said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

#[test]
fn check_prints_what_is_in_the_room() {
    let folder = room();
    let output = scenes(&["check", path(folder.path())]);
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8(output.stdout).unwrap();
    for part in [
        "up: 64 × 48",
        "2.500 m above the floor",
        "400 discs",
        "door: 0.25 m², people enter",
        "m² to stand on",
    ] {
        assert!(said.contains(part), "no `{part}` in:\n{said}");
    }
    // A reference image that is not there is worth a warning.
    assert!(String::from_utf8(output.stderr).unwrap().contains("reference"));
}

#[test]
fn check_exits_with_1_and_says_what_is_wrong() {
    let folder = room();
    assert!(complaint(&["check", "/nowhere/room"], 1).contains("no such room directory"));
    let ply = folder.path().join("room.ply");
    let bytes = std::fs::read(&ply).unwrap();
    std::fs::write(&ply, &bytes[..bytes.len() / 2]).unwrap();
    let said = complaint(&["check", path(folder.path())], 1);
    assert!(said.contains("room.ply: element vertex") && said.contains("cut off"), "{said}");
    let scene = folder.path().join("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    std::fs::write(&scene, text.replace("translation", "transition")).unwrap();
    let said = complaint(&["check", path(folder.path())], 1);
    assert!(said.contains("scene.toml: line") && said.contains("transition"), "{said}");
}

#[test]
fn depth_writes_millimetres() {
    let folder = room();
    let out = folder.path().join("new/depth.png");
    let output = scenes(&["depth", path(folder.path()), "--camera", "up", "--out", path(&out)]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let map = png::read(&out).unwrap();
    assert_eq!((map.width, map.height), (64, 48));
    assert!((map.at(32, 24) - 2.5).abs() < 1e-6, "{}", map.at(32, 24));
}

#[test]
fn misuse_exits_with_2_and_writes_nothing() {
    let folder = room();
    let (dir, out) = (path(folder.path()), folder.path().join("depth.png"));
    let said = complaint(&["depth", dir, "--camera", "down", "--out", path(&out)], 2);
    assert!(said.contains("`down`") && said.contains("`up`"), "{said}");
    assert!(complaint(&["depth", "/nowhere", "--camera", "up", "--out", path(&out)], 2).contains("/nowhere"));
    assert!(!out.exists());
    // A folder in the way.
    std::fs::create_dir(&out).unwrap();
    assert!(complaint(&["depth", dir, "--camera", "up", "--out", path(&out)], 2).contains("depth.png"));
    assert_eq!(scenes(&["depth", dir]).status.code(), Some(2));
    assert_eq!(scenes(&[]).status.code(), Some(2));
    assert_eq!(scenes(&["--help"]).status.code(), Some(0));
}

#[test]
fn a_reader_who_leaves_is_no_failure() {
    let folder = room();
    let mut child = Command::new(env!("CARGO_BIN_EXE_scenes"))
        .args(["check", path(folder.path())])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(!said.contains("panicked"), "{said}");
}
