//! `recon export`: the captures of a built room for programs that reconstruct from pictures with known poses.

use std::path::PathBuf;

use shell::console::{Console, ProgressStages};
use shell::files::Outputs;

use crate::memory::MemoryBound;
use crate::pipeline;
use crate::project::Project;

/// Write a room's captures as a COLMAP model: frames without distortion, their poses, sparse points.
///
/// DIR gets images/NAME/NUMBER.jpg, numbered as in the film, and sparse/0 with cameras.txt, images.txt and points3D.txt, in the
/// room's metres: what COLMAP, nerfstudio and programs of Gaussian splatting start from. Distortion and rolling shutter are
/// taken out of the frames, so that every camera is a pinhole. `scenes export` writes the room itself, as a mesh or as the
/// installed cameras alone.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  recon export room.toml --room myroom --out model
  colmap patch_match_stereo --workspace_path model
  ns-train splatfacto colmap --data model --images-path images --colmap-path sparse/0")]
pub(crate) struct Export {
    /// The capture project that the room was built from.
    #[arg(value_name = "ROOM.toml")]
    project: PathBuf,
    /// The room directory that `recon build` made.
    #[arg(long, value_name = "DIR")]
    room: PathBuf,
    /// The folder to make.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The `--memory` with which the room was built, if one was given: it decides which frames are used.
    #[arg(long, value_name = "AMOUNT")]
    memory: Option<MemoryBound>,
}

impl Export {
    pub(crate) fn run(&self, console: &Console) -> anyhow::Result<()> {
        let captures = Project::inputs(&self.project);
        Outputs::new([self.out.as_path()])
            .refuse([&self.project, &self.room].into_iter().chain(&captures))?;
        let mut stages: Option<ProgressStages> = None;
        let memory = self.memory.unwrap_or_default();
        let done = pipeline::export(&self.project, &self.room, &self.out, memory, &mut |number, of, what| {
            stages.get_or_insert_with(|| console.stages(of)).show(number, what);
        });
        drop(stages);
        let done = done?;
        console.line(&format!(
            "{} frames of {} cameras without distortion, {} points; the model is in {}",
            done.pictures,
            done.cameras,
            done.points,
            self.out.display()
        ));
        Ok(())
    }
}
