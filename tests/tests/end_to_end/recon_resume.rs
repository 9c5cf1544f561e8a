//! `recon build` of a synthetic room that is interrupted: what was finished is kept, and the room comes out as if nothing
//! had happened.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use calib::Camera;
use glam::Vec3;
use nalgebra::{Point2, Point3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::raycast::RayScene;
use scenes::room::Room;
use scenes::synthetic::{CaptureOptions, RoomOptions, SyntheticRoom};
use tests::accuracy::{camera_against_floor, relative_pose};
use tests::data::program;

/// Films the room and writes a capture project with picks to within half a pixel.
fn project(folder: &Path, room: &SyntheticRoom) {
    let cameras: Vec<&Camera> = room.room.cameras.iter().map(|c| &c.camera).collect();
    let mut text = String::new();
    for (seed, entry) in (1..).zip(&room.room.cameras) {
        let name = &entry.name;
        let options = CaptureOptions { seed, frames: 24, ..CaptureOptions::default() };
        let (frames, _) = room.capture(&entry.camera, &options);
        fs::create_dir(folder.join(name)).unwrap();
        for (i, frame) in frames.iter().enumerate() {
            frame.save(folder.join(name).join(format!("{i:02}.png"))).unwrap();
        }
        calib::files::write_intrinsics(&folder.join(format!("{name}.toml")), &entry.camera.intrinsics)
            .unwrap();
        writeln!(text, "[[camera]]\nname = \"{name}\"\ncapture = \"{name}\"\nintrinsics = \"{name}.toml\"")
            .unwrap();
    }
    for [a, b] in picks(room, [cameras[0], cameras[1]]) {
        writeln!(text, "[[point]]\ncam0 = [{}, {}]\ncam1 = [{}, {}]", a.x, a.y, b.x, b.y).unwrap();
    }
    writeln!(text, "[scale]\ncamera = \"cam0\"\nheight = {}", cameras[0].center().z).unwrap();
    fs::write(folder.join("room.toml"), text).unwrap();
}

/// Places that both cameras see, well inside both images.
fn picks(room: &SyntheticRoom, [a, b]: [&Camera; 2]) -> Vec<[Point2<f64>; 2]> {
    let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
    let single = |p: Point3<f64>| Vec3::new(p.x as f32, p.y as f32, p.z as f32);
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut picks = Vec::new();
    while picks.len() < 14 {
        let pixel = Point2::new(rng.random_range(16.0..240.0), rng.random_range(16.0..176.0));
        let ray = a.camera_from_world.rotation.inverse() * a.intrinsics.unproject(&pixel).unwrap();
        let Some(hit) = scene.cast(single(a.center()), single(Point3::from(ray))) else { continue };
        let place = a.center() + ray * f64::from(hit.distance);
        let inside = |p: &Point2<f64>| (16.0..240.0).contains(&p.x) && (16.0..176.0).contains(&p.y);
        let Some(other) = b.project(&place).filter(inside) else { continue };
        if !scene.is_blocked(single(b.center()), single(place)) {
            picks.push([pixel, other]);
        }
    }
    picks
}

fn recon(folder: &Path) -> Command {
    let mut recon = program("recon");
    recon.current_dir(folder).args(["build", "room.toml", "--out", "room"]);
    recon
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn an_interrupted_build_goes_on_where_it_ended() {
    let scratch = tempfile::tempdir().unwrap();
    let folder = scratch.path();
    let truth = RoomOptions { seed: 4, image_px: [256, 192], ..RoomOptions::default() }.build().unwrap();
    project(folder, &truth);

    let mut interrupted = recon(folder).stderr(Stdio::null()).spawn().unwrap();
    let (first, started) = (folder.join("room.unfinished/cache/capture_cam0.bin"), Instant::now());
    while !first.exists() {
        assert!(interrupted.try_wait().unwrap().is_none(), "the build ended by itself");
        assert!(started.elapsed() < Duration::from_mins(5), "nothing is kept");
        std::thread::sleep(Duration::from_millis(20));
    }
    interrupted.kill().unwrap();
    interrupted.wait().unwrap();
    assert!(!folder.join("room").exists(), "half a room");

    let resumed = recon(folder).output().unwrap();
    let text = said(&resumed);
    assert!(resumed.status.success(), "{text}");
    assert!(text.contains("cam0: depth kept") && !text.contains("cam1: depth kept"), "{text}");
    assert!(!folder.join("room.unfinished").exists(), "something was left beside the room");
    let files = |names: [&str; 4]| names.map(|name| fs::read(folder.join("room").join(name)).unwrap());
    let names = ["scene.toml", "room.ply", "plan.png", "preview/cam1.png"];
    let before = files(names);

    let again = recon(folder).output().unwrap();
    let text = said(&again);
    assert!(again.status.success() && text.contains("cam1: depth kept"), "{text}");
    assert!(before == files(names), "a kept camera is not the camera that was kept");
    let other_seed = recon(folder).args(["--seed", "x"]).output().unwrap();
    assert_eq!(other_seed.status.code(), Some(2));

    let built = Room::read(&folder.join("room")).unwrap();
    let cameras = |room: &Room| [0, 1].map(|i| room.cameras[i].camera.clone());
    let ([a, b], [true_a, true_b]) = (cameras(&built), cameras(&truth.room));
    let relative = relative_pose([&a, &b], [&true_a, &true_b]);
    let floor = camera_against_floor(&b, &true_b);
    eprintln!("{relative:?} {floor:?}");
    assert!(relative.position_cm < 9.0 && relative.rotation_deg < 1.0, "{relative:?}");
    assert!(floor.tilt_deg < 1.0 && floor.height_cm.abs() < 6.0, "{floor:?}");
}
