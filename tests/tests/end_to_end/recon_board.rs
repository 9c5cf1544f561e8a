//! Metres from a calibration board that lies in a capture, the board drawn into the office's own frames.

use std::path::Path;

use calib::Camera;
use calib::video::FrameSource;
use image::RgbImage;
use nalgebra::{Isometry3, Vector3};
use tests::accuracy::capture_truth;
use tests::board::Board;
use tests::chain::{compare_rooms, run};
use tests::data::{office, program};
use tests::office_room::give_stages_of_draft;

const SIDE_M: f64 = 0.075;

/// The office's captures with the board in cam0's, and a project that takes its metres from there.
fn office_with_board(office: &Path, folder: &Path) {
    let lens = calib::files::read_intrinsics(&office.join("cam0.toml")).unwrap();
    let poses = capture_truth(&office.join("truth.json"), "cam0").unwrap();
    // On a stand two metres before the installed camera, aslant, a little to the left.
    let before = Isometry3::new(Vector3::new(-0.55, -0.3, 2.0), Vector3::new(0.35, -0.4, 0.1));
    let world_from_board = poses.last().unwrap().inverse() * before;
    let film = office.join("capture/cam0.mp4");
    let mut frames = FrameSource::open(&film.to_string_lossy()).unwrap();
    std::fs::create_dir(folder.join("cam0")).unwrap();
    let mut picture = RgbImage::new(lens.width, lens.height);
    for (i, pose) in poses.iter().enumerate() {
        assert!(frames.read(&mut picture).unwrap(), "the film ends at frame {i}");
        let camera = Camera { intrinsics: lens.clone(), camera_from_world: *pose };
        Board { side_m: SIDE_M }.draw(&mut picture, &camera, &world_from_board);
        picture.save(folder.join(format!("cam0/{i:02}.png"))).unwrap();
    }
    let text = std::fs::read_to_string(office.join("room.toml")).unwrap();
    let (text, _) = text.split_once("[scale]").unwrap();
    let text = text
        .replace("capture/cam0.mp4", "cam0")
        .replace("capture/cam1.mp4", &format!("{}", office.join("capture/cam1.mp4").display()));
    let scale = format!("[scale]\ncamera = \"cam0\"\nboard = \"9x6\"\nsquare = {SIDE_M}\n");
    std::fs::write(folder.join("room.toml"), text + &scale).unwrap();
    for lens in ["cam0.toml", "cam1.toml"] {
        std::fs::copy(office.join(lens), folder.join(lens)).unwrap();
    }
}

#[test]
fn a_board_in_the_capture_gives_the_metres() {
    let (office, scratch) = (office(), tempfile::tempdir().unwrap());
    office_with_board(&office, scratch.path());
    let (project, room) = (scratch.path().join("room.toml"), scratch.path().join("room"));
    let build = || {
        let mut command = program("roomtrack");
        command.args(["recon", "build"]).arg(&project).arg("--out").arg(&room).args(["--quality", "draft"]);
        command
    };
    // The capture without a board is the office's.
    give_stages_of_draft(&room).unwrap();
    run(&mut build()).unwrap();
    let errors = compare_rooms(&room, &office.join("room"), 50).unwrap();
    // cam0's picture shows the board, which its truth does not have.
    let (_, lengths) = errors.lengths.iter().find(|(name, _)| name == "cam1").unwrap();
    assert!((lengths.median - 1.0).abs() < 0.01, "{errors:?}");
    assert!(errors.cameras.iter().all(|(_, camera)| camera.height_cm.abs() < 3.0), "{errors:?}");

    // The other camera's capture shows no board.
    let text = std::fs::read_to_string(&project)
        .unwrap()
        .replace("camera = \"cam0\"\nboard", "camera = \"cam1\"\nboard");
    std::fs::write(&project, text).unwrap();
    let output = build().output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("room.toml: [scale], board: the 9x6 board is seen whole in 0 frames"), "{said}");
}
