//! Views of simple rooms against closed forms.

use super::*;
use crate::geometry::{Disc, Mesh};
use calib::Intrinsics;

/// A floor at z = 0 and a wall at y = 4, both 10 m wide, of one colour each.
fn floor_and_wall() -> Geometry {
    let quad = |corners: [[f32; 3]; 4]| corners.map(Vec3::from);
    let floor = quad([[-5.0, -2.0, 0.0], [5.0, -2.0, 0.0], [5.0, 4.0, 0.0], [-5.0, 4.0, 0.0]]);
    // Counter-clockwise seen from the room, so that the normal is −Y.
    let wall = quad([[-5.0, 4.0, 0.0], [5.0, 4.0, 0.0], [5.0, 4.0, 3.0], [-5.0, 4.0, 3.0]]);
    Geometry::Mesh(Mesh {
        vertices: floor.into_iter().chain(wall).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
        colors: [[200, 100, 50]; 4].into_iter().chain([[50, 100, 200]; 4]).collect(),
    })
}

fn camera(eye: [f64; 3], target: [f64; 3]) -> Camera {
    Camera {
        intrinsics: Intrinsics::from_horizontal_fov(160, 120, 70.0),
        camera_from_world: look_at(&Point3::from(eye), &Point3::from(target)),
    }
}

/// Options without shading, one ray a pixel.
fn plain() -> ViewOptions {
    ViewOptions { samples: 1, shading: 0.0, brighten: false, ..ViewOptions::default() }
}

#[test]
fn each_pixel_shows_the_surface_that_its_ray_meets() {
    let geometry = floor_and_wall();
    let scene = RayScene::new(&geometry).unwrap();
    let camera = camera([0.3, -1.0, 1.5], [0.0, 4.0, 0.8]);
    let image = View::new(&geometry, &scene, &camera, &plain()).image();
    let mut counts = [0; 3];
    for (x, y, p) in image.enumerate_pixels() {
        let ray = camera.ray(&Point2::new(f64::from(x), f64::from(y))).unwrap();
        let at_wall = camera.center() + ray.into_inner() * (5.0 / ray.y);
        if (at_wall.z - 3.0).abs() < 1e-3 || at_wall.z.abs() < 1e-3 {
            continue;
        }
        let (kind, expected) = match at_wall.z {
            z if z > 3.0 => (0, [Color::PAPER.r, Color::PAPER.g, Color::PAPER.b]),
            z if z > 0.0 => (1, [50, 100, 200]),
            _ => (2, [200, 100, 50]),
        };
        counts[kind] += 1;
        assert_eq!(p.0, expected, "at {x}, {y}");
    }
    assert!(counts.iter().all(|n| *n > 500), "{counts:?}");
}

#[test]
fn people_cover_what_the_closed_form_says_and_are_hidden_by_the_room() {
    let geometry = floor_and_wall();
    let scene = RayScene::new(&geometry).unwrap();
    let camera = camera([0.0, -1.0, 1.2], [0.0, 4.0, 1.2]);
    let view = View::new(&geometry, &scene, &camera, &plain());
    let red = Color::rgb(255, 0, 0);
    let person = Ellipsoid { x_m: 0.4, y_m: 2.0, radius_m: 0.3, height_m: 1.8, color: red };
    let (empty, image) = (view.image(), view.with_people(&[person]));
    let is_person = |p: &image::Rgb<u8>| p.0[0] > 60 && p.0[1] < 5;
    for (x, y, p) in image.enumerate_pixels() {
        // The ray is sampled finely to find whether it enters the ellipsoid.
        let ray = camera.ray(&Point2::new(f64::from(x), f64::from(y))).unwrap();
        let least = (0..4000)
            .map(|i| {
                let q = camera.center() + ray.into_inner() * (f64::from(i) * 0.001 + 1.0);
                ((q.x - 0.4).powi(2) + (q.y - 2.0).powi(2)) / 0.09 + (q.z - 0.9).powi(2) / 0.81
            })
            .fold(f64::MAX, f64::min);
        if (least - 1.0).abs() > 0.01 {
            assert_eq!(is_person(p), least < 1.0, "at {x}, {y}");
        }
    }
    let behind = view.with_people(&[Ellipsoid { y_m: 4.5, ..person }]);
    assert!(!behind.pixels().any(is_person));
    assert_eq!(behind, empty);
    for nowhere in [
        Ellipsoid { x_m: f32::NAN, ..person },
        Ellipsoid { radius_m: 0.0, ..person },
        Ellipsoid { x_m: 500.0, ..person },
        Ellipsoid { y_m: -50.0, ..person },
    ] {
        assert_eq!(view.with_people(&[nowhere]), empty);
    }
}

#[test]
fn from_outside_one_looks_through_the_wall_and_the_cut() {
    let geometry = floor_and_wall();
    let scene = RayScene::new(&geometry).unwrap();
    // From behind the wall: only the floor is left, and the wall where it is not cut away.
    let camera = camera([0.0, 7.0, 3.0], [0.0, 2.0, 0.0]);
    let shown = |options: &ViewOptions| {
        let image = View::new(&geometry, &scene, &camera, options).image();
        let count = |c: [u8; 3]| image.pixels().filter(|p| p.0 == c).count();
        (count([200, 100, 50]), count([50, 100, 200]))
    };
    let (floor, wall) = shown(&plain());
    let (floor_cut, wall_cut) = shown(&ViewOptions { cut_backs: true, ..plain() });
    let (_, half_wall) = shown(&ViewOptions { cut_height_m: Some(1.0), ..plain() });
    assert!(wall > 1000 && wall_cut == 0 && floor_cut > floor + 1000);
    assert!(half_wall > 0 && half_wall < wall);
}

#[test]
fn overlapping_discs_mix_and_a_lone_disc_keeps_its_colour() {
    let disc = |x: f32, color: [u8; 3]| Disc {
        center: Vec3::new(x, 0.0, 2.0),
        normal: Vec3::NEG_Z,
        radius: 0.5,
        color,
        filled: false,
        confidence: 1.0,
    };
    let camera = Camera {
        intrinsics: Intrinsics::from_horizontal_fov(161, 121, 60.0),
        camera_from_world: nalgebra::Isometry3::identity(),
    };
    let render = |discs: Vec<Disc>| {
        let geometry = Geometry::Discs(discs);
        let scene = RayScene::new(&geometry).unwrap();
        View::new(&geometry, &scene, &camera, &plain()).image()
    };
    let lone = render(vec![disc(0.0, [10, 200, 30])]);
    assert_eq!(lone.get_pixel(80, 60).0, [10, 200, 30]);
    // Midway between two equal discs, a millimetre apart in depth, both weigh the same.
    let (left, mut right) = (disc(-0.25, [200, 0, 0]), disc(0.25, [0, 0, 200]));
    right.center.z += 0.001;
    let [r, _, b] = render(vec![left, right]).get_pixel(80, 60).0;
    assert!((i32::from(r) - 100).abs() <= 2 && (i32::from(b) - 100).abs() <= 2, "{r} {b}");
    assert_eq!(render(vec![]).get_pixel(80, 60).0, [Color::PAPER.r, Color::PAPER.g, Color::PAPER.b]);
}

#[test]
fn dark_geometry_is_brightened_and_bright_geometry_left_alone() {
    let room = |level: u8| {
        let Geometry::Mesh(mut mesh) = floor_and_wall() else { unreachable!() };
        mesh.colors.fill([level, level / 2, 0]);
        exposure(&Geometry::Mesh(mesh))
    };
    assert!((room(100) - 2.05).abs() < 1e-5);
    assert!((room(230) - 1.0).abs() < 1e-5 && (room(0) - 4.0).abs() < 1e-5);
    assert!((exposure(&Geometry::Discs(vec![])) - 1.0).abs() < 1e-5);
}
