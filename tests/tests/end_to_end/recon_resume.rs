//! `recon build` of a synthetic room that is interrupted: finished stages are kept, and the room comes out the same as
//! without the interruption.

use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use scenes::room::Room;
use synthetic::RoomOptions;
use tests::accuracy::{camera_against_floor, relative_pose};
use tests::data::program;

fn recon(folder: &Path) -> Command {
    let mut recon = program("recon");
    recon.current_dir(folder).args(["build", "room.toml", "--out", "room"]);
    recon
}

fn draft(folder: &Path) -> Command {
    let mut draft = recon(folder);
    draft.args(["--quality", "draft"]);
    draft
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn an_interrupted_build_goes_on_where_it_ended() {
    let scratch = tempfile::tempdir().unwrap();
    let folder = scratch.path();
    let truth = RoomOptions { seed: 4, image_px: [320, 240], ..RoomOptions::default() }.build().unwrap();
    tests::project::write(folder, &truth, 24).unwrap();

    let mut interrupted = draft(folder).stderr(Stdio::null()).spawn().unwrap();
    // The captures are processed in parallel: either may be kept first.
    let captures = ["cam0", "cam1"];
    let is_kept = |name: &str| folder.join(format!("room.unfinished/cache/capture_{name}.bin")).exists();
    let started = Instant::now();
    while !captures.into_iter().any(is_kept) {
        assert!(interrupted.try_wait().unwrap().is_none(), "the build ended by itself");
        assert!(started.elapsed() < Duration::from_mins(5), "nothing is kept");
        std::thread::sleep(Duration::from_millis(20));
    }
    interrupted.kill().unwrap();
    interrupted.wait().unwrap();
    assert!(!folder.join("room").exists(), "half a room");
    let kept = captures.map(is_kept);

    let resumed = draft(folder).output().unwrap();
    let text = said(&resumed);
    assert!(resumed.status.success(), "{text}");
    assert_eq!(captures.map(|name| text.contains(&format!("{name}: depth kept"))), kept, "{text}");
    assert!(!folder.join("room.unfinished").exists(), "something was left beside the room");
    let files = |names: [&str; 4]| names.map(|name| fs::read(folder.join("room").join(name)).unwrap());
    let names = ["scene.toml", "room.ply", "plan.png", "preview/cam1.png"];
    let before = files(names);

    let again = draft(folder).output().unwrap();
    let text = said(&again);
    assert!(again.status.success() && text.contains("cam1: depth kept"), "{text}");
    assert!(before == files(names), "a kept camera is not the camera that was kept");
    let other_seed = draft(folder).args(["--seed", "x"]).output().unwrap();
    assert_eq!(other_seed.status.code(), Some(2));

    let built = Room::read(&folder.join("room")).unwrap();
    let cameras = |room: &Room| [0, 1].map(|i| room.cameras[i].camera.clone());
    let ([a, b], [true_a, true_b]) = (cameras(&built), cameras(&truth.room));
    let relative = relative_pose([&a, &b], [&true_a, &true_b]);
    let floor = camera_against_floor(&b, &true_b);
    eprintln!("{relative:?} {floor:?}");
    assert!(relative.position_cm < 9.0 && relative.rotation_deg < 1.0, "{relative:?}");
    assert!(floor.tilt_deg < 1.0 && floor.height_cm.abs() < 6.0, "{floor:?}");

    // The cached motion serves other depths, too.
    let options = "[dense]\nkey_frames = 4\nhalvings = 2\niterations = [2, 1, 0]\nfuse_key_frames = false\n";
    fs::write(folder.join("options.toml"), options).unwrap();
    let other = recon(folder).args(["--options", "options.toml"]).output().unwrap();
    let text = said(&other);
    assert!(other.status.success(), "{text}");
    for name in captures {
        let kept = |what: &str| text.contains(&format!("{name}: {what} kept"));
        assert!(kept("camera motion") && !kept("depth"), "{text}");
    }
}
