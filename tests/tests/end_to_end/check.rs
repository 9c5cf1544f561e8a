//! `tracker check` on the office: clean films, swapped ones, a late one, and one of another size.

use calib::video::{FilmWriter, FrameSource};
use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use scenes::room::Room;
use tests::data::office;
use tests::relocation::turned;

use crate::folder::Folder;

/// The office with the first frame of each film, in which nobody is, as its reference picture.
fn office_with_references() -> Folder {
    let folder = Folder::new();
    let mut scene = std::fs::read_to_string(office().join("room/scene.toml")).unwrap();
    for camera in ["cam0", "cam1"] {
        let film = office().join(format!("video/{camera}.mp4"));
        let mut picture = RgbImage::default();
        assert!(FrameSource::open(film.to_str().unwrap()).unwrap().read(&mut picture).unwrap());
        folder.picture(&format!("room/{camera}.png"), &picture);
        let name = format!("name = \"{camera}\"");
        assert!(scene.contains(&name));
        scene = scene.replace(&name, &format!("{name}\nreference = \"{camera}.png\""));
    }
    folder.write("room/scene.toml", scene);
    folder.write("room/room.ply", std::fs::read(office().join("room/room.ply")).unwrap());
    folder
}

/// Text and exit status of a check of two films.
fn checked(folder: &Folder, cam0: &str, cam1: &str) -> (String, Option<i32>) {
    let videos = [format!("cam0={cam0}"), format!("cam1={cam1}")];
    let found =
        folder.run_program("tracker", &["check", "room", "--video", &videos[0], "--video", &videos[1]]);
    let text = String::from_utf8(found.stdout).unwrap() + &String::from_utf8(found.stderr).unwrap();
    (text, found.status.code())
}

#[test]
fn films_that_do_not_fit_the_room_or_each_other_are_told() {
    let folder = office_with_references();
    let film = |camera: &str| office().join(format!("video/{camera}.mp4")).to_str().unwrap().to_owned();
    let (cam0, cam1) = (film("cam0"), film("cam1"));
    let (text, status) = checked(&folder, &cam0, &cam1);
    assert!(status == Some(0) && text.contains("clean"), "{text}");

    let (text, status) = checked(&folder, &cam1, &cam0);
    assert_eq!(status, Some(1), "{text}");
    assert!(
        text.contains("shows what camera `cam1` sees") && text.contains("shows what camera `cam0` sees"),
        "{text}"
    );

    // cam1 without its first second, and at half its size.
    let mut source = FrameSource::open(&cam1).unwrap();
    let (width, height) = source.size();
    let mut late = FilmWriter::create(&folder.path("late.mp4"), width, height, 12.0).unwrap();
    let mut small = FilmWriter::create(&folder.path("small.mp4"), width / 2, height / 2, 12.0).unwrap();
    let (mut picture, mut half) = (RgbImage::default(), RgbImage::new(width / 2, height / 2));
    for frame in 0.. {
        if !source.read(&mut picture).unwrap() {
            break;
        }
        if frame >= 12 {
            late.write(&picture).unwrap();
        }
        if frame < 20 {
            source.picture(&mut half).unwrap();
            small.write(&half).unwrap();
        }
    }
    late.finish().unwrap();
    small.finish().unwrap();
    let (text, status) = checked(&folder, &cam0, "late.mp4");
    assert!(status == Some(1) && text.contains("--offset cam1="), "{text}");
    let (text, status) = checked(&folder, &cam0, "small.mp4");
    assert!(
        status == Some(1) && text.contains("give the recording that the room was calibrated for"),
        "{text}"
    );
}

/// A camera that was carried to another place: near and far surfaces have moved by different angles.
#[test]
fn a_camera_that_stands_elsewhere_is_told() {
    let folder = office_with_references();
    let cam1 = office().join("video/cam1.mp4").to_str().unwrap().to_owned();
    let room = Room::read(&folder.path("room")).unwrap();
    let lens = &room.camera("cam1").unwrap().camera.intrinsics;
    let mut source = FrameSource::open(&cam1).unwrap();
    let (width, height) = source.size();
    let mut picture = RgbImage::default();
    assert!(source.read(&mut picture).unwrap());
    // Four strips, each turned by another angle, as four surfaces side by side.
    let strips = [2.0, 2.6, 3.2, 3.8]
        .map(|deg: f64| turned(&picture, lens, &UnitQuaternion::new(Vector3::y() * deg.to_radians())));
    let seen = RgbImage::from_fn(width, height, |u, v| *strips[(4 * u / width) as usize].get_pixel(u, v));
    let mut film = FilmWriter::create(&folder.path("moved.mp4"), width, height, 12.0).unwrap();
    (0..24).for_each(|_| film.write(&seen).unwrap());
    film.finish().unwrap();
    let found = folder.run_program("tracker", &["check", "room", "--video", "cam1=moved.mp4"]);
    let text = String::from_utf8(found.stdout).unwrap();
    assert!(found.status.code() == Some(1) && text.contains("camera `cam1` was moved since"), "{text}");
}
