//! `scenes plan`: the floor plan of a room, as a picture.

use std::io::Cursor;
use std::path::PathBuf;

use clap::Args;
use image::ImageFormat;
use shell::files::Outputs;
use shell::ranges::ROOM_M;

use crate::plan::{FloorPlan, PlanOptions};
use crate::room::{self, Room};

/// Draw the floor plan of a room: the room from above with the ceiling cut away, its zones and cameras.
#[derive(Args)]
#[command(after_help = "Example:\n  scenes plan myroom --out plan.png")]
pub(crate) struct Plan {
    /// The room directory.
    #[arg(value_name = "DIR")]
    room: PathBuf,
    /// File to write the PNG to.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Longest side of the picture in pixels.
    #[arg(long, value_name = "PX", default_value_t = 1200, value_parser = clap::value_parser!(u32).range(200..=8192))]
    size: u32,
    /// Height at which the room is cut open, metres [default: 2, or 0.3 below a lower ceiling].
    #[arg(long, value_name = "M", value_parser = ROOM_M.number())]
    cut: Option<f64>,
}

impl Plan {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        Outputs::new([self.out.as_path()]).refuse(room::files_of(&self.room))?;
        let room = Room::read(&self.room)?;
        for warning in room.odd_sizes() {
            tracing::warn!("{}: {warning}", self.room.display());
        }
        if room.geometry.is_none() {
            tracing::warn!(
                "{}: the room has no geometry: the plan shows its cameras and zones",
                self.room.display()
            );
        }
        let options =
            PlanOptions { longest_side_px: self.size, cut_height_m: self.cut, ..PlanOptions::default() };
        let picture = FloorPlan::new(&room, &options)?.into_image();
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Png)?;
        Ok(calib::files::write_atomic(&self.out, bytes.get_ref())?)
    }
}
