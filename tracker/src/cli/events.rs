//! `tracker events`: events of a finished run.

use std::path::PathBuf;

use shell::files::OutputLock;

use super::event_arguments::CountArguments;
use crate::events::{self, stats::DayStats};

/// Write what happened in a finished run, after zones, regions or lines were changed, too.
///
/// Reads OUT/tracks.jsonl line by line and writes OUT/events.jsonl (who appeared, entered, left, crossed a line), OUT/counts.csv
/// (people inside, in and out, by zone, region and line), OUT/heat.csv and OUT/heat.png (time spent on each 25 cm of the
/// floor) and OUT/groups.csv (who walked together): the same bytes as `tracker run` in that room. Prints the day in
/// words, as `tracker stats` does.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker events out --room myroom
  tracker events out --room myroom --counts-every 300

Regions and lines are tables of the room's scene.toml:
  [[region]]
  name = \"counter\"
  polygon = [[1.0, 0.5], [2.5, 0.5], [2.5, 2.0]]   # metres on the floor
  dwell_s = 60.0                                   # optional: a longer stay is an event
  [[line]]
  name = \"gate\"
  points = [[0.0, 1.0], [2.0, 1.0]]                # from its left to its right, walking along it, is in")]
pub(crate) struct EventsArgs {
    /// Folder that `tracker run` wrote
    #[arg(value_name = "OUT")]
    run: PathBuf,
    /// Room directory with the zones, regions and lines
    #[arg(long, value_name = "DIR")]
    room: PathBuf,
    #[command(flatten)]
    counts: CountArguments,
}

/// Runs the subcommand and returns what to print.
pub(crate) fn events(args: &EventsArgs) -> anyhow::Result<String> {
    let _lock = OutputLock::if_present(&args.run)?;
    events::of_run(&args.run, &args.room, &args.counts.options())?;
    Ok(DayStats::read(&args.run)?.text())
}
