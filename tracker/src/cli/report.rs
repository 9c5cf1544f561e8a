//! `tracker report`: one page that shows what a run did.

use std::path::PathBuf;

use tracker::report::{self, ReportOptions, ReportSources};

/// Write one self-contained page about a run: floor plan with everybody's way, film stills with predicted
/// occlusion, visibility over time, evaluation, time per stage.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker report out --room myroom --out report.html
  tracker report out --room myroom --truth truth.txt --truth-room office/room --out report.html")]
pub(crate) struct ReportArgs {
    /// The folder that `tracker run` wrote.
    #[arg(value_name = "OUT")]
    run: PathBuf,
    /// The room directory of the run.
    #[arg(long, value_name = "DIR")]
    room: PathBuf,
    /// True floor positions, to evaluate against and to draw.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Room directory in whose frame the truth stands, if not the run's; aligned by the cameras' poses.
    #[arg(long, value_name = "DIR", requires = "truth")]
    truth_room: Option<PathBuf>,
    /// Where to write the page.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Runs the subcommand and returns what to print.
pub(crate) fn report(args: &ReportArgs) -> anyhow::Result<String> {
    let sources = ReportSources {
        run: args.run.clone(),
        room: args.room.clone(),
        truth: args.truth.clone(),
        truth_room: args.truth_room.clone(),
    };
    report::write(&sources, &args.out, &ReportOptions::default())?;
    Ok(format!("{}\n", args.out.display()))
}
