//! `recon relocate` on a rendered room: the pose of a bumped camera, the bytes beside it, and refusals.

use std::fs;
use std::path::Path;
use std::process::Output;

use calib::Camera;
use nalgebra::{Isometry3, Rotation3, Vector3};
use scenes::room::Room;
use synthetic::{CaptureOptions, RoomOptions, SyntheticRoom};
use tests::data::program;

use crate::refusal::refused;

/// Picture that a camera takes.
fn picture(room: &SyntheticRoom, camera: &Camera) -> image::RgbImage {
    // The last frame of a capture is taken at the camera's own pose.
    let two = CaptureOptions { frames: 2, ..CaptureOptions::default() };
    room.capture(camera, &two).0.swap_remove(1)
}

fn relocate(dir: &Path, camera: &str, image: &Path) -> Output {
    let image = image.to_str().unwrap();
    program("recon").arg("relocate").arg(dir).args(["--camera", camera, "--image", image]).output().unwrap()
}

#[test]
fn a_bumped_camera_gets_its_new_pose_and_nothing_else_changes() {
    let scratch = tempfile::tempdir().unwrap();
    let (dir, now) = (scratch.path().join("room"), scratch.path().join("now.png"));
    let mut rendered =
        RoomOptions { seed: 7, image_px: [480, 360], ..RoomOptions::default() }.build().unwrap();
    let installed = rendered.room.cameras[0].camera.clone();
    fs::create_dir_all(&dir).unwrap();
    picture(&rendered, &installed).save(dir.join("cam0.png")).unwrap();
    rendered.room.cameras[0].reference = Some("cam0.png".into());
    rendered.room.write(&dir).unwrap();
    let scene = dir.join("scene.toml");
    fs::write(&scene, fs::read_to_string(&scene).unwrap() + "\n# the end\n").unwrap();
    let (scene_before, others) = (fs::read(&scene).unwrap(), ["room.ply", "cam0.png"]);
    let before = others.map(|name| fs::read(dir.join(name)).unwrap());

    // Turned by 5° and moved by 15 cm, towards the middle of the room.
    let turn = Rotation3::from_scaled_axis(Vector3::new(0.5, 0.8, 0.2).normalize() * 5.0_f64.to_radians());
    let bump = Isometry3::from_parts(Vector3::new(0.05, -0.02, -0.14).into(), turn.into());
    let bumped = Camera { camera_from_world: bump * installed.camera_from_world, ..installed.clone() };
    picture(&rendered, &bumped).save(&now).unwrap();
    let name = rendered.room.cameras[0].name.clone();
    let output = relocate(&dir, &name, &now);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && said.contains("has moved by") && said.contains("±"), "{said}");
    let room = Room::read(&dir).unwrap();
    let found = &room.cameras[0];
    let off_m = (found.camera.center() - bumped.center()).norm();
    let off = found.camera.camera_from_world.rotation.angle_to(&bumped.camera_from_world.rotation);
    assert!(off_m < 0.02 && off.to_degrees() < 0.2, "{off_m} m, {}°: {said}", off.to_degrees());
    assert_eq!(fs::read(dir.join(found.reference.as_ref().unwrap())).unwrap(), fs::read(&now).unwrap());
    assert_eq!(others.map(|name| fs::read(dir.join(name)).unwrap()), before);
    let (was, is) = (String::from_utf8(scene_before).unwrap(), fs::read_to_string(&scene).unwrap());
    let changed = was.lines().zip(is.lines()).filter(|(a, b)| a != b).count();
    assert!(was.lines().count() == is.lines().count() && changed == 3, "{is}");

    // The same picture again: the camera stands there.
    let after = fs::read(&scene).unwrap();
    let again = relocate(&dir, &name, &now);
    assert!(String::from_utf8_lossy(&again.stderr).contains("stands where the room has it"));

    // Pictures that tell no pose.
    let other = RoomOptions { seed: 8, image_px: [480, 360], ..RoomOptions::default() }.build().unwrap();
    let elsewhere = scratch.path().join("elsewhere.png");
    picture(&other, &other.room.cameras[1].camera).save(&elsewhere).unwrap();
    refused(&relocate(&dir, &name, &elsewhere), &["elsewhere.png", "not certain"]);
    let swapped = scratch.path().join("swapped.png");
    picture(&rendered, &rendered.room.cameras[1].camera).save(&swapped).unwrap();
    refused(&relocate(&dir, &name, &swapped), &["swapped.png"]);
    let small = scratch.path().join("small.png");
    image::RgbImage::new(240, 180).save(&small).unwrap();
    refused(&relocate(&dir, &name, &small), &["small.png", "240 × 180", "480 × 360"]);
    refused(&relocate(&dir, "cam9", &now), &["cam9"]);
    refused(&relocate(&dir, &name, &scratch.path().join("gone.png")), &["gone.png"]);
    assert_eq!(fs::read(&scene).unwrap(), after);
}
