//! Tests of whole moments with synthetic truth: dark balls of the size of heads, ray-traced pixel by pixel, before a
//! textured wall.

use std::path::Path;

use calib::{Camera, Intrinsics};
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point2, Point3};
use scenes::polygon::Polygon;
use scenes::room::{Room, RoomCamera, Zone, ZoneKind};

use super::*;
use crate::CameraFrame;
use crate::prepared_room::{PreparationOptions, PreparedCamera};

const SIZE: (u32, u32) = (320, 240);
const RATE_HZ: f64 = 15.0;

/// Cameras around a floor of 4 × 4 m whose entry is on its west side.
fn prepared(cameras: usize) -> PreparedRoom {
    let camera = |i: usize| {
        let angle = 0.4 + i as f64 / cameras as f64 * std::f64::consts::TAU;
        let eye = Point3::new(2.0 + 4.2 * angle.cos(), 2.0 + 4.2 * angle.sin(), 2.5);
        let pose = Isometry3::face_towards(&eye, &Point3::new(2.0, 2.0, 1.4), &-Vector3::z()).inverse();
        let intrinsics = Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 70.0);
        RoomCamera {
            name: format!("c{i}"),
            camera: Camera { intrinsics, camera_from_world: pose },
            reference: None,
        }
    };
    let floor = Polygon::rectangle(Point2::origin(), Point2::new(4.0, 4.0));
    let entry = Polygon::rectangle(Point2::origin(), Point2::new(1.2, 4.0));
    let room = Room {
        cameras: (0..cameras).map(camera).collect(),
        zones: vec![Zone { name: "west".into(), polygon: entry, kind: ZoneKind::Both }],
        walkable: Some(vec![floor]),
        ..Room::default()
    };
    PreparedRoom::prepare(&room, Path::new("."), &PreparationOptions::default()).unwrap()
}

/// Picture of heads (spheroids of the model's size, each on a body) before a wall.
fn picture(camera: &PreparedCamera, heads: &[Vector3<f64>]) -> RgbImage {
    let center = camera.pinhole.center();
    RgbImage::from_fn(SIZE.0, SIZE.1, |u, v| {
        let ray = camera.pinhole.ray(&Point2::new(f64::from(u), f64::from(v))).unwrap().into_inner();
        let hits = |middle: Vector3<f64>, axes: Vector3<f64>| {
            let (o, w) = ((center.coords - middle).component_div(&axes), ray.component_div(&axes));
            let b = o.dot(&w);
            b < 0.0 && b * b >= w.norm_squared() * (o.norm_squared() - 1.0)
        };
        let is_hit = heads.iter().any(|h| {
            hits(*h, Vector3::new(0.09, 0.09, 0.12))
                || hits(Vector3::new(h.x, h.y, 0.7), Vector3::new(0.2, 0.2, 0.68))
        });
        if is_hit {
            Rgb([40, 35, 30])
        } else {
            Rgb([150 + (u * 7 % 23) as u8, 150 + (v * 5 % 19) as u8, 160])
        }
    })
}

fn tracker(prepared: &PreparedRoom, options: CondensationOptions) -> Condensation {
    let mut tracker = Condensation::new(prepared.clone(), options).unwrap();
    for (i, camera) in prepared.cameras.iter().enumerate() {
        tracker.set_empty_scene(i, &picture(camera, &[]));
    }
    tracker
}

/// Tracks heads at given positions in each frame; `blind` are the cameras without a picture in a frame.
fn followed(
    prepared: &PreparedRoom,
    options: CondensationOptions,
    frames: u32,
    heads: impl Fn(f64) -> Vec<Vector3<f64>>,
    is_blind: impl Fn(u32, usize) -> bool,
) -> Vec<Vec<PersonEstimate>> {
    let mut tracker = tracker(prepared, options);
    (1..=frames)
        .map(|frame| {
            let time_s = f64::from(frame) / RATE_HZ;
            let heads = heads(time_s);
            let frame_of = |(i, camera): (usize, &PreparedCamera)| {
                if is_blind(frame, i) {
                    CameraFrame::default()
                } else {
                    CameraFrame::of_image(picture(camera, &heads))
                }
            };
            let cameras: Vec<CameraFrame> = prepared.cameras.iter().enumerate().map(frame_of).collect();
            tracker.step(&Moment { frame, time_s, cameras: &cameras }).unwrap()
        })
        .collect()
}

/// A head that comes from the west at 1 m/s and continues along a curve.
fn walker(time_s: f64) -> Vec<Vector3<f64>> {
    vec![Vector3::new(0.6 + time_s, 1.5 + 0.5 * (1.2 * time_s).sin(), 1.62)]
}

fn error_m(p: &PersonEstimate, head: &Vector3<f64>) -> f64 {
    (Vector3::new(p.x_m, p.y_m, p.z_m) - head).norm()
}

#[test]
fn a_head_is_found_and_followed_within_centimetres_by_two_to_sixteen_cameras() {
    for cameras in [2, 3, 16] {
        let people = followed(&prepared(cameras), CondensationOptions::default(), 36, walker, |_, _| false);
        for (i, people) in people.iter().enumerate().skip(18) {
            let head = walker((i + 1) as f64 / RATE_HZ)[0];
            assert_eq!(people.len(), 1, "{cameras} cameras, frame {}", i + 1);
            let error = error_m(&people[0], &head);
            assert!(error < 0.06, "{cameras} cameras, frame {}: {error}", i + 1);
            assert_eq!(people[0].id, TrackId(1));
        }
    }
}

#[test]
fn a_camera_that_drops_out_is_left_out_and_without_two_one_coasts_with_growing_sigma() {
    let prepared = prepared(4);
    // One camera drops out at frame 20, all but one at frame 28.
    let blind = |frame: u32, camera: usize| (frame >= 20 && camera == 2) || (frame >= 28 && camera != 0);
    let people = followed(&prepared, CondensationOptions::default(), 33, walker, blind);
    let at = |frame: usize| &people[frame - 1][0];
    assert!(error_m(at(26), &walker(26.0 / RATE_HZ)[0]) < 0.06);
    assert!(error_m(at(31), &walker(31.0 / RATE_HZ)[0]) < 0.25, "goes on as it went");
    let sigma = |frame: usize| at(frame).sigma_m[0].hypot(at(frame).sigma_m[1]);
    assert!(sigma(27) < 0.05 && sigma(29) > 1.5 * sigma(27) && sigma(32) > 1.3 * sigma(29));
    assert!(at(32).confidence < at(27).confidence);
}

#[test]
fn nobody_is_found_in_an_empty_scene_or_without_pictures() {
    let prepared = prepared(3);
    for is_blind in [false, true] {
        let people = followed(&prepared, CondensationOptions::default(), 12, |_| Vec::new(), |_, _| is_blind);
        assert!(people.iter().all(Vec::is_empty), "{is_blind}");
    }
}

#[test]
fn two_who_pass_each_other_keep_their_own_heads() {
    let prepared = prepared(6);
    let both = |time_s: f64| {
        vec![Vector3::new(0.5 + time_s, 1.7, 1.6), Vector3::new(0.5 + 1.0_f64.min(time_s), 2.2, 1.7)]
    };
    let people = followed(&prepared, CondensationOptions::default(), 34, both, |_, _| false);
    let ids = |frame: usize| {
        let heads = both(frame as f64 / RATE_HZ);
        let nearest = |head: &Vector3<f64>| {
            let found = people[frame - 1].iter().find(|p| error_m(p, head) < 0.08);
            found.map(|p| p.id)
        };
        [nearest(&heads[0]), nearest(&heads[1])]
    };
    let before = ids(15);
    assert!(before[0].is_some() && before[1].is_some() && before[0] != before[1], "{before:?}");
    assert_eq!(ids(34), before);
}

#[test]
fn trackers_that_share_edges_follow_as_those_that_find_their_own() {
    let prepared = prepared(4);
    let options = [Integration::PairsAngle, Integration::Sum]
        .map(|integration| CondensationOptions { integration, ..CondensationOptions::default() });
    let mut own = options.clone().map(|o| tracker(&prepared, o));
    let mut sharing = options.map(|o| tracker(&prepared, o));
    let mut shared = own[0].edges().clone();
    let mut most = 0;
    for frame in 1..=20 {
        let time_s = f64::from(frame) / RATE_HZ;
        let blind = frame as usize % 7;
        let picture_of = |(i, c): (usize, &PreparedCamera)| {
            if i == blind {
                CameraFrame::default()
            } else {
                CameraFrame::of_image(picture(c, &walker(time_s)))
            }
        };
        let cameras: Vec<CameraFrame> = prepared.cameras.iter().enumerate().map(picture_of).collect();
        let moment = Moment { frame, time_s, cameras: &cameras };
        shared.find(&moment);
        for (own, sharing) in own.iter_mut().zip(&mut sharing) {
            let people = own.step(&moment).unwrap();
            assert_eq!(sharing.follow(time_s, shared.images()), people);
            most = most.max(people.len());
        }
    }
    assert_eq!(most, 1);
}

/// A head, and a similar shape below and beside it.
const HEAD_AND_SHOULDER: [Vector3<f64>; 2] = [Vector3::new(3.0, 2.0, 1.7), Vector3::new(3.1, 2.1, 1.42)];

#[test]
fn a_headlike_shape_below_another_is_a_shoulder() {
    let prepared = prepared(4);
    let mut tracker = tracker(&prepared, CondensationOptions::default());
    let frame = |c: &PreparedCamera| CameraFrame::of_image(picture(c, &HEAD_AND_SHOULDER));
    let cameras: Vec<CameraFrame> = prepared.cameras.iter().map(frame).collect();
    tracker.find_edges(&Moment { frame: 1, time_s: 0.0, cameras: &cameras }).unwrap();
    let input = WeighingInput {
        head_weights: &tracker.head_weights,
        cameras: &prepared.cameras,
        edges: tracker.edges.images(),
        everybody: &[],
        sharpness: 2.0,
    };
    let above = |place: Vector3<f64>| {
        let support = tracker.head_weights.support(&place, 0.0, &input);
        assert!(support.is_seen(0.25), "{support:?}");
        let mut rng = rand_pcg::Pcg64Mcg::new(7);
        shoulder::head_above(&place, &support, &input, &mut rng).map(|(head, _)| head)
    };
    let [head, lower] = HEAD_AND_SHOULDER;
    let found = above(lower).expect("a head above the shoulder");
    assert!((found - head).norm() < 0.04, "{found}");
    assert_eq!(above(head), None);
}

#[test]
fn somebody_followed_by_a_shoulder_is_soon_followed_by_the_head() {
    let prepared = prepared(4);
    let options = CondensationOptions::default();
    let mut tracker = tracker(&prepared, options.clone());
    let [head, lower] = HEAD_AND_SHOULDER;
    tracker.tracks.push(HeadTrack::born(&ExpectedHead { head: lower, trust: 0.5 }, 1, &options));
    let frame = |c: &PreparedCamera| CameraFrame::of_image(picture(c, &HEAD_AND_SHOULDER));
    let cameras: Vec<CameraFrame> = prepared.cameras.iter().map(frame).collect();
    let mut step = |frame: u32| {
        let moment = Moment { frame, time_s: f64::from(frame) / RATE_HZ, cameras: &cameras };
        tracker.step(&moment).unwrap()
    };
    let people = (1..=20).map(&mut step).last().unwrap_or_default();
    assert!(people.len() == 1 && error_m(&people[0], &head) < 0.04, "{people:?}");
}

#[test]
fn people_are_found_a_step_past_their_gate_but_not_in_the_middle_of_the_room() {
    for (x_m, is_found) in [(1.9, true), (3.0, false)] {
        let standing = |_: f64| vec![Vector3::new(x_m, 2.0, 1.65)];
        let people = followed(&prepared(4), CondensationOptions::default(), 20, standing, |_, _| false);
        assert_eq!(people[19].len(), usize::from(is_found), "{x_m} m: {:?}", people[19]);
    }
}

#[test]
fn the_same_bytes_at_any_number_of_threads() {
    let prepared = prepared(3);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| followed(&prepared, CondensationOptions::default(), 18, walker, |_, _| false))
    };
    let one = with(1);
    assert!(one[17].len() == 1 && one == with(3));
    let other = CondensationOptions { seed: 2, ..CondensationOptions::default() };
    assert!(one != followed(&prepared, other, 18, walker, |_, _| false), "the seed matters");
}

#[test]
fn one_camera_and_odd_options_are_refused() {
    let refused =
        |prepared: PreparedRoom, options| Condensation::new(prepared, options).err().unwrap().to_string();
    assert!(refused(prepared(1), CondensationOptions::default()).contains("needs 2 to 32 cameras"));
    for (name, options) in [
        ("hypotheses", CondensationOptions { hypotheses: 0, ..CondensationOptions::default() }),
        ("beta", CondensationOptions { beta: f64::NAN, ..CondensationOptions::default() }),
        ("sharpness", CondensationOptions { sharpness: -1.0, ..CondensationOptions::default() }),
    ] {
        let error = refused(prepared(2), options);
        assert!(error.contains(name), "{error}");
    }
    let mut tracker = tracker(&prepared(2), CondensationOptions::default());
    let odd = CameraFrame::of_image(RgbImage::new(3, 3));
    let error = tracker.step(&Moment { frame: 7, time_s: 0.0, cameras: &[odd, CameraFrame::default()] });
    assert!(error.unwrap_err().to_string().contains("frame 7 is 3 × 3"));
}

#[test]
fn a_gate_that_one_camera_sees_is_told() {
    let mut prepared = prepared(2);
    // A wall before everything that the second camera sees.
    prepared.cameras[1].static_z_m.fill(0.5);
    let (_, unseen) = Initiator::new(&prepared, &CondensationOptions::default());
    let warning = unseen.to_string();
    assert!(unseen.is_all && warning.contains("`west`: c0 alone") && warning.contains("mcmc"), "{warning}");
}

#[test]
fn a_map_peaks_at_the_head() {
    let prepared = prepared(4);
    let mut tracker = tracker(&prepared, CondensationOptions::default());
    let head = Vector3::new(1.7, 2.4, 1.6);
    let frame = |c: &PreparedCamera| CameraFrame::of_image(picture(c, &[head]));
    let cameras: Vec<CameraFrame> = prepared.cameras.iter().map(frame).collect();
    let moment = Moment { frame: 1, time_s: 0.0, cameras: &cameras };
    for map in tracker.weight_maps(&moment, &Integration::ALL, head.z).unwrap() {
        let (peak, _) = map.peak().unwrap();
        assert!((peak - head.xy()).coords.norm() < 0.08, "{}: {peak}", map.integration);
        let picture = map.picture(&prepared);
        let cell_px = f64::from(picture.width()) / map.columns as f64;
        let at = (peak - map.low) / map.cell_m * cell_px;
        let brightest = picture.get_pixel(at.x as u32, (f64::from(picture.height()) - at.y) as u32);
        assert_eq!(*brightest, Rgb([255; 3]), "{}", map.integration);
        let mean =
            picture.as_raw().iter().map(|v| f64::from(*v)).sum::<f64>() / picture.as_raw().len() as f64;
        assert!(mean < 128.0, "{}: {mean}", map.integration);
    }
}
