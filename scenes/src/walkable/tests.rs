//! Walkable maps against hand-made rooms and against the office, true and as noisily reconstructed.

use std::path::PathBuf;

use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::WalkableMap;
use crate::depth::render;
use crate::geometry::{Disc, Geometry};
use crate::polygon::Polygon;
use crate::raycast::RayScene;
use crate::room::{Room, RoomCamera, Zone, ZoneKind};

fn camera(eye: Point3<f64>, target: Point3<f64>) -> RoomCamera {
    let camera_from_world = Isometry3::face_towards(&eye, &target, &-Vector3::z()).inverse();
    let intrinsics = Intrinsics::from_horizontal_fov(320, 240, 80.0);
    RoomCamera { name: "c".into(), camera: Camera { intrinsics, camera_from_world }, reference: None }
}

/// Discs on a rectangle from `corner` along two edges.
fn sheet(corner: Vec3, along: Vec3, across: Vec3) -> Vec<Disc> {
    const SPACING: f32 = 0.04;
    let normal = along.cross(across).normalize();
    let (n, m) = ((along.length() / SPACING).ceil() as u32, (across.length() / SPACING).ceil() as u32);
    let place = |i: u32, j: u32| {
        corner + along * ((i as f32 + 0.5) / n as f32) + across * ((j as f32 + 0.5) / m as f32)
    };
    let disc = |i, j| Disc {
        center: place(i, j),
        normal,
        radius: 0.75 * SPACING,
        color: [9; 3],
        filled: false,
        confidence: 1.0,
    };
    (0..n).flat_map(|i| (0..m).map(move |j| (i, j))).map(|(i, j)| disc(i, j)).collect()
}

/// A floor of 4 × 3 m with walls, a table, a sofa, a pillar and a thin pole.
pub(super) fn furnished() -> Room {
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    let mut discs = sheet(Vec3::ZERO, 4.0 * x, 3.0 * y);
    // The normals of the walls point into the room.
    for (corner, along) in
        [(4.0 * x, -4.0 * x), (3.0 * y, 4.0 * x), (Vec3::ZERO, 3.0 * y), (4.0 * x + 3.0 * y, -3.0 * y)]
    {
        discs.extend(sheet(corner, along, 2.5 * z));
    }
    discs.extend(sheet(Vec3::new(2.0, 1.0, 0.74), 1.2 * x, 0.8 * y)); // table top
    discs.extend(sheet(Vec3::new(0.5, 2.2, 0.42), 1.0 * x, 0.7 * y)); // sofa seat, and its front
    discs.extend(sheet(Vec3::new(0.5, 2.2, 0.0), 1.0 * x, 0.42 * z));
    for (corner, along) in [(0.8, 0.8), (1.1, 0.8)].map(|(a, b)| (Vec3::new(a, b, 0.0), 0.3 * y)) {
        discs.extend(sheet(corner, along, 2.5 * z)); // two sides of the pillar
    }
    for corner in [Vec3::new(0.8, 0.8, 0.0), Vec3::new(0.8, 1.1, 0.0)] {
        discs.extend(sheet(corner, 0.3 * x, 2.5 * z)); // and the other two
    }
    discs.extend(sheet(Vec3::new(3.5, 2.5, 0.0), 0.04 * x, 1.5 * z)); // pole
    discs.extend(sheet(Vec3::new(1.0, 1.5, 2.0), 0.8 * x, 0.5 * y)); // lamp, overhead
    Room {
        cameras: vec![camera(Point3::new(0.2, 0.2, 2.3), Point3::new(2.5, 2.0, 0.8))],
        geometry: Some(Geometry::Discs(discs)),
        ..Room::default()
    }
}

#[test]
fn people_stand_on_the_floor_and_not_in_furniture() {
    let map = WalkableMap::of_room(&furnished()).unwrap();
    for (what, x, y, expected) in [
        ("open floor", 1.7, 0.5, true),
        ("under the lamp", 1.4, 1.75, true),
        ("middle of the table", 2.6, 1.4, false),
        ("rim of the table", 2.04, 1.4, true),
        ("beside the table", 1.9, 1.4, true),
        ("sofa", 1.0, 2.5, false),
        ("rim of the sofa", 1.0, 2.24, false),
        ("inside the pillar", 0.95, 0.95, false),
        ("behind the pillar", 1.3, 1.3, true),
        ("pole", 3.52, 2.5, false),
        ("beside the pole", 3.7, 2.5, true),
        ("outside the walls", 4.4, 1.5, false),
        ("far away", 1e9, 1.5, false),
    ] {
        assert_eq!(map.contains(x, y), expected, "{what}");
    }
    assert!(!map.contains(f64::NAN, 1.0));
    let area = map.area_m2().unwrap();
    // 12 m² less table (without its rim), sofa, pillar, and the walls' cells.
    assert!((9.0..11.5).contains(&area), "{area}");
}

#[test]
fn behind_a_wall_with_a_hole_is_no_floor() {
    /// Places near the hole, outside.
    const BEHIND: [(f64, f64); 4] = [(4.3, 1.1), (4.2, 1.9), (4.3, 1.8), (4.25, 1.2)];
    let mut room = furnished();
    let Some(Geometry::Discs(discs)) = &mut room.geometry else { panic!("discs") };
    // The wall at x = 4 m has a hole that reaches to the floor, and a corner of a hallway is seen far behind it.
    discs.retain(|d| d.center.x < 3.99 || !(1.25..1.75).contains(&d.center.y) || d.center.z > 2.0);
    discs.extend(sheet(Vec3::new(6.5, 0.0, 0.0), -1.5 * Vec3::X, 1.2 * Vec3::Y));
    let map = WalkableMap::of_room(&room).unwrap();
    assert!(map.contains(5.75, 0.5), "floor that was seen");
    for (x, y) in BEHIND {
        assert!(!map.contains(x, y), "{x}, {y} is behind the wall");
    }
    // With the walls' normals the other way, the same place would have been seen from there.
    let Some(Geometry::Discs(discs)) = &mut room.geometry else { panic!("discs") };
    for wall in discs.iter_mut().filter(|d| d.center.z > 1.0) {
        wall.normal = -wall.normal;
    }
    let map = WalkableMap::of_room(&room).unwrap();
    for (x, y) in BEHIND {
        assert!(map.contains(x, y), "{x}, {y} would have been seen");
    }
}

#[test]
fn strays_and_zones_and_seen_floor_beyond_count_as_they_should() {
    let mut room = furnished();
    let Some(Geometry::Discs(discs)) = &mut room.geometry else { panic!("discs") };
    let stray = |x: f32, y: f32, z: f32, normal: Vec3| Disc {
        center: Vec3::new(x, y, z),
        normal,
        radius: 0.03,
        color: [0; 3],
        filled: false,
        confidence: 1.0,
    };
    discs.extend((0..4).map(|i| stray(1.7 + 0.03 * i as f32, 0.5, 1.1, Vec3::X)));
    discs.push(stray(60.0, -80.0, 0.0, Vec3::Z));
    // A door in the wall, marked as a zone.
    let door = Polygon::rectangle(Point2::new(3.7, 0.2), Point2::new(4.6, 1.0));
    room.zones.push(Zone { name: "door".into(), polygon: door, kind: ZoneKind::Both });
    let map = WalkableMap::of_room(&room).unwrap();
    assert!(map.contains(1.72, 0.5), "a few strays block the way");
    assert!(map.contains(4.0, 0.6) && map.contains(4.5, 0.6), "the zone is walkable, wall or not");
    assert!(map.grid().unwrap().columns < 200, "a stray far away enlarges the map");
}

#[test]
fn polygons_come_first_and_nothing_means_everywhere() {
    let mut room = furnished();
    room.walkable = Some(vec![
        Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(1.0, 1.0)),
        Polygon::rectangle(Point2::new(3.0, 0.0), Point2::new(4.0, 2.0)),
    ]);
    let map = WalkableMap::of_room(&room).unwrap();
    assert!(map.contains(0.95, 0.95) && map.contains(3.5, 1.9) && !map.contains(2.0, 0.5));
    assert!((map.area_m2().unwrap() - 3.0).abs() < 1e-9);

    let bare = Room { walkable: None, geometry: None, ..room.clone() };
    let map = WalkableMap::of_room(&bare).unwrap();
    assert!(map.contains(1e6, -1e6) && !map.contains(f64::NAN, 0.0) && map.area_m2().is_none());

    // Only a lamp: nothing is known of the floor.
    let lamp = Geometry::Discs(sheet(Vec3::new(0.0, 0.0, 2.2), Vec3::X, Vec3::Y));
    let map = WalkableMap::of_room(&Room { geometry: Some(lamp), ..bare.clone() }).unwrap();
    assert!(map.contains(5.0, 5.0));
    // Only a wall: not nothing, but no floor either.
    let wall = Geometry::Discs(sheet(Vec3::ZERO, Vec3::X, Vec3::Z));
    assert!(WalkableMap::of_room(&Room { geometry: Some(wall), ..bare }).is_ok());
}

fn office() -> (PathBuf, Room) {
    let dir = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/office"));
    let room = Room::read(&dir.join("room")).unwrap();
    (dir, room)
}

/// Positions of the people, from `truth.txt`.
fn places(dir: &std::path::Path) -> Vec<(f64, f64)> {
    let text = std::fs::read_to_string(dir.join("truth.txt")).unwrap();
    let place = |line: &str| {
        let fields: Vec<f64> = line.split(',').map(|f| f.parse().unwrap()).collect();
        (fields[7], fields[8])
    };
    text.lines().map(place).collect()
}

/// Middles of the furniture in which no person can stand, from `truth.json`.
const FURNITURE: [(&str, f64, f64); 6] = [
    ("table", 3.4, 2.4),
    ("pillar", 2.35, 3.0),
    ("sofa", 2.3, 0.5),
    ("cabinet", 5.68, 3.1),
    ("desk", 0.42, 2.0),
    ("shelf", 3.7, 4.8),
];

#[test]
fn in_the_office_people_stood_where_the_map_lets_them() {
    let (dir, room) = office();
    let map = WalkableMap::of_room(&room).unwrap();
    let places = places(&dir);
    let inside = places.iter().filter(|(x, y)| map.contains(*x, *y)).count();
    println!("{inside} of {} places, {:.1} m² walkable", places.len(), map.area_m2().unwrap());
    assert_eq!(inside, places.len());
    for (what, x, y) in FURNITURE {
        assert!(!map.contains(x, y), "{what}");
    }
}

/// The office as stereo would reconstruct it: one disc a few pixels from each camera, with noise of a hundredth of the
/// distance, every fifth one missing, and every twentieth hanging somewhere in the air before the surface.
fn as_reconstructed(room: &Room, rng: &mut Pcg64Mcg) -> Geometry {
    const STEP_PX: u32 = 3;
    let scene = RayScene::new(room.geometry.as_ref().unwrap()).unwrap();
    let mut discs = Vec::new();
    for RoomCamera { camera, .. } in &room.cameras {
        let map = render(&scene, camera);
        let origin = crate::geometry::vec3_from_point(&camera.center());
        for v in (0..map.height).step_by(STEP_PX as usize) {
            for u in (0..map.width).step_by(STEP_PX as usize) {
                let pixel = Point2::new(f64::from(u), f64::from(v));
                let direction = crate::geometry::vec3_from_vector(&camera.ray(&pixel).unwrap().into_inner());
                let Some(hit) = scene.cast(origin, direction) else { continue };
                let luck: f32 = rng.random();
                let gauss: f32 = StandardNormal.sample(rng);
                let distance = match luck {
                    ..0.2 => continue,
                    0.2..0.25 => hit.distance * rng.random_range(0.3..1.0),
                    _ => hit.distance * (1.0 + 0.01 * gauss),
                };
                let wobble = Vec3::from_array(std::array::from_fn(|_| rng.random_range(-0.2..0.2)));
                discs.push(Disc {
                    center: origin + direction * distance,
                    normal: (hit.normal + wobble).normalize(),
                    radius: 0.75 * STEP_PX as f32 * distance / camera.intrinsics.fx as f32,
                    color: [0; 3],
                    filled: false,
                    confidence: 1.0,
                });
            }
        }
    }
    Geometry::Discs(discs)
}

#[test]
fn in_a_noisy_office_people_stand_nearly_everywhere_they_did() {
    let (dir, room) = office();
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let noisy = Room { geometry: Some(as_reconstructed(&room, &mut rng)), ..room };
    let map = WalkableMap::of_room(&noisy).unwrap();
    let places = places(&dir);
    let share = places.iter().filter(|(x, y)| map.contains(*x, *y)).count() as f64 / places.len() as f64;
    println!("{:.2} % of the places, {:.1} m² walkable", 100.0 * share, map.area_m2().unwrap());
    assert!(share > 0.995, "{share}");
    // The desk is out of sight of both cameras, and of the shelf they see the front only.
    for (what, x, y) in &FURNITURE[..4] {
        assert!(!map.contains(*x, *y), "{what}");
    }
}
