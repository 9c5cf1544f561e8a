//! The capture: a camera is moved by hand around the place of its installation, and ends there.

use calib::Camera;
use image::RgbImage;
use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::render::{RenderOptions, StaticView, finish};
use super::room::SyntheticRoom;

/// Options of a capture's motion and rendering.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureOptions {
    /// Seed of the hand's motion.
    pub seed: u64,
    /// Number of frames; the last is at the installed pose.
    pub frames: usize,
    /// Largest displacement of the camera to either side.
    pub reach_m: f64,
    /// Rendering and noise.
    pub render: RenderOptions,
}

impl Default for CaptureOptions {
    fn default() -> Self {
        Self { seed: 1, frames: 40, reach_m: 0.35, render: RenderOptions::default() }
    }
}

impl SyntheticRoom {
    /// Moves a camera by hand and ends at its installed pose: the images, and each one's `camera_from_world`.
    pub fn capture(&self, camera: &Camera, options: &CaptureOptions) -> (Vec<RgbImage>, Vec<Isometry3<f64>>) {
        let poses = self.hand_held(camera, options);
        let images = poses
            .iter()
            .enumerate()
            .map(|(i, pose)| {
                let moved = Camera { camera_from_world: *pose, ..camera.clone() };
                let still = StaticView::new(self, &moved, options.render.samples);
                finish(&still.colors(), &still, options.seed ^ 0xca97, i as u64, &options.render)
            })
            .collect();
        (images, poses)
    }

    /// The poses of a capture: an arc around the installed pose that comes to rest there, with a hand's sway.
    pub fn hand_held(&self, camera: &Camera, options: &CaptureOptions) -> Vec<Isometry3<f64>> {
        /// Least distance to walls and ceiling.
        const MARGIN_M: f64 = 0.12;
        let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
        let mut wave = || {
            let (phase, turns): (f64, f64) =
                (rng.random_range(0.0..std::f64::consts::TAU), rng.random_range(0.8..1.6));
            move |t: f64| (phase + std::f64::consts::TAU * turns * t).sin()
        };
        let sway: [_; 6] = std::array::from_fn(|_| wave());
        let circle = wave();
        let world_from_camera = camera.camera_from_world.inverse();
        let eye = camera.center();
        let last = options.frames.saturating_sub(1);
        (0..options.frames)
            .map(|i| {
                // Runs from 1 to 0; the last fifth brings the camera to rest.
                let left = (last - i) as f64 / last.max(1) as f64;
                if i == last {
                    return camera.camera_from_world;
                }
                let ease = (left / 0.2).min(1.0);
                let ease = ease * ease * (3.0 - 2.0 * ease);
                let reach = options.reach_m * ease;
                // Sideways and up in the camera's own frame, and forward into the room, away from the walls.
                let local = Vector3::new(
                    reach * (circle(left) + 0.15 * sway[0](3.0 * left)),
                    0.5 * reach * (sway[1](left) + 0.2 * sway[2](4.0 * left)),
                    reach * (0.6 + 0.5 * sway[3](left)),
                );
                let mut place = eye + world_from_camera.rotation * local;
                for axis in 0..3 {
                    let high = self.size_m[axis] - MARGIN_M;
                    // The installed pose itself is never moved.
                    let (low, high) = (MARGIN_M.min(eye[axis]), high.max(eye[axis]));
                    place[axis] = place[axis].clamp(low, high);
                }
                let turn = UnitQuaternion::from_euler_angles(
                    0.05 * ease * sway[4](2.0 * left),
                    0.06 * ease * sway[5](2.0 * left) - 0.35 * local.x / 3.0,
                    0.04 * ease * sway[0](2.0 * left),
                );
                pose_at(place, world_from_camera.rotation * turn)
            })
            .collect()
    }
}

/// `camera_from_world` of a camera at a place with an attitude `world_from_camera`.
fn pose_at(place: Point3<f64>, attitude: UnitQuaternion<f64>) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(place), attitude).inverse()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RoomOptions;

    #[test]
    fn a_capture_moves_enough_stays_in_the_room_and_ends_at_the_installed_pose() {
        let room = RoomOptions::default().build().unwrap();
        for (seed, camera) in (1..).zip(&room.room.cameras) {
            let camera = &camera.camera;
            let options = CaptureOptions { seed, frames: 50, ..CaptureOptions::default() };
            let poses = room.hand_held(camera, &options);
            assert_eq!(poses.len(), 50);
            assert_eq!(poses[49], camera.camera_from_world);
            let places: Vec<Point3<f64>> =
                poses.iter().map(|pose| pose.inverse().translation.vector.into()).collect();
            let widest = places.iter().map(|p| (p - camera.center()).norm()).fold(0.0, f64::max);
            assert!(widest > 0.25 && widest < 0.9, "{widest}");
            assert!(places.windows(2).all(|w| (w[1] - w[0]).norm() < 0.12));
            assert!(places.iter().all(|p| (0..3).all(|a| p[a] > 0.1 && p[a] < room.size_m[a] - 0.1)));
        }
        let camera = &room.room.cameras[0].camera;
        assert!(
            room.hand_held(camera, &CaptureOptions { frames: 0, ..CaptureOptions::default() }).is_empty()
        );
        let one = room.hand_held(camera, &CaptureOptions { frames: 1, ..CaptureOptions::default() });
        assert_eq!(one[0], camera.camera_from_world);
    }
}
