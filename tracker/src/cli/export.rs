//! `tracker export`: a finished run in the formats of other programs.

use std::fmt::Write;
use std::path::PathBuf;

use anyhow::bail;
use scenes::room::{self, Room};
use shell::files::Outputs;

use crate::export::{geojson, mcap};
use crate::tracks::files_of_run;

/// Write a finished run in the formats of other programs.
///
/// --mcap writes a recording for Foxglove and Rerun: people, events, zones, regions, lines, cameras and the plan, in
/// Foxglove's schemas. --geojson writes cameras, zones, regions, lines and tracks as a map in WGS 84; scene.toml needs
/// the room's place for that: [geo] with latitude, longitude and heading.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker export out --room myroom --mcap run.mcap
  tracker export out --room myroom --mcap run.mcap --pictures
  tracker export out --room myroom --geojson tracks.geojson

The place of a room on Earth, in its scene.toml (heading: where the x axis points, degrees clockwise from north; in a
reconstructed room the first camera looks there):
  [geo]
  latitude = 48.1374
  longitude = 11.5755
  heading = 90.0")]
pub(crate) struct ExportArgs {
    /// Folder that `tracker run` wrote.
    #[arg(value_name = "OUT")]
    run: PathBuf,
    /// Room directory of the run.
    #[arg(long, value_name = "DIR")]
    room: PathBuf,
    /// MCAP file to write.
    #[arg(long, value_name = "FILE", required_unless_present = "geojson")]
    mcap: Option<PathBuf>,
    /// Include the frames of the films in the MCAP file
    #[arg(long, requires = "mcap")]
    pictures: bool,
    /// GeoJSON file to write.
    #[arg(long, value_name = "FILE")]
    geojson: Option<PathBuf>,
}

/// Runs the subcommand and returns what to print.
pub(crate) fn export(args: &ExportArgs) -> anyhow::Result<String> {
    let room = Room::read(&args.room)?;
    if !args.run.is_dir() {
        bail!("{}: there is no such folder; name one that `tracker run` wrote", args.run.display());
    }
    let files = args.mcap.iter().chain(&args.geojson).map(PathBuf::as_path);
    Outputs::new(files).refuse(files_of_run(&args.run).into_iter().chain(room::files_of(&args.room)))?;
    let mut text = String::new();
    if let Some(file) = &args.mcap {
        let options = mcap::McapOptions { pictures: args.pictures };
        let report = mcap::write(&args.run, &room, file, options)?;
        // Writing to a string cannot fail, here and below.
        let _ = writeln!(text, "{}: {} frames, {} messages", file.display(), report.frames, report.messages);
    }
    if let Some(file) = &args.geojson {
        geojson::write(&args.run, &room, &args.room, file)?;
        let _ = writeln!(text, "{}", file.display());
    }
    Ok(text)
}
