//! Depth against closed forms and against the office's independent renderer.

use std::path::Path;

use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3, Vector3};

use super::{DepthMap, png, render};
use crate::geometry::{Geometry, Mesh};
use crate::raycast::RayScene;
use crate::room::Room;

/// The inside of an axis-aligned box, as twelve triangles.
fn box_room(low: Vec3, high: Vec3) -> Geometry {
    let vertices: Vec<Vec3> =
        (0..8).map(|i| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low)).collect();
    let quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    Geometry::Mesh(Mesh { colors: vec![[0; 3]; vertices.len()], vertices, triangles })
}

#[test]
fn a_box_room_has_its_closed_form() {
    let (low, high) = (Point3::new(0.0, 0.0, 0.0), Point3::new(6.0, 5.0, 2.7));
    let to_vec3 = crate::geometry::vec3_from_point;
    let scene = RayScene::new(&box_room(to_vec3(&low), to_vec3(&high))).unwrap();
    let mut intrinsics = Intrinsics::from_horizontal_fov(160, 120, 85.0);
    intrinsics.distortion = [-0.18, 0.03, 0.001, -0.002, 0.0].into();
    let (eye, target) = (Point3::new(0.3, 0.4, 2.4), Point3::new(4.0, 3.0, 0.5));
    // nalgebra looks along +z with y up; a camera's y points down.
    let looking = Isometry3::face_towards(&eye, &target, &-Vector3::z()).inverse();
    for intrinsics in [intrinsics.pinhole(), intrinsics] {
        let camera = Camera { intrinsics, camera_from_world: looking };
        let map = render(&scene, &camera);
        assert!((map.coverage() - 1.0).abs() < 1e-12, "a closed room has no hole");
        for v in 0..120 {
            for u in 0..160 {
                let pixel = Point2::new(f64::from(u), f64::from(v));
                let direction = camera.ray(&pixel).unwrap();
                // A ray leaves a box through the nearest of the three planes ahead.
                let distance = (0..3)
                    .map(|i| (if direction[i] > 0.0 { high[i] } else { low[i] } - eye[i]) / direction[i])
                    .fold(f64::INFINITY, f64::min);
                let z = (camera.camera_from_world * (eye + direction.into_inner() * distance)).z;
                assert!((f64::from(map.at(u, v)) - z).abs() < 1e-4, "({u}, {v}): {} ≠ {z}", map.at(u, v));
            }
        }
    }
}

#[test]
fn the_office_agrees_with_its_own_renderer() {
    let dir = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/office/room"));
    let room = Room::read(dir).unwrap();
    let scene = RayScene::new(room.geometry.as_ref().unwrap()).unwrap();
    for camera in &room.cameras {
        let truth = png::read(&dir.join(format!("depth_{}.png", camera.name))).unwrap();
        let ours = render(&scene, &camera.camera);
        assert_eq!((truth.width, truth.height), (ours.width, ours.height));
        // Half a millimetre is the rounding of the reference.
        let close = std::iter::zip(&truth.z_m, &ours.z_m).filter(|(t, o)| (*t - *o).abs() <= 0.0015).count();
        let share = close as f64 / truth.z_m.len() as f64;
        println!("{}: {:.3} % of pixels within 1 mm of the truth", camera.name, 100.0 * share);
        assert!(share >= 0.99, "{}: {share}", camera.name);
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let scene = RayScene::new(&box_room(Vec3::ZERO, Vec3::ONE)).unwrap();
    let camera = Camera {
        intrinsics: Intrinsics::from_horizontal_fov(64, 48, 90.0),
        camera_from_world: Isometry3::translation(-0.5, -0.4, 3.0),
    };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&scene, &camera))
    };
    assert_eq!(with(1), with(3));
}

#[test]
fn png_keeps_millimetres_and_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("depth.png");
    let map = DepthMap { width: 3, height: 2, z_m: vec![0.0, 0.0001, 1.2344, 65.5, 70.0, 1e9] };
    png::write(&path, &map).unwrap();
    let back = png::read(&path).unwrap();
    assert_eq!((back.width, back.height), (3, 2));
    assert_eq!(back.z_m, [0.0, 0.001, 1.234, 65.5, 65.535, 65.535]);
    assert_eq!((back.at(2, 0), back.at(3, 0), back.at(0, 2)), (1.234, 0.0, 0.0));

    assert!(png::read(&folder.path().join("none.png")).unwrap_err().to_string().contains("none.png"));
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert!(png::read(&path).unwrap_err().to_string().contains("no PNG"));
    image::GrayImage::new(2, 2).save(&path).unwrap();
    assert!(png::read(&path).unwrap_err().to_string().contains("16-bit"));
    assert!(png::write(&path, &DepthMap { width: 9, ..map }).is_err());
}
