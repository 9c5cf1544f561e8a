//! Tests of the panels' content.

use super::*;
use crate::prepared_room::PreparationOptions;
use crate::silhouette::{Body, contour};
use calib::video::FrameSource;
use calib::{Camera, Intrinsics};
use image::Rgb;
use nalgebra::{Isometry3, Point3, Vector3};
use scenes::room::{Room, RoomCamera};
use shell::canvas::Color;

fn prepared(distortion: [f64; 5]) -> PreparedRoom {
    let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 70.0);
    intrinsics.distortion = distortion.into();
    let pose =
        Isometry3::face_towards(&Point3::new(0.0, 0.0, 1.6), &Point3::new(4.0, 0.0, 0.9), &-Vector3::z());
    let camera = RoomCamera {
        name: "a".into(),
        camera: Camera { intrinsics, camera_from_world: pose.inverse() },
        reference: None,
    };
    let room = Room { cameras: vec![camera], ..Room::default() };
    PreparedRoom::prepare(&room, Path::new("."), &PreparationOptions::default()).unwrap()
}

/// Panels of the pictures' own size.
fn large() -> FilmOptions {
    FilmOptions { width_px: 1280, ..FilmOptions::default() }
}

fn person(id: u32, x_m: f64, y_m: f64) -> PersonEstimate {
    let standing = PersonEstimate::standing(id, x_m, y_m);
    PersonEstimate { radius_m: 0.3, sigma_m: [0.02; 2], visible: vec![0.5], ..standing }
}

fn gray(prepared: &PreparedRoom) -> Shot {
    let camera = &prepared.cameras[0];
    let image = RgbImage::from_pixel(camera.width(), camera.height(), Rgb([128; 3]));
    Shot { image: Some(image.into()), mask: None }
}

/// Share of the way from the grey picture towards a colour that a pixel has moved, 0 to 1.
fn tint(pixel: Rgb<u8>, color: Color) -> f64 {
    let c = [color.r, color.g, color.b].map(f64::from);
    let (mut dot, mut norm) = (0.0, 0.0);
    for i in 0..3 {
        dot += (f64::from(pixel[i]) - 128.0) * (c[i] - 128.0);
        norm += (c[i] - 128.0) * (c[i] - 128.0);
    }
    dot / norm
}

#[test]
fn visible_parts_are_tinted_and_hidden_parts_dimmed() {
    let mut prepared = prepared([0.0; 5]);
    // A board hides everything below image row 240 from 3 m on.
    let camera = &mut prepared.cameras[0];
    let width = camera.width() as usize;
    for (index, z) in camera.static_z_m.iter_mut().enumerate() {
        *z = if index / width >= 240 { 3.0 } else { 50.0 };
    }
    let who = person(1, 4.0, 0.0);
    let bounds = contour::bounding_box(&Body::from(&who), &prepared.cameras[0].real).unwrap();
    let (middle, quarter) = (bounds.left + 0.5 * bounds.width, 0.25 * bounds.height);
    let frame = Painter::new(&prepared, 0, &large()).paint(1, 0.0, &gray(&prepared), &[who]);
    assert_eq!(frame.dimensions(), (1280, 480));
    let color = Color::of_id(1);
    let at = |dx: u32, y: f64| tint(*frame.get_pixel(middle as u32 + dx, y as u32), color);
    // Beside the trail's end, which is at the foot.
    let (upper, lower) = (at(10, bounds.top + quarter), at(10, bounds.top + 2.7 * quarter));
    assert!((upper - 0.45).abs() < 0.05, "visible {upper}");
    assert!((lower - 0.12).abs() < 0.03, "hidden {lower}");
    assert!(at(0, bounds.top - 60.0).abs() < 0.01 && tint(*frame.get_pixel(20, 300), color).abs() < 0.01);
    // The simulated panel shows the body above the board, and the board below.
    let simulated = |y: f64| *frame.get_pixel(640 + middle as u32, y as u32);
    let (body, board) = (simulated(bounds.top + quarter), simulated(bounds.top + 2.7 * quarter));
    assert!(body[2] > body[1] && body[1] > body[0], "{body:?} is not sky blue");
    assert!(board[0].abs_diff(board[2]) < 40, "{board:?} is not clay");
}

#[test]
fn the_nearer_person_is_seen_whatever_the_order() {
    let prepared = prepared([0.0; 5]);
    let (near, far) = (person(1, 3.0, 0.0), person(2, 5.0, 0.05));
    let shot = gray(&prepared);
    let paint = |people: &[PersonEstimate]| Painter::new(&prepared, 0, &large()).paint(1, 0.0, &shot, people);
    let one = paint(&[near.clone(), far.clone()]);
    assert_eq!(one, paint(&[far.clone(), near.clone()]));
    let middle = prepared.cameras[0].real.project(&Point3::new(3.0, 0.0, 0.9)).unwrap();
    let pixel = one.get_pixel(640 + middle.x as u32, middle.y as u32);
    assert!(pixel[2] > pixel[1], "{pixel:?} is person 2's green, not person 1's blue");
}

#[test]
fn silhouettes_follow_the_lens() {
    let prepared = prepared([-0.3, 0.08, 0.0, 0.0, 0.0]);
    let who = person(1, 3.0, 1.6);
    let frame =
        Painter::new(&prepared, 0, &large()).paint(1, 0.0, &gray(&prepared), std::slice::from_ref(&who));
    // The bounds of the tinted pixels are the box in real pixels.
    let bounds = contour::bounding_box(&Body::from(&who), &prepared.cameras[0].real).unwrap();
    let color = Color::of_id(1);
    let tinted: Vec<u32> = (0..640u32)
        .filter(|x| (200..300).any(|y| (tint(*frame.get_pixel(*x, y), color) - 0.45).abs() < 0.06))
        .collect();
    let (first, last) = (f64::from(tinted[0]), f64::from(*tinted.last().unwrap()));
    assert!((first - bounds.left).abs() < 5.0, "{first} against {}", bounds.left);
    assert!((last - bounds.left - bounds.width).abs() < 5.0, "{last}");
}

#[test]
fn films_are_written_for_pictures_and_for_masks_alone() {
    let prepared = prepared([0.0; 5]);
    let folder = tempfile::tempdir().unwrap();
    let mut film = Film::start(folder.path(), &prepared, 12.0, &large(), None).unwrap();
    let mask = Mask::from_fn(640, 480, |_, _| true);
    for frame in 1..=20 {
        let shot =
            if frame % 2 == 0 { gray(&prepared) } else { Shot { image: None, mask: Some(mask.clone()) } };
        let people = [person(1, 3.0, 0.05 * f64::from(frame)), person(2, -3.0, 0.0), person(3, 0.1, 0.0)];
        film.push(frame, f64::from(frame) / 12.0, vec![shot], &people).unwrap();
    }
    film.finish().unwrap();
    let mut source = FrameSource::open(folder.path().join("overlay/a.mp4").to_str().unwrap()).unwrap();
    assert_eq!((source.size(), source.read_all().unwrap().len()), ((1280, 480), 20));
}

#[test]
fn an_audience_is_given_every_frame_of_the_film() {
    let prepared = prepared([0.0; 5]);
    let folder = tempfile::tempdir().unwrap();
    let seen = Arc::new(std::sync::Mutex::new(Vec::new()));
    let note = Arc::clone(&seen);
    let audience: Audience = Arc::new(move |painted| note.lock().unwrap().push(painted));
    let options = large();
    let mut film = Film::start(folder.path(), &prepared, 12.0, &options, Some(&audience)).unwrap();
    let people = |frame: u32| [person(1, 3.0, 0.05 * f64::from(frame)), person(2, 4.0, -1.0)];
    for frame in 3..=6 {
        film.push(frame, f64::from(frame) / 12.0, vec![gray(&prepared)], &people(frame)).unwrap();
    }
    film.finish().unwrap();
    let mut painter = Painter::new(&prepared, 0, &options);
    let seen = seen.lock().unwrap();
    assert_eq!(
        seen.iter().map(|p| (p.camera, p.frame, p.people)).collect::<Vec<_>>(),
        [(0, 3, 2), (0, 4, 2), (0, 5, 2), (0, 6, 2)]
    );
    for painted in seen.iter() {
        let time_s = f64::from(painted.frame) / 12.0;
        approx::assert_relative_eq!(painted.time_s, time_s);
        let expected = painter.paint(painted.frame, time_s, &gray(&prepared), &people(painted.frame));
        assert!(painted.picture == expected, "frame {}", painted.frame);
    }
}

#[test]
fn a_film_that_cannot_be_written_says_so_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("overlay"), "in the way").unwrap();
    let error = Film::start(folder.path(), &prepared([0.0; 5]), 12.0, &large(), None).unwrap_err();
    assert!(error.to_string().contains("overlay"), "{error}");
}
