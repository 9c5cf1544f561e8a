//! Plans of simple rooms: the position of each thing, to the pixel.

use super::*;
use crate::geometry::{Geometry, Mesh};
use crate::polygon::Polygon;
use crate::room::{Line, Region, RoomCamera, Zone, ZoneKind};
use crate::view::look_at;
use approx::assert_relative_eq;
use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Point3, Rotation2};

/// The six faces of a box, wound so that normals point outwards, or inwards.
fn push_box(mesh: &mut Mesh, low: [f32; 3], high: [f32; 3], color: [u8; 3], inwards: bool) {
    let first = mesh.vertices.len() as u32;
    for i in 0..8 {
        let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        mesh.vertices.push(Vec3::new(pick(0), pick(1), pick(2)));
        mesh.colors.push(color);
    }
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        for [p, q, r] in [[a, b, c], [a, c, d]] {
            let corners = [p, q, r].map(|i: u32| first + i);
            mesh.triangles.push(if inwards { [corners[0], corners[2], corners[1]] } else { corners });
        }
    }
}

/// 6 × 4 m, ceiling at 2.5 m; a red table 1 m high and a pillar to the ceiling.
fn room() -> Room {
    let mut mesh = Mesh::default();
    push_box(&mut mesh, [0.0, 0.0, 0.0], [6.0, 4.0, 2.5], [210, 210, 210], true);
    push_box(&mut mesh, [1.0, 1.0, 0.0], [2.0, 2.0, 1.0], [210, 0, 0], false);
    push_box(&mut mesh, [4.0, 2.0, 0.0], [4.5, 2.5, 2.5], [210, 210, 210], false);
    let camera = Camera {
        intrinsics: Intrinsics::from_horizontal_fov(640, 480, 70.0),
        camera_from_world: look_at(&Point3::new(0.2, 0.2, 2.3), &Point3::new(3.0, 2.0, 0.5)),
    };
    Room {
        cameras: vec![RoomCamera { name: "cam".into(), camera, reference: None }],
        zones: vec![Zone {
            name: "door".into(),
            polygon: Polygon::rectangle(Point2::new(5.0, 0.5), Point2::new(6.0, 1.5)),
            kind: ZoneKind::Both,
        }],
        walkable: None,
        geometry: Some(Geometry::Mesh(mesh)),
        ..Room::default()
    }
}

#[test]
fn metres_and_pixels_go_back_and_forth() {
    let mapping = FloorPlan::new(&Room::default(), &PlanOptions::default()).unwrap().mapping();
    let (a, b) = (Point2::new(1.3, -2.2), Point2::new(2.3, -1.2));
    assert_relative_eq!(mapping.floor(&mapping.pixel(&a)), a, epsilon = 1e-9);
    let along = mapping.pixel(&b) - mapping.pixel(&a);
    assert_relative_eq!(along, Vector2::new(mapping.px_per_m, -mapping.px_per_m), epsilon = 1e-9);
}

#[test]
fn the_plan_shows_each_thing_where_it_stands() {
    let options = PlanOptions { marks: false, longest_side_px: 900, ..PlanOptions::default() };
    let plan = FloorPlan::new(&room(), &options).unwrap();
    let mapping = plan.mapping();
    let image = plan.into_image();
    assert!(image.width().max(image.height()).abs_diff(900) <= 1);
    let at = |x: f64, y: f64| {
        let p = mapping.pixel(&Point2::new(x, y));
        image.get_pixel(p.x.round() as u32, p.y.round() as u32).0
    };
    let is_red = |c: [u8; 3]| c[0] > 150 && c[1] < 110;
    // These points are not on grid lines.
    for (x, y) in [(1.5, 1.5), (1.05, 1.95), (1.95, 1.05)] {
        assert!(is_red(at(x, y)), "{x} {y} {:?}", at(x, y));
    }
    for (x, y) in [(0.9, 1.5), (2.1, 1.5), (3.5, 3.5), (5.5, 0.5)] {
        let [r, g, b] = at(x, y);
        assert!(r > 150 && r.abs_diff(g) < 12 && r.abs_diff(b) < 12, "{x} {y}");
    }
    // The pillar is cut through, and so is the wall; outside there is paper.
    assert!(at(4.25, 2.25)[0] < 80 && at(0.0, 1.5)[0] < 110 && at(3.5, 4.0)[0] < 110);
    assert_eq!(at(-0.2, 1.5), [Color::PAPER.r, Color::PAPER.g, Color::PAPER.b]);
    // The floor is darker in the corner between floor and table than in the open.
    assert!(at(2.03, 1.5)[0] < at(3.5, 3.5)[0]);
}

#[test]
fn marks_are_drawn_where_cameras_and_zones_are() {
    let corner = Point2::new(2.5, 0.4);
    let room = Room {
        regions: vec![Region {
            name: "r".into(),
            polygon: Polygon::rectangle(corner, Point2::new(3.3, 0.9)),
            dwell_s: None,
        }],
        // North to south: its right is west.
        lines: vec![Line { name: "l".into(), points: vec![Point2::new(5.2, 3.6), Point2::new(5.2, 2.6)] }],
        ..room()
    };
    let plain = FloorPlan::new(&room, &PlanOptions { marks: false, ..PlanOptions::default() }).unwrap();
    let marked = FloorPlan::new(&room, &PlanOptions::default()).unwrap();
    let mapping = plain.mapping();
    let (plain, marked) = (plain.into_image(), marked.into_image());
    let changed = |x: f64, y: f64| {
        let p = mapping.pixel(&Point2::new(x, y));
        let (u, v) = (p.x.round() as u32, p.y.round() as u32);
        plain.get_pixel(u, v) != marked.get_pixel(u, v)
    };
    assert!(changed(5.1, 0.6) && changed(5.9, 1.4), "the zone");
    assert!(changed(2.55, 0.45) && changed(3.25, 0.85) && !changed(2.45, 0.65), "the region");
    // The arrow goes as far to both sides, but its head, wider than its shaft, is on the right.
    let px_m = 1.0 / mapping.px_per_m;
    let thick = |x: f64| (-20..=20).filter(|i| changed(x, 3.1 + f64::from(*i) * 0.5 * px_m)).count();
    assert!(changed(5.2, 3.5) && changed(5.2, 2.7), "the line");
    assert!(thick(5.2 - 10.0 * px_m) > thick(5.2 + 10.0 * px_m), "the arrow");
    // The camera looks towards (2.8, 1.8) with 35° to either side: 0.7 m ahead is in its cone, 0.7 m behind is not.
    let ahead = Vector2::new(2.8, 1.8).normalize();
    let sideways = Rotation2::new(45_f64.to_radians()) * ahead;
    assert!(changed(0.2 + 0.7 * ahead.x, 0.2 + 0.7 * ahead.y));
    assert!(!changed(0.2 + 0.7 * sideways.x, 0.2 + 0.7 * sideways.y));
    assert!(!changed(3.25, 2.75));
}

#[test]
fn a_given_walkable_floor_is_outlined_and_no_other() {
    let draw = |walkable: WalkableMap| {
        let plan =
            FloorPlan::new(&room(), &PlanOptions { walkable: Some(walkable), ..PlanOptions::default() })
                .unwrap();
        (plan.mapping(), plan.into_image())
    };
    let region = Polygon::rectangle(Point2::new(2.5, 0.3), Point2::new(4.5, 1.7));
    let (mapping, bare) = draw(WalkableMap::everywhere());
    let (_, outlined) = draw(WalkableMap::of_polygons(&[region]));
    let changed = |x: f64, y: f64| {
        let p = mapping.pixel(&Point2::new(x, y));
        let (u, v) = (p.x.round() as u32, p.y.round() as u32);
        bare.get_pixel(u, v) != outlined.get_pixel(u, v)
    };
    assert!((0..=10).all(|i| changed(2.7 + 0.15 * f64::from(i), 0.3)), "its rim");
    // Not its middle, nor around the table and along the walls, where the geometry would have one.
    let is_far = |x: f64, y: f64| {
        (x - 3.5).abs() < 0.9 && (y - 1.0).abs() < 0.6 || (x - 3.5).abs() > 1.1 || (y - 1.0).abs() > 0.8
    };
    let places = (0..240).flat_map(|i| (0..160).map(move |j| (0.025 * f64::from(i), 0.025 * f64::from(j))));
    assert!(places.filter(|(x, y)| is_far(*x, *y)).all(|(x, y)| !changed(x, y)));
}

#[test]
fn trajectories_are_drawn_at_their_places() {
    let mut plan = FloorPlan::new(&room(), &PlanOptions { marks: false, ..PlanOptions::default() }).unwrap();
    let color = Color::of_id(1);
    plan.trajectory(&[Point2::new(0.5, 3.5), Point2::new(5.5, 3.5)], color, "");
    plan.trajectory(&[], color, "nobody");
    let p = plan.mapping().pixel(&Point2::new(3.2, 3.5));
    let image = plan.into_image();
    assert_eq!(image.get_pixel(p.x.round() as u32, p.y.round() as u32).0, [color.r, color.g, color.b]);
}

#[test]
fn steps_are_round_numbers() {
    for (least, step) in [(0.2, 1.0), (1.0, 1.0), (1.1, 2.0), (4.0, 5.0), (5.1, 10.0), (80.0, 100.0)] {
        assert_relative_eq!(nice_step(least), step);
    }
    assert_eq!(multiples(2.0, -3.0, 4.1).collect::<Vec<_>>(), [-2.0, 0.0, 2.0, 4.0]);
}

#[test]
fn a_kept_ground_is_the_same_until_the_room_changes() {
    let folder = tempfile::tempdir().unwrap();
    let anew = PlanOptions { longest_side_px: 300, ..PlanOptions::default() };
    let cached_options = PlanOptions { room_dir: Some(folder.path().to_owned()), ..anew.clone() };
    let draw = |room: &Room, options: &PlanOptions| FloorPlan::new(room, options).unwrap().into_image();
    let mut room = room();
    // The first pass renders the ground, the second reads it from the cache.
    for _ in 0..2 {
        assert!(draw(&room, &cached_options) == draw(&room, &anew));
    }
    let file = crate::cache::file_of(folder.path(), "plan");
    let first = std::fs::read(&file).unwrap();
    let Some(Geometry::Mesh(mesh)) = &mut room.geometry else { panic!("the room has a mesh") };
    mesh.colors.iter_mut().for_each(|color| *color = [90, 120, 150]);
    assert!(draw(&room, &cached_options) == draw(&room, &anew), "a change of colours alone is seen");
    assert!(std::fs::read(&file).unwrap() != first);
    let larger = PlanOptions { longest_side_px: 340, ..cached_options.clone() };
    assert!(draw(&room, &larger) == draw(&room, &PlanOptions { room_dir: None, ..larger.clone() }));
}

#[test]
fn without_geometry_a_plan_reaches_as_far_as_cameras_see_somebody() {
    let bare = Room { zones: Vec::new(), geometry: None, ..room() };
    let reach = |room: &Room| {
        let mapping = FloorPlan::new(room, &PlanOptions::default()).unwrap().mapping();
        (mapping.high - mapping.low).amax()
    };
    // The camera in its corner looks across the whole room, and sees its floor from two metres on.
    assert!((10.0..20.0).contains(&reach(&bare)), "{}", reach(&bare));
    let told = Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(3.0, 2.0));
    let told = Room { walkable: Some(vec![told]), ..bare };
    assert!(reach(&told) < 4.0, "{}", reach(&told));
}
