//! Whole frames against their ground truth.

use super::*;
use nalgebra::Point3;

use scenes::depth;
use scenes::raycast::RayScene;

fn room(seed: u64) -> SyntheticRoom {
    RoomOptions { seed, image_px: [160, 120], ..RoomOptions::default() }.build().unwrap()
}

fn exact(frames: u32) -> SequenceOptions {
    SequenceOptions { frames, render: RenderOptions::exact(), ..SequenceOptions::default() }
}

#[test]
fn masks_are_where_pictures_with_and_without_people_differ() {
    let room = room(3);
    let walkers = room.walkers(&WalkerOptions { people: 3, first_s: 0.0, ..WalkerOptions::default() });
    let empty = room.sequence(Vec::new(), exact(1)).frame(1);
    let sequence = room.sequence(walkers, exact(120));
    let (mut seen, mut unchanged) = (0, 0);
    for frame in [30, 60, 90, 120].map(|f| sequence.frame(f)) {
        for (camera, empty) in frame.cameras.iter().zip(&empty.cameras) {
            let (image, background) = (camera.image.as_ref().unwrap(), empty.image.as_ref().unwrap());
            assert!(empty.mask.pixels().all(|p| p.0 == [0]));
            for (i, (a, b)) in image.pixels().zip(background.pixels()).enumerate() {
                let masked = camera.mask.as_raw()[i] == 255;
                assert_eq!(masked, camera.ids[i] > 0);
                if masked {
                    seen += 1;
                    unchanged += i32::from(a == b);
                    assert!(camera.depth.z_m[i] < empty.depth.z_m[i]);
                } else {
                    assert_eq!(a, b);
                    assert_eq!(camera.depth.z_m[i].to_bits(), empty.depth.z_m[i].to_bits());
                }
            }
        }
    }
    // A body may have the background's colour by chance.
    assert!(seen > 2000 && unchanged * 100 < seen, "{seen} {unchanged}");
}

#[test]
fn depth_is_that_of_the_room_which_is_written() {
    let room = room(5);
    let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
    let frame = room.sequence(Vec::new(), exact(1)).frame(1);
    for (camera, seen) in room.room.cameras.iter().zip(&frame.cameras) {
        let expected = depth::render(&scene, &camera.camera);
        let differ = expected.z_m.iter().zip(&seen.depth.z_m).filter(|(a, b)| (*a - *b).abs() > 1e-3).count();
        assert!(differ * 1000 < expected.z_m.len(), "{differ} pixels differ");
        assert!(seen.depth.z_m.iter().all(|z| *z > 0.2), "the room is closed");
    }
}

#[test]
fn visible_shares_are_shares_and_one_where_nothing_hides() {
    let bare = RoomOptions { furniture: 0, image_px: [160, 120], cameras: 4, ..RoomOptions::default() }
        .build()
        .unwrap();
    let walkers = bare.walkers(&WalkerOptions { people: 1, first_s: 0.0, ..WalkerOptions::default() });
    let sequence = bare.sequence(walkers, SequenceOptions { images: false, ..exact(200) });
    let mut full = 0;
    for frame in sequence.frames().step_by(4) {
        for person in frame.people.iter().filter(|p| p.inside && bare_distance(&bare, p) > 0.8) {
            for visible in &person.visible {
                assert!(*visible == 0.0 || (*visible - 1.0).abs() < 1e-12, "{visible} in an empty room");
                full += i32::from(*visible > 0.5);
            }
        }
    }
    assert!(full > 60);

    let room = room(2);
    let walkers = room.walkers(&WalkerOptions { people: 4, first_s: 0.0, ..WalkerOptions::default() });
    let sequence = room.sequence(walkers, SequenceOptions { images: false, ..exact(200) });
    let mut partly = 0;
    for frame in sequence.frames().step_by(6) {
        for visible in frame.people.iter().flat_map(|p| &p.visible) {
            assert!((0.0..=1.0).contains(visible));
            partly += i32::from((0.05..0.95).contains(visible));
        }
    }
    assert!(partly > 10, "furniture hides somebody now and then");
}

/// Distance of a person from the walls of a room: near a doorway its frame hides them.
fn bare_distance(room: &SyntheticRoom, person: &PersonTruth) -> f64 {
    let p = person.place;
    p.x.min(p.y).min(room.size_m[0] - p.x).min(room.size_m[1] - p.y)
}

#[test]
fn people_are_seen_where_they_stand() {
    let room = room(1);
    let walkers = room.walkers(&WalkerOptions { people: 2, first_s: 0.0, ..WalkerOptions::default() });
    let sequence = room.sequence(walkers, SequenceOptions { images: false, ..exact(150) });
    let mut checked = 0;
    for frame in sequence.frames().step_by(5) {
        for (c, seen) in frame.cameras.iter().enumerate() {
            let camera = &room.room.cameras[c].camera;
            for person in frame.people.iter().filter(|p| p.inside && p.visible[c] > 0.97) {
                // The pixels' mean direction passes the person's middle, within half a body's width.
                let width = camera.intrinsics.width as usize;
                let pixels: Vec<usize> = (0..seen.ids.len()).filter(|i| seen.ids[*i] == person.id).collect();
                let mean = |f: fn(usize, usize) -> usize| {
                    pixels.iter().map(|i| f(*i, width)).sum::<usize>() as f64 / pixels.len() as f64
                };
                let middle = nalgebra::Point2::new(mean(|i, w| i % w), mean(|i, w| i / w));
                let body = Point3::new(person.place.x, person.place.y, 0.55 * person.height_m);
                let expected = camera.project(&body).unwrap();
                if !camera.intrinsics.contains(&expected) || pixels.len() < 60 {
                    continue;
                }
                let depth = (camera.camera_from_world * body).z;
                // Cameras are level, so sideways is along the rows; the vertical offset depends on the camera's tilt
                // towards the person.
                let off = (middle - expected) / camera.intrinsics.fx * depth;
                // Somebody cut by the image's rim is seen in part.
                let cut = pixels.iter().any(|i| {
                    let (x, y) = (i % width, i / width);
                    x == 0 || y == 0 || x + 1 == width || y + 1 == camera.intrinsics.height as usize
                });
                if !cut {
                    checked += 1;
                    assert!(
                        off.x.abs() < 0.12 && off.y.abs() < 0.35,
                        "frame {} camera {c}: {off}",
                        frame.frame
                    );
                }
            }
        }
    }
    assert!(checked > 20, "{checked}");
}

#[test]
fn the_same_options_give_the_same_bytes_at_any_number_of_threads() {
    let make = || {
        let options = RoomOptions {
            seed: 11,
            image_px: [96, 72],
            distortion: [-0.15, 0.03, 0.0, 0.0, 0.0].into(),
            ..RoomOptions::default()
        };
        let room = options.build().unwrap();
        let walkers = room.walkers(&WalkerOptions { first_s: 0.0, ..WalkerOptions::default() });
        let camera = room.room.cameras[0].camera.clone();
        let capture = room.capture(&camera, &CaptureOptions { frames: 3, ..CaptureOptions::default() });
        let frame = room.sequence(walkers, SequenceOptions::default()).frame(50);
        (capture, frame, room.room.geometry.clone())
    };
    let threads = |count: usize| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
    let one = threads(1).install(make);
    let three = threads(3).install(make);
    assert!(one == three);
    assert!(one.1.people.iter().any(|p| p.visible.iter().any(|v| *v > 0.0)));
}

#[test]
fn noise_and_flicker_have_the_size_asked_for() {
    let room = room(4);
    let quiet = room.sequence(Vec::new(), exact(2)).frame(1).cameras[0].image.clone().unwrap();
    let render = RenderOptions { noise: 3.0, flicker: 0.0, ..RenderOptions::exact() };
    let noisy = room.sequence(Vec::new(), SequenceOptions { render, ..exact(2) });
    let noisy = [1, 2].map(|f| noisy.frame(f).cameras[0].image.clone().unwrap());
    assert!(noisy[0] != noisy[1]);
    let pairs = quiet.iter().zip(noisy[0].iter()).filter(|(q, _)| (20..235).contains(*q));
    let squares: Vec<f64> = pairs.map(|(q, n)| (f64::from(*q) - f64::from(*n)).powi(2)).collect();
    let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
    // Rounding adds 1/12.
    assert!((rms - (9.0_f64 + 1.0 / 12.0).sqrt()).abs() < 0.1, "{rms}");
}

#[test]
fn rooms_can_be_written_read_and_told_apart() {
    let directory = tempfile::tempdir().unwrap();
    let first = room(8);
    first.room.write(directory.path()).unwrap();
    let read = scenes::room::Room::read(directory.path()).unwrap();
    assert_eq!(read.cameras.len(), 2);
    assert_eq!(read.zones, first.room.zones);
    assert_eq!(read.geometry, first.room.geometry);
    assert!(room(9).room.geometry != first.room.geometry);
    let hall = RoomOptions {
        kind: RoomKind::Hall,
        cameras: 4,
        doors: 3,
        image_px: [64, 48],
        ..RoomOptions::default()
    };
    let hall = hall.build().unwrap();
    assert!(hall.size_m[0] > 12.0 && hall.furniture.len() > 4 && hall.room.cameras.len() == 4);
}

#[test]
fn free_floor_agrees_with_the_derived_map() {
    let room = room(6);
    let derived = scenes::walkable::WalkableMap::of_room(&room.room).unwrap();
    let mut rng = <rand_pcg::Pcg64Mcg as rand::SeedableRng>::seed_from_u64(1);
    let (mut agree, mut count) = (0, 0);
    let floor = scenes::polygon::Polygon::rectangle(
        nalgebra::Point2::origin(),
        nalgebra::Point2::new(room.size_m[0], room.size_m[1]),
    );
    for _ in 0..2000 {
        let p = floor.sample(&mut rng);
        // Not at rims, where cells decide.
        let rim = room.furniture.iter().any(|f| {
            f.footprint.edges().any(|(a, b)| {
                let t = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
                (p - (a + (b - a) * t)).norm() < 0.12
            })
        });
        if !rim {
            count += 1;
            agree += i32::from(derived.contains(p.x, p.y) == room.is_free(&p));
        }
    }
    assert!(f64::from(agree) > 0.96 * f64::from(count), "{agree} of {count}");
}
