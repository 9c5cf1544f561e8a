//! Room for tests of files.

use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::Point3;

use crate::geometry::{Geometry, Mesh};
use crate::room::{Room, RoomCamera};
use crate::view::look_at;

/// A floor of 6 by 5 m, seen by `cameras` cameras that stand around it and look at its middle.
pub(crate) fn room(cameras: usize) -> Room {
    let camera = |i: usize| {
        let angle = 0.7 + 1.9 * i as f64;
        let eye = Point3::new(3.0 + 3.0 * angle.cos(), 2.5 + 2.5 * angle.sin(), 2.4 + 0.1 * i as f64);
        let intrinsics = Intrinsics::from_horizontal_fov(320, 240, 75.0);
        let camera_from_world = look_at(&eye, &Point3::new(3.0, 2.5, 0.5));
        RoomCamera {
            name: format!("cam{i}"),
            camera: Camera { intrinsics, camera_from_world },
            reference: None,
        }
    };
    let corner = |x: f32, y: f32| Vec3::new(x, y, 0.0);
    let mesh = Mesh {
        vertices: vec![corner(0.0, 0.0), corner(6.0, 0.0), corner(6.0, 5.0), corner(0.0, 5.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        colors: vec![[200, 180, 160]; 4],
    };
    Room {
        cameras: (0..cameras).map(camera).collect(),
        geometry: Some(Geometry::Mesh(mesh)),
        ..Room::default()
    }
}
