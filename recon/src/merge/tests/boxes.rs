//! A room of boxes, and error-free surfaces of it.

use calib::Intrinsics;
use glam::Vec3;
use image::RgbImage;
use nalgebra::{Isometry3, Point2, Point3, Vector3};

use crate::surface::{DepthOrigin, Surface};

/// Boxes by their least and greatest corners.
pub(super) struct Boxes {
    /// Seen from inside.
    pub(super) room: [Point3<f64>; 2],
    /// Seen from outside.
    pub(super) furniture: Vec<[Point3<f64>; 2]>,
}

impl Boxes {
    /// Distance along a ray from inside the room to the first surface, and its normal there.
    pub(super) fn hit(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let (_, wall) = crossing(&self.room, eye, ray);
        let in_front = |cuboid| {
            let (enters, leaves) = crossing(cuboid, eye, ray);
            (0.0 < enters.0 && enters.0 < leaves.0).then_some(enters)
        };
        let (t, axis) =
            self.furniture.iter().filter_map(in_front).fold(wall, |a, b| if b.0 < a.0 { b } else { a });
        (t, -Vector3::ith(axis, ray[axis].signum()))
    }

    /// Surface seen by a camera whose unit is `unit` metres.
    pub(super) fn seen(&self, lens: &Intrinsics, pose: &Isometry3<f64>, unit: f64) -> Surface {
        let eye = pose.inverse() * Point3::origin();
        let (mut depth, mut normal) = (Vec::new(), Vec::new());
        for v in 0..lens.height {
            for u in 0..lens.width {
                let ray = lens.unproject(&Point2::new(u as f64, v as f64)).unwrap();
                let (t, n) = self.hit(&eye, &(pose.rotation.inverse() * ray));
                let n = pose.rotation * n;
                depth.push((t / unit) as f32);
                normal.push(Vec3::new(n.x as f32, n.y as f32, n.z as f32));
            }
        }
        let count = depth.len();
        Surface {
            picture: RgbImage::new(lens.width, lens.height),
            intrinsics: lens.clone(),
            depth,
            normal,
            agreeing: vec![4; count],
            origin: vec![DepthOrigin::Stereo; count],
            step: 0.005,
        }
    }
}

/// Entry and exit of a ray's line through a box: distance, and axis of the face.
fn crossing(
    [low, high]: &[Point3<f64>; 2],
    eye: &Point3<f64>,
    ray: &Vector3<f64>,
) -> ((f64, usize), (f64, usize)) {
    let (mut enters, mut leaves) = ((f64::NEG_INFINITY, 0), (f64::INFINITY, 0));
    for axis in 0..3 {
        let [a, b] = [low, high].map(|corner| (corner[axis] - eye[axis]) / ray[axis]);
        if a.min(b) > enters.0 {
            enters = (a.min(b), axis);
        }
        if a.max(b) < leaves.0 {
            leaves = (a.max(b), axis);
        }
    }
    (enters, leaves)
}
