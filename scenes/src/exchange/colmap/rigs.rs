//! Rigs and frames of COLMAP 3.12 and later: cameras that are fixed to each other, and where they stood together. A picture's
//! pose is `sensor_from_rig · rig_from_world`; what `images` says of it is a copy.

use std::collections::HashMap;

use nalgebra::Isometry3;

use super::model::{Defect, ModelPose};

/// Cameras that are fixed to each other.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rig {
    pub(super) id: u32,
    pub(super) cameras: Vec<Sensor>,
}

/// A camera of a rig.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Sensor {
    pub(super) camera: u32,
    /// Camera from rig; `None` where it is not known.
    pub(super) pose: Option<ModelPose>,
}

/// A moment of a rig.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Frame {
    pub(super) id: u32,
    pub(super) rig: u32,
    /// Rig from world.
    pub(super) pose: ModelPose,
    pub(super) images: Vec<FrameImage>,
}

/// A picture of a frame, and the camera that took it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FrameImage {
    pub(super) camera: u32,
    pub(super) image: u64,
}

/// Poses (camera from world) of the frames' pictures, by the pictures' numbers; without those whose camera's place in its
/// rig is not known.
///
/// # Errors
/// The frame, and the problem with it.
pub(super) fn poses(rigs: &[Rig], frames: &[Frame]) -> Result<HashMap<u64, Isometry3<f64>>, Defect> {
    let by_id: HashMap<u32, &Rig> = rigs.iter().map(|rig| (rig.id, rig)).collect();
    let mut poses = HashMap::new();
    for frame in frames {
        let wrong = |problem: String| (format!("frame {}", frame.id), problem);
        let rig = by_id.get(&frame.rig).ok_or_else(|| wrong(format!("there is no rig {}", frame.rig)))?;
        let rig_from_world = frame.pose.isometry().map_err(wrong)?;
        for &FrameImage { camera, image } in &frame.images {
            let sensor = rig.cameras.iter().find(|sensor| sensor.camera == camera);
            let sensor = sensor.ok_or_else(|| wrong(format!("its rig {} has no camera {camera}", rig.id)))?;
            if let Some(pose) = &sensor.pose {
                let problem = |problem| wrong(format!("camera {camera} of its rig {}: {problem}", rig.id));
                poses.insert(image, pose.isometry().map_err(problem)? * rig_from_world);
            }
        }
    }
    Ok(poses)
}
