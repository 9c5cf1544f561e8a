//! `scenes depth`: a camera's depth map of the empty room, as a picture.

use std::path::PathBuf;

use clap::Args;
use shell::files::Outputs;

use crate::depth::{DepthMap, png, render};
use crate::raycast::RayScene;
use crate::room::{self, Room};

/// Write the depth of a camera's image as 16-bit PNG.
///
/// Millimetres along the camera's z axis, in the camera's own (distorted) pixels; 0 where there is nothing.
#[derive(Args)]
#[command(after_help = "Example:\n  scenes depth myroom --camera cam1 --out depth_cam1.png")]
pub(crate) struct Depth {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
    /// The camera's name in scene.toml.
    #[arg(long, value_name = "NAME")]
    camera: String,
    /// File to write the PNG to.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl Depth {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        Outputs::new([self.out.as_path()]).refuse(room::files_of(&self.room))?;
        let room = Room::read(&self.room)?;
        let camera = &room.camera(&self.camera)?.camera;
        let map = if let Some(geometry) = &room.geometry {
            render(&RayScene::new(geometry)?, camera)
        } else {
            tracing::warn!("{}: the room has no geometry, so the depth is 0 everywhere", self.room.display());
            DepthMap::nothing(camera.intrinsics.width, camera.intrinsics.height)
        };
        tracing::info!("{:.1} % of the pixels see something", 100.0 * map.coverage());
        Ok(png::write(&self.out, &map)?)
    }
}
