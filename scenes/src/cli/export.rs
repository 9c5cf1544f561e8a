//! `scenes export`: a room's cameras and points for other programs.

use std::path::PathBuf;

use crate::exchange::{colmap, nerfstudio};
use crate::room::{self, Room};
use clap::{Args, ValueEnum};
use shell::files::Outputs;

/// Write a room for another program.
#[derive(Args)]
#[command(after_help = "Examples:
  scenes export myroom --format colmap --out sparse/0
  scenes export myroom --format nerfstudio --out transforms.json")]
pub(crate) struct Export {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
    /// Format to write.
    #[arg(long, value_enum)]
    format: Format,
    /// The folder (COLMAP) or file (nerfstudio) to write.
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Format {
    /// cameras.txt, images.txt, points3D.txt
    Colmap,
    /// transforms.json
    Nerfstudio,
}

impl Export {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        Outputs::new([self.out.as_path()]).refuse(room::files_of(&self.room))?;
        let room = Room::read(&self.room)?;
        match self.format {
            Format::Colmap => colmap::write(&self.out, &room)?,
            Format::Nerfstudio => nerfstudio::write(&self.out, &room)?,
        }
        Ok(())
    }
}
