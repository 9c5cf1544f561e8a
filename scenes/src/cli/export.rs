//! `scenes export`: a room's cameras, points and surfaces for other programs.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use shell::files::Outputs;

use crate::exchange::{colmap, nerfstudio};
use crate::geometry::{Geometry, Mesh, gltf, ply};
use crate::room::{self, Room};

/// Write a room for another program.
///
/// COLMAP and nerfstudio get the cameras, COLMAP the vertices or discs as points, too; `scenes import` reads both back. PLY
/// and GLB are meshes with colours of the room's surfaces, each disc of a cloud as a hexagon.
#[derive(Args)]
#[command(after_help = "Examples:
  scenes export myroom --format colmap --out sparse/0
  scenes export myroom --format nerfstudio --out transforms.json
  scenes export myroom --format glb --out myroom.glb
  scenes export myroom --format ply --out mesh.ply")]
pub(crate) struct Export {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
    /// Format to write.
    #[arg(long, value_enum)]
    format: Format,
    /// The folder (COLMAP) or file to write.
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// cameras.txt, images.txt, points3D.txt
    Colmap,
    /// transforms.json
    Nerfstudio,
    /// Mesh as binary PLY, Z up
    Ply,
    /// Mesh as binary glTF 2.0, Y up
    #[value(alias = "gltf")]
    Glb,
}

impl Export {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        Outputs::new([self.out.as_path()]).refuse(room::files_of(&self.room))?;
        let room = Room::read(&self.room)?;
        match self.format {
            Format::Colmap => colmap::write(&self.out, &room)?,
            Format::Nerfstudio => nerfstudio::write(&self.out, &room)?,
            Format::Ply => ply::write(&self.out, &Geometry::Mesh(self.mesh(&room)?))?,
            Format::Glb => calib::files::write_atomic(&self.out, &gltf::encode(&self.mesh(&room)?)?)?,
        }
        Ok(())
    }

    fn mesh(&self, room: &Room) -> anyhow::Result<Mesh> {
        let geometry = room.geometry.as_ref();
        let problem =
            "the room has no geometry, so there is no mesh; export colmap or nerfstudio for its cameras";
        Ok(geometry.with_context(|| format!("{}: {problem}", self.room.display()))?.to_mesh())
    }
}
