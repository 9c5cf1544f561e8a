//! A camera that turns during a run: set aside at once, and followed on where its present pose is certain.
//!
//! The pose is found as `recon relocate` finds it: keypoints of the picture before the turn, lifted by the room's depth.
//! A camera that has turned about itself sees from the same place as before, so whatever it sees is put where it saw it
//! before the turn, and everything that was prepared for the camera (depth, silhouettes, packets) stays valid. A camera
//! that was carried elsewhere stays set aside. The room is never changed: the pose is written beside the run.

use std::path::PathBuf;

use calib::Camera;
use calib::relocation::{self, Landmarks, Relocation, SceneDepth};
use image::{GrayImage, RgbImage};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use scenes::depth::DepthMap;

use crate::Result;
use crate::doctor::pose_watch::{PoseFinding, PoseWatch};
use crate::foreground::backdrop::Backdrop;
use crate::prepared_room::PreparedCamera;

/// Distance up to which a camera still sees from the same place, metres.
const SAME_PLACE_M: f64 = 0.05;

/// Follower of one camera's pose.
pub struct PoseFollower {
    watch: PoseWatch,
    camera: PreparedCamera,
    /// Depth of the room from the prepared pose; 0 where nothing is hit.
    depth: DepthMap,
    /// Turn since the prepared pose, of rays into the camera as it stands now.
    turn: UnitQuaternion<f64>,
    /// Empty scene after a turn, where the recording shows it.
    scene: Option<Backdrop>,
    /// File to write a new pose to.
    record: Option<PathBuf>,
    /// Whether the failed search for the present pose has been told.
    has_told: bool,
}

/// Pose of a camera at one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CameraPose {
    /// As at the picture before.
    AsBefore,
    /// Unknown, or another one that cannot be followed.
    SetAside,
    /// From this picture on: the turn of rays of the prepared camera into the present one.
    Turned(UnitQuaternion<f64>),
}

impl PoseFollower {
    /// Follower of a camera that stands at its prepared pose. A new pose is written to the file `record`, as `scene.toml`
    /// has poses; one of an earlier run is removed with the first picture.
    pub fn new(camera: &PreparedCamera, record: Option<PathBuf>) -> Self {
        let z_m = camera.static_z_m.iter().map(|z| if z.is_finite() { *z } else { 0.0 }).collect();
        Self {
            watch: PoseWatch::new(camera.real.intrinsics.clone()),
            depth: DepthMap { width: camera.width(), height: camera.height(), z_m },
            camera: camera.clone(),
            turn: UnitQuaternion::identity(),
            scene: None,
            record,
            has_told: false,
        }
    }

    /// The same follower of a camera whose empty scene after its turn is known.
    #[must_use]
    pub fn with_scene(self, scene: Option<Backdrop>) -> Self {
        Self { scene, ..self }
    }

    /// Empty scene of a camera that has turned; once, since it may turn again.
    pub(super) fn take_scene(&mut self) -> Option<Backdrop> {
        self.scene.take()
    }

    /// Takes a picture into account.
    ///
    /// # Errors
    /// An error of OpenCV, or a pose that cannot be written.
    pub(super) fn look(&mut self, picture: &RgbImage, time_s: f64) -> Result<CameraPose> {
        let had_picture = self.watch.first_picture().is_some();
        let before = self.watch.looked_s();
        let finding = self.watch.look(picture, time_s)?;
        if !had_picture && self.turn == UnitQuaternion::identity() {
            self.remove_old_record();
        }
        match finding {
            PoseFinding::Unmoved => return Ok(CameraPose::AsBefore),
            PoseFinding::Doubtful | PoseFinding::Moved => return Ok(CameraPose::SetAside),
            PoseFinding::AtRest if self.watch.looked_s() == before => return Ok(CameraPose::SetAside),
            PoseFinding::AtRest => {}
        }
        let name = &self.camera.name;
        let problem = match self.present_pose(&image::imageops::grayscale(picture))? {
            Ok(found) => {
                self.write(&found)?;
                let before = &self.camera.real;
                let now = Camera { camera_from_world: found.camera_from_world, ..before.clone() };
                let shift_m = (now.center() - before.center()).norm();
                let turn = found.camera_from_world.rotation * before.camera_from_world.rotation.inverse();
                if shift_m <= SAME_PLACE_M {
                    tracing::warn!(
                        "camera `{name}`: has turned by {:.2}° (± {:.2}°), and is followed on from {time_s:.1} s; `recon relocate` \
                         writes its pose into the room",
                        turn.angle().to_degrees(),
                        found.sigma_deg
                    );
                    self.turn = turn;
                    self.watch.restart();
                    return Ok(CameraPose::Turned(turn));
                }
                format!("it was moved by {:.0} cm, and sees from another place", 100.0 * shift_m)
            }
            Err(doubt) => doubt.to_string(),
        };
        if !std::mem::replace(&mut self.has_told, true) {
            tracing::warn!(
                "camera `{name}`: has turned and stays set aside: {problem}; `recon relocate` mends the room"
            );
        }
        Ok(CameraPose::SetAside)
    }

    /// Pose at which the camera takes this picture.
    fn present_pose(
        &self,
        picture: &GrayImage,
    ) -> Result<std::result::Result<Relocation, relocation::Doubt>> {
        let real = &self.camera.real;
        let Some(before) = self.watch.first_picture() else {
            return Ok(Err(relocation::Doubt::Unrecognised { agreeing: 0, matches: 0 }));
        };
        let mut camera_from_world = real.camera_from_world;
        camera_from_world.append_rotation_mut(&self.turn);
        let stood = Camera { camera_from_world, ..real.clone() };
        let landmarks = Landmarks::of(before, &stood, |ray| self.depth_along(ray))?;
        Ok(relocation::relocate(picture, &real.intrinsics, &[landmarks])?)
    }

    /// Depth of the room along a ray of the camera as it stood at the first picture, along its z.
    fn depth_along(&self, ray: &Vector3<f64>) -> Option<SceneDepth> {
        let prepared = self.turn.inverse() * ray;
        let pixel = self.camera.pinhole.intrinsics.project(&Point3::from(prepared))?;
        let surface = self.depth.surface_at(&pixel)?;
        // `ray` has a z of 1, so that its length counts in depths along the camera's z.
        let scale = 1.0 / prepared.z;
        Some(SceneDepth { z_m: surface.z_m * scale, sigma_m: surface.sigma_m * scale })
    }

    fn write(&self, found: &Relocation) -> Result<()> {
        let Some(file) = &self.record else { return Ok(()) };
        let camera = Camera { camera_from_world: found.camera_from_world, ..self.camera.filmed.clone() };
        let text = calib::files::pose_text(&camera, found.rms_px, false)?;
        Ok(calib::files::write_atomic(file, text.as_bytes())?)
    }

    fn remove_old_record(&self) {
        if let Some(file) = &self.record {
            // Most runs have none.
            let _ = std::fs::remove_file(file);
        }
    }
}
