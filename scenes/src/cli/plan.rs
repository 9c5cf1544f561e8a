//! `scenes plan`: the floor plan of a room, as a picture.

use std::io::Cursor;
use std::path::PathBuf;

use clap::Args;
use image::ImageFormat;
use scenes::plan::{FloorPlan, PlanOptions};
use scenes::room::Room;

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
    #[arg(long, value_name = "M", value_parser = height)]
    cut: Option<f64>,
}

fn height(text: &str) -> Result<f64, &'static str> {
    let finite = text.parse().ok().filter(|metres: &f64| metres.is_finite());
    finite.ok_or("a height is a number of metres, such as 2.1")
}

impl Plan {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        let room = Room::read(&self.room)?;
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
