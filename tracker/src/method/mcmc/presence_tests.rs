//! Tests of people who did not come in through a zone in sight of the cameras: after an outage, after a camera has
//! come back, and in the place of furniture.

use image::GrayImage;
use scenes::depth;
use scenes::geometry::Geometry;
use scenes::polygon::Polygon;
use scenes::raycast::RayScene;
use scenes::room::ZoneKind;
use scenes::walkable::WalkableMap;

use super::tests::{Feeder, cuboid, empty_room, masks, room, stand, standing};
use super::*;
use crate::TrackId;
use crate::prepared_room::Floor;

const BOTH_CORNERS: [(f64, f64); 2] = [(0.2, 0.2), (0.2, 4.8)];

fn seeded(seed: u64) -> McmcOptions {
    McmcOptions { seed, ..McmcOptions::default() }
}

/// Frames in which no camera has a mask.
fn blind() -> Vec<CameraFrame> {
    vec![CameraFrame::default(); 2]
}

/// Whether exactly one person is reported, at the place of a body.
fn is_reported(people: &[PersonEstimate], body: &Body) -> bool {
    people.iter().any(|p| (p.x_m - body.x_m).hypot(p.y_m - body.y_m) < 0.25)
}

#[test]
fn people_who_came_in_during_an_outage_are_reported_within_two_seconds() {
    for seed in 1..=4 {
        for (rate_hz, with_moments, walks) in
            [(12.0, true, false), (12.0, false, true), (1.0, true, false), (60.0, false, true)]
        {
            let mut feeder = Feeder::after_nobody(empty_room(), seeded(seed));
            let before = feeder.bring_in();
            let mut feeder = feeder.at_rate(rate_hz);
            if with_moments {
                feeder = feeder.at_rate(1.0);
                for second in 1..=600 {
                    let people = feeder.feed(&blind());
                    assert!(second < 40 || people.is_empty(), "nobody is carried for ever: {people:?}");
                }
                feeder = feeder.at_rate(rate_hz);
            } else {
                feeder.skip(600.0);
            }
            let place = |seconds: f64| {
                let x_m = if walks { 1.8 + 0.8 * seconds } else { 2.0 };
                [standing(x_m, 3.4), standing(2.9, 1.2)]
            };
            let moments = (2.0 * rate_hz) as u32;
            let mut people = Vec::new();
            for moment in 1..=moments {
                people = feeder.see(&place(f64::from(moment) / rate_hz));
            }
            let bodies = place(2.0);
            let reported = people.len() == 2 && bodies.iter().all(|body| is_reported(&people, body));
            assert!(reported, "seed {seed}, {rate_hz} frames a second: {people:?}");
            assert!(people.iter().all(|p| p.id != before.id), "nobody is known after ten minutes");
        }
    }
}

#[test]
fn a_person_keeps_the_id_over_an_outage_of_a_few_seconds() {
    for seed in 1..=4 {
        for (seconds, moved_m) in [(1.0, 0.0), (3.0, 1.0), (6.0, 0.0), (6.0, 1.5)] {
            let mut feeder = Feeder::after_nobody(empty_room(), seeded(seed));
            let before = feeder.bring_in();
            feeder.skip(seconds);
            let now = standing(3.1 - moved_m, 1.6 + 0.5 * moved_m);
            let people = (0..12).map(|_| feeder.see(&[now])).last().unwrap();
            let ids: Vec<TrackId> = people.iter().map(|p| p.id).collect();
            assert_eq!(ids, [before.id], "seed {seed}, {seconds} s, {moved_m} m: {people:?}");
            assert!(is_reported(&people, &now), "{people:?}");
        }
    }
}

#[test]
fn a_person_whom_all_masks_lose_for_three_seconds_is_found_under_the_same_id() {
    for seed in 1..=4 {
        for (x_m, y_m) in [(3.1, 1.6), (1.6, 2.4), (2.4, 3.4)] {
            let mut feeder = Feeder::after_nobody(empty_room(), seeded(seed));
            let before = feeder.bring_in();
            for _ in 0..36 {
                feeder.see(&[]);
            }
            let now = standing(x_m, y_m);
            let people = (0..12).map(|_| feeder.see(&[now])).last().unwrap();
            let ids: Vec<TrackId> = people.iter().map(|p| p.id).collect();
            assert_eq!(ids, [before.id], "seed {seed}, ({x_m}, {y_m}): {people:?}");
            assert!(is_reported(&people, &now), "{people:?}");
        }
    }
}

#[test]
fn somebody_who_comes_in_while_the_masks_lose_another_has_an_id_of_their_own() {
    for seed in 1..=4 {
        let mut feeder = Feeder::after_nobody(empty_room(), seeded(seed));
        let before = feeder.bring_in();
        for _ in 0..36 {
            feeder.see(&[]);
        }
        let both = [standing(3.1, 1.6), standing(5.6, 1.6)];
        let people = (0..12).map(|_| feeder.see(&both)).last().unwrap();
        let near = |body: &Body| people.iter().find(|p| (p.x_m - body.x_m).hypot(p.y_m - body.y_m) < 0.25);
        assert_eq!(near(&both[0]).map(|p| p.id), Some(before.id), "seed {seed}: {people:?}");
        assert!(near(&both[1]).is_some_and(|p| p.id != before.id), "seed {seed}: {people:?}");
    }
}

#[test]
fn a_person_who_left_during_an_outage_is_gone_soon_after() {
    for seed in 1..=4 {
        let mut feeder = Feeder::after_nobody(empty_room(), seeded(seed));
        feeder.bring_in();
        feeder.skip(8.0);
        let people = (0..24).map(|_| feeder.see(&[])).last().unwrap();
        assert_eq!(people, [], "seed {seed}");
    }
}

/// Room whose floor continues for two metres behind the wall with the door, out of all cameras' sight.
fn room_with_corridor() -> PreparedRoom {
    let mut stage = room(&BOTH_CORNERS, ZoneKind::Both);
    let rectangle = |x0, y0, x1, y1| Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1));
    let floor = WalkableMap::of_polygons(&[rectangle(0.0, 0.0, 6.0, 5.0), rectangle(6.0, -1.0, 8.5, 6.0)]);
    stage.floor = Floor::new(floor, &stage.zones, &[]);
    stand(&mut stage, [6.0, -1.0, 0.0], [6.1, 1.0, 2.6]);
    stand(&mut stage, [6.0, 2.2, 0.0], [6.1, 6.0, 2.6]);
    stage
}

#[test]
fn a_person_who_left_through_a_door_is_not_followed_behind_the_wall() {
    for seed in 1..=8 {
        let mut feeder = Feeder::after_nobody(room_with_corridor(), seeded(seed));
        let known = feeder.bring_in();
        // The person walks through the door, and aside behind the wall.
        let (inside, door, aside) = ([3.1, 1.6], [6.2, 1.6], [7.0, 4.0]);
        for [from, to] in [[inside, door], [door, aside]] {
            for step in 1..=30 {
                let share = f64::from(step) / 30.0;
                let at = |i: usize| from[i] + share * (to[i] - from[i]);
                let people = feeder.see(&[standing(at(0), at(1))]);
                if at(0) < 4.5 {
                    assert!(people.iter().any(|p| p.id == known.id), "seed {seed}: {people:?}");
                }
            }
        }
        let people = (0..36).map(|_| feeder.see(&[])).last().unwrap();
        assert_eq!(people, [], "seed {seed}");
    }
}

/// Only one camera sees the middle of the room, and it starts late.
#[test]
fn a_person_before_a_camera_that_comes_late_is_rescued() {
    let mut stage = room(&BOTH_CORNERS, ZoneKind::Both);
    // A wall close to the first camera.
    stand(&mut stage, [0.3, 0.6, 0.0], [2.2, 0.7, 2.5]);
    let person = standing(2.0, 2.0);
    let seen = masks(&stage, &[person]);
    assert!(seen[0].mask.iter().all(|mask| mask.count() == 0), "the wall hides the place");
    for seed in 1..=4 {
        let reported_after = |rescues_per_s: f64, rate_hz: f64| {
            let options = McmcOptions { rescues_per_s, ..seeded(seed) };
            let mut feeder = Feeder::at_first(stage.clone(), options).at_rate(rate_hz);
            let late = |feeder: &mut Feeder| {
                let mut cameras = masks(&feeder.stage, &[person]);
                cameras[1] = CameraFrame::default();
                feeder.feed(&cameras)
            };
            (0..(5.0 * rate_hz) as u32).for_each(|_| assert_eq!(late(&mut feeder), []));
            (1..=(8.0 * rate_hz) as u32)
                .find(|_| is_reported(&feeder.see(&[person]), &person))
                .map(|m| f64::from(m) / rate_hz)
        };
        assert_eq!(reported_after(0.0, 12.0), None, "the test needs no rescue");
        for (rate_hz, most_s) in [(12.0, 2.6), (1.0, 7.0), (40.0, 2.6)] {
            let after_s = reported_after(McmcOptions::default().rescues_per_s, rate_hz);
            assert!(
                after_s.is_some_and(|s| (2.0..most_s + 1e-9).contains(&s)),
                "seed {seed}, {rate_hz}/s: {after_s:?}"
            );
        }
    }
}

/// One of several walking people, whom neither camera has seen until now: both cameras see the place.
#[test]
fn a_person_whom_several_cameras_see_is_rescued_walking_or_not() {
    for seed in 1..=4 {
        for speed_m_s in [0.0, 0.4, 0.8] {
            let mut feeder = Feeder::after_nobody(empty_room(), seeded(seed));
            let known = feeder.bring_in();
            let mut reported = None;
            for moment in 1..=36 {
                let found = standing(1.7, 3.0 - speed_m_s * f64::from(moment) / 12.0);
                let people = feeder.see(&[standing(3.1, 1.6), found]);
                assert!(people.iter().any(|p| p.id == known.id), "the other stays who they are");
                if people.len() == 2 && is_reported(&people, &found) {
                    reported = reported.or(Some(moment));
                }
            }
            println!("seed {seed}, {speed_m_s} m/s: reported after {reported:?} moments");
            assert!(
                reported.is_some_and(|moment| moment <= 34),
                "seed {seed}, {speed_m_s} m/s: {reported:?}"
            );
        }
    }
}

/// Masks of a chair: a seat on a stem, with a back.
fn chair_masks(stage: &PreparedRoom, x_m: f32, y_m: f32) -> Vec<CameraFrame> {
    let parts = [
        cuboid([x_m - 0.25, y_m - 0.25, 0.0], [x_m + 0.25, y_m + 0.25, 0.48]),
        cuboid([x_m - 0.25, y_m + 0.15, 0.0], [x_m + 0.25, y_m + 0.25, 0.95]),
    ];
    let scenes = parts.map(|mesh| RayScene::new(&Geometry::Mesh(mesh)).unwrap());
    let seen = |camera: &PreparedCamera| {
        let mut mask = GrayImage::new(camera.width(), camera.height());
        for scene in &scenes {
            for (pixel, met_m) in mask.iter_mut().zip(depth::render(scene, &camera.pinhole).z_m) {
                *pixel = (*pixel).max(255 * u8::from(met_m > 0.0));
            }
        }
        CameraFrame::of_mask(&mask)
    };
    stage.cameras.iter().map(seen).collect()
}

#[test]
fn nobody_is_born_of_a_chair_that_was_moved() {
    // The chair is put there in sight of the cameras, during an outage, or before the start.
    let ways = ["seen", "outage", "start"];
    for (cameras, way) in [1, 2].into_iter().flat_map(|cameras| ways.map(|way| (cameras, way))) {
        let stage = room(&BOTH_CORNERS[..cameras], ZoneKind::Both);
        for (seed, (x_m, y_m)) in (1..).zip([(1.4, 2.0), (2.4, 3.4), (3.2, 2.5), (4.2, 3.8), (3.9, 1.2)]) {
            let mut feeder = match way {
                "start" => Feeder::at_first(stage.clone(), seeded(seed)),
                _ => Feeder::after_nobody(stage.clone(), seeded(seed)),
            };
            if way == "outage" {
                feeder.skip(60.0);
            }
            let chair = chair_masks(&stage, x_m, y_m);
            for moment in 0..120 {
                let people = feeder.feed(&chair);
                assert_eq!(people, [], "{cameras} cameras, {way}, {x_m} {y_m}, moment {moment}");
            }
        }
    }
}

#[test]
fn a_person_standing_since_the_start_is_reported_eventually() {
    for seed in 1..=4 {
        for body in [standing(2.0, 3.0), standing(3.4, 1.4)] {
            let mut feeder = Feeder::at_first(empty_room(), seeded(seed));
            let reported = (0..60).map(|_| feeder.see(&[body])).map(|people| is_reported(&people, &body));
            let reported: Vec<bool> = reported.collect();
            assert!(
                !reported[..12].iter().any(|reported| *reported),
                "seed {seed}: an unmoved track at the start may be furniture"
            );
            assert!(
                reported[42..].iter().all(|reported| *reported),
                "seed {seed}: not reported after three and a half seconds"
            );
        }
    }
}

/// The rays to one of two people in one camera meet the rays to the other person in the other camera.
#[test]
fn nobody_is_born_where_the_rays_of_two_people_meet() {
    for seed in 1..=6 {
        let mut feeder = Feeder::after_nobody(empty_room(), seeded(seed));
        // Both people came in; they pass so that the rays meet in front of and behind them.
        let mut strangers = 0;
        for moment in 0..160 {
            let step = f64::from(moment);
            let first = standing((5.8 - 0.1 * step).max(2.0), 1.6 + 0.01 * (step - 40.0).max(0.0));
            let second =
                standing((8.0 - 0.1 * step).max(2.2), 2.0 + 0.6 * ((step - 30.0) / 60.0).clamp(0.0, 1.0));
            let bodies: Vec<Body> = [first, second]
                .into_iter()
                .filter(|body| feeder.stage.floor.is_standable(body.x_m, body.y_m))
                .collect();
            let people = feeder.see(&bodies);
            strangers += people
                .iter()
                .filter(|p| !bodies.iter().any(|b| is_reported(std::slice::from_ref(p), b)))
                .count();
        }
        assert!(strangers < 4, "seed {seed}: {strangers} moments with a stranger");
    }
}
