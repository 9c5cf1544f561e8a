//! Films of a world that is painted on a sphere of directions, so that turned cameras are exact.

use std::path::Path;

use calib::{Camera, Intrinsics};
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point2, Rotation3, Vector3};
use scenes::room::{Room, RoomCamera};

use super::film_times::{self, FilmTimes};
use super::pose_watch::{PoseFinding, PoseWatch};
use super::views::{self, EmptyScene};

/// Brightness of a direction: three sizes of soft cells with edges, of a world with this seed.
fn brightness(direction: &Vector3<f64>, seed: u32) -> f64 {
    let cell = |scale: f64| {
        let at = direction.map(|v| (v * scale).floor() as i64);
        let mut state = seed ^ 0x9e37_79b9;
        for value in at.iter() {
            state = (state ^ *value as u32).wrapping_mul(2_654_435_761).rotate_left(13);
        }
        f64::from(state >> 16) / 65_535.0
    };
    0.5 * cell(6.0) + 0.3 * cell(14.0) + 0.2 * cell(31.0)
}

fn lens() -> Intrinsics {
    let mut k = Intrinsics::from_horizontal_fov(480, 360, 70.0);
    k.distortion = [-0.1, 0.02, 0.0, 0.0, 0.0].into();
    k
}

/// Picture of a camera that is turned by this rotation, in a world with this seed; a little noise and another exposure for
/// each `grain`.
fn picture(turn: &Rotation3<f64>, seed: u32, grain: u32) -> RgbImage {
    let k = lens();
    RgbImage::from_fn(k.width, k.height, |x, y| {
        // Four rays a pixel soften its edges.
        let sum: f64 = [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)]
            .map(|(dx, dy)| {
                let ray =
                    k.unproject(&Point2::new(f64::from(x) + dx, f64::from(y) + dy)).unwrap().normalize();
                brightness(&(turn * ray), seed)
            })
            .iter()
            .sum();
        let noise =
            f64::from((x * 7919 + y * 104_729 + grain * 31).wrapping_mul(2_654_435_761) >> 24) / 255.0 - 0.5;
        let level = (20.0 + (50.0 - 0.3 * f64::from(grain)) * sum + 6.0 * noise).clamp(0.0, 255.0);
        Rgb([level as u8; 3])
    })
}

/// A room of two cameras in different worlds, with their reference pictures.
fn room(folder: &Path) -> Room {
    let camera = |name: &str, seed: u32| {
        picture(&Rotation3::identity(), seed, 0).save(folder.join(format!("{name}.png"))).unwrap();
        RoomCamera {
            name: name.to_owned(),
            camera: Camera { intrinsics: lens(), camera_from_world: Isometry3::identity() },
            reference: Some(format!("{name}.png").into()),
        }
    };
    Room { cameras: vec![camera("a", 1), camera("b", 2)], ..Room::default() }
}

fn scene(camera: &str, picture: RgbImage) -> EmptyScene {
    EmptyScene { camera: camera.to_owned(), film: format!("{camera}.mp4"), picture }
}

fn findings(room: &Room, folder: &Path, films: &[EmptyScene]) -> Vec<String> {
    views::compare(room, folder, films).unwrap().1.iter().map(ToString::to_string).collect()
}

#[test]
fn films_at_the_reference_pose_are_clean_and_swapped_ones_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let room = room(folder.path());
    let still = Rotation3::identity();
    // A tenth of a degree is no turn: lenses creep, and pictures are compared to a tenth of a pixel.
    let crept = Rotation3::from_euler_angles(0.0, 0.1_f64.to_radians(), 0.0);
    let (a, b) = (picture(&still, 1, 3), picture(&crept, 2, 40));
    let (reports, found) =
        views::compare(&room, folder.path(), &[scene("a", a.clone()), scene("b", b.clone())]).unwrap();
    assert_eq!(found, []);
    assert!(reports.iter().all(|report| report.agreeing.is_some_and(|points| points > 50)), "{reports:?}");

    let found = findings(&room, folder.path(), &[scene("a", b), scene("b", a)]);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found[0].starts_with("a=a.mp4: shows what camera `b` sees") && found[0].contains("b=a.mp4"),
        "{}",
        found[0]
    );
    assert!(found[1].contains("a=b.mp4"), "{}", found[1]);

    let found = findings(&room, folder.path(), &[scene("a", picture(&still, 9, 0))]);
    assert!(found.len() == 1 && found[0].contains("another room"), "{found:?}");
    // A covered lens.
    let found = findings(&room, folder.path(), &[scene("a", RgbImage::new(480, 360))]);
    assert!(found.len() == 1 && found[0].contains("shows next to nothing (0 points"), "{found:?}");
    // A reference picture without anything to recognise, and none at all: there is nothing to compare with.
    RgbImage::new(480, 360).save(folder.path().join("a.png")).unwrap();
    assert_eq!(findings(&room, folder.path(), &[scene("a", picture(&still, 9, 0))]), [""; 0]);
    std::fs::remove_file(folder.path().join("a.png")).unwrap();
    assert_eq!(findings(&room, folder.path(), &[scene("a", picture(&still, 9, 0))]), [""; 0]);
}

#[test]
fn a_turned_camera_is_told_with_its_angle_and_direction() {
    let folder = tempfile::tempdir().unwrap();
    let room = room(folder.path());
    for (degrees, axis, word) in [
        (0.5, [0.0, 1.0, 0.0], "to the right"),
        (1.0, [0.0, -1.0, 0.0], "to the left"),
        (4.0, [1.0, 0.0, 0.0], "upwards"),
        (0.8, [-1.0, 0.0, 0.0], "downwards"),
        (2.0, [0.0, 0.0, 1.0], "clockwise"),
    ] {
        let degrees: f64 = degrees;
        let turn = Rotation3::from_scaled_axis(Vector3::from(axis) * degrees.to_radians());
        let found = findings(&room, folder.path(), &[scene("a", picture(&turn, 1, 5))]);
        assert_eq!(found.len(), 1, "{degrees} {word}: {found:?}");
        let words = found[0].split_once("has turned by ").unwrap().1;
        let angle: f64 = words.split_once('°').unwrap().0.parse().unwrap();
        assert!((angle - degrees).abs() <= 0.15 && words.contains(word), "{degrees} {word}: {}", found[0]);
    }
}

fn times(camera: &str, stated_hz: f64, times_s: Vec<f64>) -> FilmTimes {
    let frames = times_s.len();
    FilmTimes {
        camera: camera.into(),
        film: format!("{camera}.mp4"),
        frames,
        stated_hz: Some(stated_hz),
        times_s,
    }
}

#[test]
fn gaps_wrong_rates_and_late_starts_are_told() {
    let steady = |start_s: f64| (0..100).map(|i| start_s + f64::from(i) / 12.0).collect::<Vec<f64>>();
    let clean = times("a", 12.0, steady(0.0));
    assert_eq!(clean.findings(), []);
    let mut lost = steady(0.0);
    lost.drain(40..70);
    let found = times("b", 12.0, lost).findings();
    assert!(found.len() == 1 && found[0].text.contains("2.58 s at 3.25 s"), "{found:?}");
    let found = times("b", 25.0, steady(0.0)).findings();
    assert!(
        found.len() == 1 && found[0].text.contains("25.00 frames/s") && found[0].text.contains("12.00/s"),
        "{found:?}"
    );

    let found =
        film_times::starts(&[clean.clone(), times("b", 12.0, steady(2.0)), times("c", 12.0, steady(0.08))]);
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(
        found[0].to_string().starts_with("b=b.mp4") && found[0].text.contains("--offset b=-2.000"),
        "{}",
        found[0]
    );
    assert_eq!(film_times::starts(&[clean, times("b", 12.0, Vec::new())]), []);
}

/// Findings at one picture each half of a second.
fn findings_of_watch(pictures: &[RgbImage]) -> Vec<PoseFinding> {
    let mut watch = PoseWatch::new(lens());
    pictures.iter().enumerate().map(|(i, p)| watch.look(p, 0.5 * i as f64).unwrap()).collect()
}

/// The picture with a rectangle in another colour.
fn covered(picture: &RgbImage, [left, top, width, height]: [u32; 4], level: u8) -> RgbImage {
    let mut picture = picture.clone();
    for (x, y) in (left..left + width).flat_map(|x| (top..top + height).map(move |y| (x, y))) {
        picture.put_pixel(x, y, Rgb([level.wrapping_add((7 * x + 3 * y) as u8 % 40); 3]));
    }
    picture
}

#[test]
fn a_camera_that_turns_during_a_run_is_noticed_and_never_found_unmoved_again() {
    let still = picture(&Rotation3::identity(), 1, 3);
    for degrees in [0.5_f64, 1.0, 4.0] {
        let turn =
            Rotation3::from_scaled_axis(Vector3::new(0.3, 1.0, 0.1).normalize() * degrees.to_radians());
        let turned = picture(&turn, 1, 6);
        let mut shown = vec![still.clone(); 3];
        shown.extend(vec![turned; 5]);
        // Back to within less than what counts as a turn: the pose is not the room's any more.
        shown.push(picture(&Rotation3::from_euler_angles(0.0, 0.15_f64.to_radians(), 0.0), 1, 6));
        let found = findings_of_watch(&shown);
        assert_eq!(found[..3], [PoseFinding::Unmoved; 3], "{degrees}");
        assert_eq!(found[3..5], [PoseFinding::Doubtful, PoseFinding::Moved], "{degrees}: {found:?}");
        assert!(found[5..8].contains(&PoseFinding::AtRest), "{degrees}: {found:?}");
        assert!(!found[5..].contains(&PoseFinding::Unmoved), "{degrees}: {found:?}");
    }
}

#[test]
fn people_shadows_flicker_and_a_moved_chair_are_no_turn() {
    let still = Rotation3::identity();
    let empty = picture(&still, 1, 3);
    let relit = |factor: f64| {
        let mut other = empty.clone();
        other.iter_mut().for_each(|v| *v = (f64::from(*v) * factor).min(255.0) as u8);
        other
    };
    let mut shaded = relit(0.55);
    for (x, y) in (0..240).flat_map(|x| (0..360).map(move |y| (x, y))) {
        shaded.put_pixel(x, y, *empty.get_pixel(x, y));
    }
    let shown = [
        empty.clone(),
        picture(&still, 1, 25),
        covered(&empty, [60, 60, 110, 300], 20),
        covered(&covered(&empty, [100, 40, 150, 320], 20), [280, 40, 150, 320], 120),
        shaded,
        relit(1.6),
        relit(0.4),
        covered(&empty, [300, 250, 80, 90], 90),
        RgbImage::new(480, 360),
        empty.clone(),
    ];
    assert_eq!(findings_of_watch(&shown), [PoseFinding::Unmoved; 10]);
}
