//! Rooms and cameras of the editor's tests: outlines against closed forms, the server over its socket, the page in a
//! browser.

mod editor_page;
mod outline;
mod page;
mod saving;
mod server;
mod space;

use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Matrix3, Point2, Point3, Translation3};

use crate::geometry::{Geometry, Mesh};
use crate::polygon::Polygon;
use crate::view::look_at;

/// Focal length and principal point of the cameras below.
const F: f64 = 100.0;
const C: f64 = 99.5;

fn intrinsics() -> Intrinsics {
    let pinhole = Intrinsics::from_horizontal_fov(200, 200, 90.0);
    Intrinsics { fx: F, fy: F, cx: C, cy: C, ..pinhole }
}

/// Camera above the origin that looks down, its image's axes along the world's.
fn looking_down(height_m: f64) -> Camera {
    let rotation = Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0);
    posed(intrinsics(), &rotation, Point3::new(0.0, 0.0, height_m))
}

/// Level camera above the origin that looks along the world's x: a floor place (x, y) is at u = C − F y / x, v = C + F
/// h / x.
fn looking_ahead(height_m: f64) -> Camera {
    let rotation = Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0);
    posed(intrinsics(), &rotation, Point3::new(0.0, 0.0, height_m))
}

fn posed(intrinsics: Intrinsics, rotation: &Matrix3<f64>, eye: Point3<f64>) -> Camera {
    let translation = Translation3::from(-(rotation * eye.coords));
    let rotation = calib::rotation::from_matrix(rotation).unwrap();
    Camera { intrinsics, camera_from_world: Isometry3::from_parts(translation, rotation) }
}

/// A distorting lens, looking down into a room.
fn bent() -> Camera {
    let mut camera = looking_ahead(1.0);
    camera.intrinsics.distortion = [-0.25, 0.08, 0.002, -0.001, -0.01].into();
    camera.camera_from_world = look_at(&Point3::new(0.5, -1.0, 2.6), &Point3::new(4.0, 1.0, 0.0));
    camera
}

fn polygon(corners: &[(f64, f64)]) -> Polygon {
    Polygon(corners.iter().map(|(x, y)| Point2::new(*x, *y)).collect())
}

/// A box on the floor.
pub(super) fn push_box(mesh: &mut Mesh, low: Vec3, high: Vec3) {
    let first = mesh.vertices.len() as u32;
    let corner = |i: u32| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
    mesh.vertices.extend((0..8).map(corner));
    mesh.colors.extend([[150; 3]; 8]);
    for q in [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]] {
        mesh.triangles.extend([[q[0], q[1], q[2]], [q[0], q[2], q[3]]].map(|t| t.map(|i: u32| first + i)));
    }
}

pub(super) fn scene(boxes: &[(Vec3, Vec3)]) -> Geometry {
    let mut mesh = Mesh::default();
    // The floor, a little uneven, as reconstructed ones are.
    push_box(&mut mesh, Vec3::new(-9.0, -9.0, -0.1), Vec3::new(9.0, 9.0, 0.04));
    for (low, high) in boxes {
        push_box(&mut mesh, *low, *high);
    }
    Geometry::Mesh(mesh)
}

fn length(lines: &[Vec<Point2<f64>>]) -> f64 {
    lines.iter().flat_map(|line| line.windows(2)).map(|pair| (pair[1] - pair[0]).norm()).sum()
}
