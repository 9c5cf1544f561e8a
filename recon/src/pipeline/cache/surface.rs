//! Serialised form of a capture's surface and motion.

use glam::Vec3;
use image::RgbImage;
use scenes::geometry::Disc;
use serde::{Deserialize, Serialize};

use crate::pipeline::camera::{CameraMotion, ProcessedCapture, sparse_points};
use crate::surface::{DepthOrigin, Surface};

/// A processed capture. The pictures' numbers stand one a pixel, row by row.
#[derive(Serialize, Deserialize)]
pub(super) struct CachedCapture {
    /// Lens, poses, sparse points and report.
    motion: CameraMotion,
    range: (f64, f64),
    pinhole: calib::Intrinsics,
    step: f32,
    /// Three bytes a pixel.
    picture: Vec<u8>,
    pub(super) depth: Vec<f32>,
    normal: Vec<[f32; 3]>,
    agreeing: Vec<u8>,
    origin: Vec<DepthOrigin>,
    key_frame_discs: Vec<CachedDisc>,
}

#[derive(Serialize, Deserialize)]
struct CachedDisc {
    center: [f32; 3],
    normal: [f32; 3],
    radius: f32,
    color: [u8; 3],
    filled: bool,
    confidence: f32,
}

impl CachedCapture {
    pub(super) fn of(processed: &ProcessedCapture) -> Self {
        let ProcessedCapture {
            lens,
            surface,
            key_frame_discs,
            camera_from_world,
            points,
            range,
            report,
            seconds,
        } = processed;
        Self {
            motion: CameraMotion {
                lens: lens.clone(),
                camera_from_world: camera_from_world.clone(),
                points: points.iter().map(|point| point.position).collect(),
                observations: points.iter().map(|point| point.observations.clone()).collect(),
                report: report.clone(),
                seconds: *seconds,
            },
            range: *range,
            pinhole: surface.intrinsics.clone(),
            step: surface.step,
            picture: surface.picture.as_raw().clone(),
            depth: surface.depth.clone(),
            normal: surface.normal.iter().map(Vec3::to_array).collect(),
            agreeing: surface.agreeing.clone(),
            origin: surface.origin.clone(),
            key_frame_discs: key_frame_discs.iter().map(CachedDisc::of).collect(),
        }
    }

    /// The capture; `None` when the pictures' sizes contradict each other.
    pub(super) fn restored(self) -> Option<ProcessedCapture> {
        let picture = RgbImage::from_raw(self.pinhole.width, self.pinhole.height, self.picture)?;
        let pixels = picture.pixels().len();
        let sizes = [self.depth.len(), self.normal.len(), self.agreeing.len(), self.origin.len()];
        if sizes != [pixels; 4] {
            return None;
        }
        let surface = Surface {
            picture,
            depth: self.depth,
            normal: self.normal.into_iter().map(Vec3::from_array).collect(),
            agreeing: self.agreeing,
            origin: self.origin,
            intrinsics: self.pinhole,
            step: self.step,
        };
        let CameraMotion { lens, camera_from_world, points, observations, report, seconds } = self.motion;
        let key_frame_discs = self.key_frame_discs.iter().map(CachedDisc::restored).collect();
        Some(ProcessedCapture {
            lens,
            surface,
            key_frame_discs,
            camera_from_world,
            points: sparse_points(points, observations),
            range: self.range,
            report,
            seconds,
        })
    }
}

impl CachedDisc {
    fn of(disc: &Disc) -> Self {
        let Disc { center, normal, radius, color, filled, confidence } = *disc;
        let [center, normal] = [center, normal].map(Vec3::into);
        Self { center, normal, radius, color, filled, confidence }
    }

    fn restored(&self) -> Disc {
        let Self { center, normal, radius, color, filled, confidence } = *self;
        let [center, normal] = [center, normal].map(Vec3::from_array);
        Disc { center, normal, radius, color, filled, confidence }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::motion::SparsePoint;
    use crate::pipeline::CameraReport;
    use crate::pipeline::report::CameraSeconds;
    use crate::surface::rendered::Rendering;
    use nalgebra::{Isometry3, Point2, Point3};
    use scenes::raycast::RayScene;
    use synthetic::RoomOptions;

    pub(in super::super) fn processed() -> ProcessedCapture {
        let room = RoomOptions { image_px: [64, 48], ..RoomOptions::default() }.build().unwrap();
        let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
        let rendering = Rendering { unit_m: 0.7, noise: 0.01, holes: 0.1, seed: 1 };
        let mut surface = rendering.of(&scene, &room.room.cameras[0].camera);
        surface.origin[7] = DepthOrigin::Filled;
        let mut lens = surface.intrinsics.clone();
        lens.distortion = [-0.1, 0.02, 1e-4, -3e-5, 0.1 + 0.2].into();
        let report =
            CameraReport { name: "cam0".into(), reprojection_rms_px: 0.1 + 0.2, ..CameraReport::default() };
        let camera_from_world = vec![Some(Isometry3::rotation([0.1, -0.7, 0.3].into())), None];
        let disc = Disc {
            center: Vec3::new(0.1, -0.7, 3.0),
            normal: -Vec3::Z,
            radius: 0.02,
            color: [7, 80, 255],
            filled: false,
            confidence: 3.5,
        };
        let key_frame_discs = vec![disc, Disc { center: Vec3::ONE, filled: true, ..disc }];
        ProcessedCapture {
            lens,
            surface,
            key_frame_discs,
            camera_from_world,
            points: vec![SparsePoint {
                position: Point3::new(0.1 + 0.2, -1.0 / 3.0, 7.0),
                observations: vec![(0, Point2::new(3.5, 0.1)), (1, Point2::new(1.0 / 3.0, 4.0))],
            }],
            range: (0.1 + 0.2, 7.0),
            report,
            seconds: CameraSeconds { motion: 0.1 + 0.2, dense: 7.0 },
        }
    }
}
