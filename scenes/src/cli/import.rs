//! `scenes import`: a room from what another program reconstructed.

use std::path::PathBuf;

use clap::Args;
use scenes::exchange::colmap;
use scenes::geometry::ply;
use scenes::room::{Room, SCENE_FILE};

/// Make a room directory from a COLMAP model (text or binary) and a mesh or cloud.
///
/// The model's world has to be the room's: metres, Z up, the floor at z = 0; `colmap model_aligner` brings it there. Each
/// image becomes a camera of its name. A cloud without faces needs normals.
#[derive(Args)]
#[command(after_help = "Examples:
  scenes import sparse/0 --out myroom
  scenes import sparse/0 --geometry meshed-poisson.ply --out myroom")]
pub(crate) struct Import {
    /// The model's folder.
    #[arg(value_name = "MODEL")]
    model: PathBuf,
    /// What stands in the room, as PLY; without it nothing is hidden by the room.
    #[arg(long, value_name = "FILE")]
    geometry: Option<PathBuf>,
    /// The room directory to make.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Import {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        let cameras = colmap::read(&self.model)?;
        let geometry = self.geometry.as_deref().map(ply::read).transpose()?;
        anyhow::ensure!(
            !self.out.join(SCENE_FILE).exists(),
            "{}: --out: there is a room already; name a new directory",
            self.out.display()
        );
        Ok(Room { cameras, geometry, ..Room::default() }.write(&self.out)?)
    }
}
