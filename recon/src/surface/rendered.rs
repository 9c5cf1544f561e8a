//! Surfaces as of good stereo, rendered from the cameras of a synthetic room: for the tests of the stages after stereo.

use calib::Camera;
use glam::Vec3;
use image::RgbImage;
use nalgebra::{Point2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use scenes::raycast::RayScene;
use synthetic::{CaptureOptions, SyntheticRoom};

use super::{DepthOrigin, Surface};

/// Simulated stereo.
pub(crate) struct Rendering {
    /// Metres in a unit of the surface's depth.
    pub(crate) unit_m: f64,
    /// Relative standard deviation of a depth.
    pub(crate) noise: f64,
    /// Share of the pixels that stay unknown.
    pub(crate) holes: f64,
    pub(crate) seed: u64,
}

impl Rendering {
    /// Surface seen by a camera without distortion.
    pub(crate) fn of(&self, scene: &RayScene, camera: &Camera) -> Surface {
        let mut rng = Pcg64Mcg::seed_from_u64(self.seed);
        let lens = camera.intrinsics.clone();
        let world_from_camera = camera.camera_from_world.rotation.inverse();
        let eye = single(&camera.center().coords);
        let count = (lens.width * lens.height) as usize;
        let mut surface = Surface {
            picture: RgbImage::new(lens.width, lens.height),
            depth: vec![0.0; count],
            normal: vec![Vec3::ZERO; count],
            agreeing: vec![0; count],
            origin: vec![DepthOrigin::Unknown; count],
            step: (0.004 * self.unit_m) as f32,
            intrinsics: lens.clone(),
        };
        for i in 0..count as u32 {
            let pixel = Point2::new(f64::from(i % lens.width), f64::from(i / lens.width));
            let deviation: f64 = StandardNormal.sample(&mut rng);
            let hole = rng.random_bool(self.holes);
            let Some(ray) = lens.unproject(&pixel).filter(|_| !hole) else { continue };
            let Some(hit) = scene.cast(eye, single(&(world_from_camera * ray))) else { continue };
            let n = hit.normal;
            let normal = camera.camera_from_world.rotation * Vector3::new(n.x.into(), n.y.into(), n.z.into());
            let depth = f64::from(hit.distance) * ray.z * (1.0 + self.noise * deviation) / self.unit_m;
            let i = i as usize;
            surface.depth[i] = depth as f32;
            surface.normal[i] = single(&normal);
            surface.agreeing[i] = 4;
            surface.origin[i] = DepthOrigin::Stereo;
        }
        surface
    }

    /// The same surface with the camera's picture and a sensor's noise.
    pub(crate) fn filmed(&self, room: &SyntheticRoom, camera: &Camera) -> Surface {
        // A synthetic room always has geometry, and a camera renders as many frames as asked for.
        let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
        let options = CaptureOptions { seed: self.seed, frames: 1, ..CaptureOptions::default() };
        let picture = room.capture(camera, &options).0.pop().unwrap();
        Surface { picture, ..self.of(&scene, camera) }
    }
}

fn single(v: &Vector3<f64>) -> Vec3 {
    Vec3::new(v.x as f32, v.y as f32, v.z as f32)
}
