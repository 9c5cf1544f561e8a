//! `tracker stats`: the day of a run.

use std::path::PathBuf;

use crate::events::stats::DayStats;

/// Print what happened in a run: how many people came and when, how long they stayed where, who crossed which line.
///
/// Reads OUT/events.jsonl, OUT/counts.csv and OUT/groups.csv, which `tracker run` and `tracker events` write. With --csv:
/// a row for the whole room and for every zone, region and line.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker stats out
  tracker stats out --csv > day.csv")]
pub(crate) struct StatsArgs {
    /// Folder of the run
    #[arg(value_name = "OUT")]
    run: PathBuf,
    /// Print comma-separated values, for a spreadsheet
    #[arg(long)]
    csv: bool,
}

/// Runs the subcommand and returns what to print.
pub(crate) fn stats(args: &StatsArgs) -> anyhow::Result<String> {
    let stats = DayStats::read(&args.run)?;
    Ok(if args.csv { stats.csv() } else { stats.text() })
}
