//! A room that is a box, and error-free surfaces of it.

use calib::Intrinsics;
use glam::Vec3;
use image::RgbImage;
use nalgebra::{Isometry3, Point2, Point3, Vector3};

use crate::surface::{DepthOrigin, Surface};

/// An empty room, seen from inside, by its least and greatest corners.
pub(super) struct BoxRoom(pub(super) [Point3<f64>; 2]);

impl BoxRoom {
    /// Distance along a ray from inside the room to the wall, and its normal there.
    pub(super) fn hit(&self, eye: &Point3<f64>, ray: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let [low, high] = &self.0;
        let leaves = |axis: usize| {
            let [a, b] = [low, high].map(|corner| (corner[axis] - eye[axis]) / ray[axis]);
            (a.max(b), axis)
        };
        let (t, axis) = (0..3).map(leaves).fold((f64::INFINITY, 0), |a, b| if b.0 < a.0 { b } else { a });
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
