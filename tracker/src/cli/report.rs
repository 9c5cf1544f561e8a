//! `tracker report`: a page about a run.

use std::path::PathBuf;

use scenes::room;

use shell::files::refuse_inputs;

use crate::report::{self, ReportOptions, ReportSources};
use crate::tracks::files_of_run;

/// Write one self-contained page about a run: floor plan with all trajectories, film stills with predicted occlusion,
/// visibility over time, evaluation, time per stage.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  tracker report out --room myroom --out report.html
  tracker report out --room myroom --truth truth.txt --truth-room office/room --out report.html")]
pub(crate) struct ReportArgs {
    /// Folder that `tracker run` wrote.
    #[arg(value_name = "OUT")]
    run: PathBuf,
    /// Room directory of the run.
    #[arg(long, value_name = "DIR")]
    room: PathBuf,
    /// File of true floor positions, to evaluate against and to draw.
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,
    /// Room directory of the truth's frame, if not the run's; aligned by the cameras' poses.
    #[arg(long, value_name = "DIR", requires = "truth")]
    truth_room: Option<PathBuf>,
    /// File of the page to write.
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
    let rooms = std::iter::once(&args.room).chain(&args.truth_room).flat_map(|dir| room::files_of(dir));
    let inputs = files_of_run(&args.run).into_iter().chain(rooms).chain(args.truth.clone());
    refuse_inputs(&args.out, inputs)?;
    report::write(&sources, &args.out, &ReportOptions::default())?;
    Ok(format!("{}\n", args.out.display()))
}
