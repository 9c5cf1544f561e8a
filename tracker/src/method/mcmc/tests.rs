//! Tests of the whole sampler, on moments constructed to check one rule each.

use calib::{Camera, Intrinsics};
use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point3, Vector3};
use scenes::depth;
use scenes::geometry::{Geometry, Mesh};
use scenes::polygon::Polygon;
use scenes::raycast::RayScene;
use scenes::room::{Zone, ZoneKind};
use scenes::walkable::WalkableMap;

use super::*;
use crate::TrackId;
use crate::prepared_room::Floor;
use crate::silhouette::Silhouette;

const RATE_HZ: f64 = 12.0;

/// Room of 6 × 5 m without furniture, with two cameras in its corners and a door in the wall x = 6.
pub(crate) fn empty_room() -> PreparedRoom {
    room(&[(0.2, 0.2), (0.2, 4.8)], ZoneKind::Both)
}

/// Room of 6 × 5 m with cameras at these places, 2.4 m above the floor, and a door of this kind.
pub(super) fn room(cameras: &[(f64, f64)], kind: ZoneKind) -> PreparedRoom {
    let camera = |(x, y): &(f64, f64)| {
        let pose =
            Isometry3::face_towards(&Point3::new(*x, *y, 2.4), &Point3::new(3.0, 2.5, 0.9), &-Vector3::z());
        let intrinsics = Intrinsics::from_horizontal_fov(240, 180, 80.0);
        let mut camera = PreparedCamera::new("c", &Camera { intrinsics, camera_from_world: pose.inverse() });
        camera.set_floor();
        camera
    };
    let rectangle = |x0, y0, x1, y1| Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1));
    let door = Zone { name: "door".into(), polygon: rectangle(5.0, 1.0, 6.0, 2.2), kind };
    let floor = WalkableMap::of_polygons(&[rectangle(0.0, 0.0, 6.0, 5.0)]);
    PreparedRoom {
        cameras: cameras.iter().map(camera).collect(),
        floor: Floor::new(floor, std::slice::from_ref(&door), &[]),
        zones: vec![door],
    }
}

pub(crate) fn standing(x_m: f64, y_m: f64) -> Body {
    Body { x_m, y_m, radius_m: 0.25, height_m: 1.75 }
}

/// Masks of bodies in all cameras, with nothing in front of the bodies.
pub(crate) fn masks(stage: &PreparedRoom, bodies: &[Body]) -> Vec<CameraFrame> {
    let seen = |camera: &PreparedCamera| {
        let mut mask = GrayImage::new(camera.width(), camera.height());
        for body in bodies {
            for (u, v) in Silhouette::new(&View::new(camera), &body.ellipsoid()).pixels() {
                mask.put_pixel(u, v, Luma([255]));
            }
        }
        CameraFrame::of_mask(&mask)
    };
    stage.cameras.iter().map(seen).collect()
}

/// Tracker that is fed frame by frame.
pub(super) struct Feeder {
    pub(super) stage: PreparedRoom,
    pub(super) mcmc: Mcmc,
    frame: u32,
    /// Time at which the present frame rate began, seconds, and frames since.
    since_s: f64,
    frames: u32,
    rate_hz: f64,
}

impl Feeder {
    /// Tracker before its first frame.
    pub(super) fn at_first(stage: PreparedRoom, options: McmcOptions) -> Self {
        let mcmc = Mcmc::new(stage.clone(), options).unwrap();
        Self { mcmc, stage, frame: 0, since_s: 0.0, frames: 0, rate_hz: RATE_HZ }
    }

    /// Continues at another frame rate, 1/s.
    pub(super) fn at_rate(self, rate_hz: f64) -> Self {
        Self { since_s: self.time_s(), frames: 0, rate_hz, ..self }
    }

    /// Advances the time without any moment.
    pub(super) fn skip(&mut self, seconds: f64) {
        self.since_s += seconds;
    }

    /// Tracker in the empty room, after one second of frames without people.
    fn new(seed: u64) -> Self {
        Self::after_nobody(empty_room(), McmcOptions { seed, ..McmcOptions::default() })
    }

    /// Tracker after one second of frames without people.
    pub(super) fn after_nobody(stage: PreparedRoom, options: McmcOptions) -> Self {
        let mut feeder = Self::at_first(stage, options);
        for _ in 0..12 {
            assert_eq!(feeder.see(&[]), []);
        }
        feeder
    }

    pub(super) fn feed(&mut self, cameras: &[CameraFrame]) -> Vec<PersonEstimate> {
        self.frame += 1;
        self.frames += 1;
        self.mcmc.step(&Moment { frame: self.frame, time_s: self.time_s(), cameras }).unwrap()
    }

    fn time_s(&self) -> f64 {
        self.since_s + f64::from(self.frames) / self.rate_hz
    }

    pub(super) fn see(&mut self, bodies: &[Body]) -> Vec<PersonEstimate> {
        let cameras = masks(&self.stage, bodies);
        self.feed(&cameras)
    }

    /// Feeds a person who comes in through the door, walks to (3.1, 1.6) and stays there for a second.
    pub(super) fn bring_in(&mut self) -> PersonEstimate {
        for step in 0..30 {
            self.see(&[standing(6.0 - 0.1 * f64::from(step), 1.6)]);
        }
        let seen = (0..12).map(|_| self.see(&[standing(3.1, 1.6)])).last().unwrap();
        assert_eq!(seen.len(), 1, "{seen:?}");
        seen[0].clone()
    }
}

#[test]
fn people_come_in_through_zones_and_nowhere_else() {
    // Persistent evidence is tested elsewhere.
    let options = McmcOptions { rescues_per_s: 0.0, ..McmcOptions::default() };
    let mut feeder = Feeder::after_nobody(empty_room(), options);
    for _ in 0..24 {
        assert_eq!(feeder.see(&[standing(2.0, 3.5)]), [], "nobody appears in the middle of a room");
    }
    let mut feeder = Feeder::new(1);
    let person = feeder.bring_in();
    assert!((person.x_m - 3.1).hypot(person.y_m - 1.6) < 0.1, "{person:?}");
}

#[test]
fn a_hidden_person_keeps_the_id_with_growing_uncertainty() {
    let mut feeder = Feeder::new(2);
    let before = feeder.bring_in();
    let blind = vec![CameraFrame::default(); 2];
    let mut sigma_m = before.sigma_m[0];
    for _ in 0..36 {
        let people = feeder.feed(&blind);
        assert_eq!(people.iter().map(|p| p.id).collect::<Vec<_>>(), [before.id]);
        assert!(people[0].sigma_m[0] > sigma_m, "{} after {sigma_m}", people[0].sigma_m[0]);
        sigma_m = people[0].sigma_m[0];
    }
    assert!(sigma_m > 0.3, "{sigma_m}");
    // The person has stepped aside meanwhile and keeps the id.
    let after = (0..12).map(|_| feeder.see(&[standing(3.3, 1.9)])).last().unwrap();
    assert_eq!(after.len(), 1);
    assert_eq!(after[0].id, before.id);
    assert!((after[0].x_m - 3.3).hypot(after[0].y_m - 1.9) < 0.12, "{after:?}");
}

#[test]
fn people_leave_through_zones() {
    let mut feeder = Feeder::new(3);
    let person = feeder.bring_in();
    for step in 0..40 {
        feeder.see(&[standing(3.1 + 0.1 * f64::from(step), 1.6)]);
    }
    let mut people = Vec::new();
    for _ in 0..36 {
        people = feeder.see(&[]);
    }
    assert_eq!(people, [], "person {} has left", person.id);
}

/// A person partly on the doorstep is reported with a reduced confidence.
#[test]
fn confidence_falls_while_a_person_walks_out_of_the_room() {
    let mut feeder = Feeder::new(3);
    feeder.bring_in();
    let mut on_the_edge = 0;
    for step in 0..90 {
        for person in feeder.see(&[standing(3.1 + 0.04 * f64::from(step), 1.6)]) {
            let sigmas = (6.0 - person.x_m) / person.sigma_m[0];
            if sigmas < 1.0 {
                on_the_edge += 1;
                assert!((0.4..0.9).contains(&person.confidence), "{person:?}");
            } else if person.x_m < 4.9 {
                assert!(person.confidence > 0.99, "{person:?}");
            }
        }
    }
    assert!(on_the_edge > 0);
}

#[test]
fn a_person_inside_from_the_beginning_is_found_after_moving() {
    let mut feeder = Feeder::at_first(empty_room(), McmcOptions::default());
    for _ in 0..12 {
        let people = feeder.see(&[standing(2.0, 3.0)]);
        assert_eq!(people, [], "an unmoved track at the start may be furniture");
    }
    let mut people = Vec::new();
    for step in 0..18 {
        people = feeder.see(&[standing(2.0 + 0.08 * f64::from(step), 3.0)]);
    }
    assert_eq!(people.len(), 1, "{people:?}");
}

#[test]
fn people_leave_through_a_door_that_is_an_exit_alone() {
    for seed in 1..=3 {
        let stage = room(&[(0.2, 0.2), (0.2, 4.8)], ZoneKind::Exit);
        let mut feeder = Feeder::at_first(stage, McmcOptions { seed, ..McmcOptions::default() });
        let mut people = Vec::new();
        let there = |step: u32| 0.1 * f64::from(step);
        for step in 0..30 {
            people = feeder.see(&[standing(2.0 + there(step), 1.6), standing(1.5 + 0.3 * there(step), 3.5)]);
        }
        assert_eq!(people.len(), 2, "they were inside: {people:?}");
        for step in 30..55 {
            feeder.see(&[standing(2.0 + there(step), 1.6), standing(2.4, 3.5)]);
        }
        for _ in 0..36 {
            people = feeder.see(&[standing(2.4, 3.5)]);
        }
        let [stays] = people.as_slice() else { panic!("one of two has left: {people:?}") };
        assert!((stays.x_m - 2.4).hypot(stays.y_m - 3.5) < 0.1, "{stays:?}");
        assert_eq!(
            feeder.mcmc.tracks.len(),
            1,
            "a person who has left is not tracked on the doorstep either"
        );
    }
}

/// Draws an upright box into the cameras' static depth.
pub(super) fn stand(stage: &mut PreparedRoom, low: [f32; 3], high: [f32; 3]) {
    let scene = RayScene::new(&Geometry::Mesh(cuboid(low, high))).unwrap();
    for camera in &mut stage.cameras {
        let depth = depth::render(&scene, &camera.pinhole);
        for (z_m, met_m) in camera.static_z_m.iter_mut().zip(depth.z_m).filter(|(_, met_m)| *met_m > 0.0) {
            *z_m = z_m.min(met_m);
        }
    }
}

/// Upright box.
pub(super) fn cuboid(low: [f32; 3], high: [f32; 3]) -> Mesh {
    let vertices = (0..8).map(|corner| {
        glam::Vec3::from_array(std::array::from_fn(|axis| {
            if corner >> axis & 1 == 0 { low[axis] } else { high[axis] }
        }))
    });
    let side = |[a, b, c, d]: [u32; 4]| [[a, b, c], [c, b, d]];
    let sides = [[0, 1, 2, 3], [4, 5, 6, 7], [0, 1, 4, 5], [2, 3, 6, 7], [0, 2, 4, 6], [1, 3, 5, 7]];
    let triangles = sides.into_iter().flat_map(side).collect();
    Mesh { vertices: vertices.collect(), triangles, colors: vec![[0; 3]; 8] }
}

/// A pillar hides the body, but not all that arms could reach beyond it: an unseen track neither ends nor walks away.
#[test]
fn a_person_behind_a_pillar_of_body_width_keeps_the_track() {
    for (seed, width_m) in (1..=4).zip([0.50, 0.54, 0.58, 0.62]) {
        let mut stage = room(&[(0.2, 2.5)], ZoneKind::Both);
        stand(&mut stage, [2.6, 3.24 - 0.5 * width_m, 0.0], [2.9, 3.24 + 0.5 * width_m, 2.5]);
        let mut feeder = Feeder::after_nobody(stage, McmcOptions { seed, ..McmcOptions::default() });
        let walk = |from: [f64; 2], to: [f64; 2], part: f64| {
            let [x, y]: [f64; 2] = std::array::from_fn(|i| from[i] + part * (to[i] - from[i]));
            standing(x, y)
        };
        let parts = || (0..=24).map(|step| f64::from(step) / 24.0);
        parts().for_each(|part| drop(feeder.see(&[walk([6.0, 1.6], [3.7, 1.6], part)])));
        let last = parts().map(|part| feeder.see(&[walk([3.7, 1.6], [3.3, 3.4], part)])).last().unwrap();
        let [person] = last.as_slice() else { panic!("{last:?}") };
        for frame in 0..10 * 12 {
            let people = feeder.see(&[standing(3.3, 3.4)]);
            let ids: Vec<TrackId> = people.iter().map(|p| p.id).collect();
            assert_eq!(ids, [person.id], "{width_m} m wide, frame {frame}");
        }
    }
}

/// Whether both of two people who come in merged, `gap_m` apart and either abreast or one behind the other, are
/// reported at their places 1.5 s after they begin to part in the middle of the room.
fn both_are_reported(gap_m: f64, abreast: bool, options: McmcOptions) -> bool {
    let mut feeder = Feeder::after_nobody(empty_room(), options);
    let (mut people, mut bodies) = (Vec::new(), [standing(0.0, 0.0); 2]);
    for step in (0..=50).map(f64::from) {
        let x_m = (6.2 - 0.1 * step).max(3.0);
        let apart_m = 0.05 * (step - 32.0).max(0.0);
        bodies = if abreast {
            let (y_m, other_m) = (1.6 - 0.5 * gap_m - apart_m, 1.6 + 0.5 * gap_m + apart_m);
            [standing(x_m, y_m), standing(x_m, other_m)]
        } else {
            [standing(x_m - apart_m, 1.6), standing(x_m + gap_m, 1.6 + apart_m)]
        };
        people = feeder.see(&bodies);
    }
    let is_reported = |body: &Body| {
        people.iter().any(|p: &PersonEstimate| (p.x_m - body.x_m).hypot(p.y_m - body.y_m) < 0.2)
    };
    people.len() == 2 && bodies.iter().all(is_reported)
}

#[test]
fn two_people_who_came_in_merged_are_separated_after_parting() {
    let pairs = || [0.25, 0.35, 0.45].into_iter().flat_map(|gap_m| [(gap_m, true), (gap_m, false)]);
    let count_reported = |companions_per_s: f64| {
        let runs = (1..=4).flat_map(|seed| pairs().map(move |pair| (seed, pair)));
        let both = runs.filter(|(seed, (gap_m, abreast))| {
            let options = McmcOptions { seed: *seed, companions_per_s, ..McmcOptions::default() };
            both_are_reported(*gap_m, *abreast, options)
        });
        both.count()
    };
    let (with, without) = (count_reported(McmcOptions::default().companions_per_s), count_reported(0.0));
    println!("both of 24 pairs are reported: {with}, and {without} without births of companions");
    assert!(with >= 20, "{with} of 24");
    assert!(without <= 12, "{without} of 24: the pairs are too easy");
}
