//! Subcommands of the program, one a file: each maps its options onto the library's, one to one.
// Doc comments of arguments are help texts, in which [[zone]] is a table of a file.
#![allow(rustdoc::broken_intra_doc_links)]

mod agent_options;
mod agent_station;
mod agents;
mod background;
mod check;
mod clocks;
mod detect;
mod endpoints;
mod event_arguments;
mod events;
mod export;
mod flags;
mod heads;
mod input;
mod interrupt;
mod link_colours;
mod masks;
mod outputs;
mod publish;
mod report;
mod room_service;
mod run;
mod run_arguments;
mod sampler;
mod serve;
mod start;
mod station;
mod stations;
mod stats;
mod view;
mod watch;
mod weightmap;

use std::io::Write;
use std::process::ExitCode;

use clap::Subcommand;
use shell::console::{CANNOT, Console};

/// Name of the hidden subcommand of a service's rooms.
const WORKER: &str = "room-worker";

shell::family_arguments! {
    /// Tracks every person in a room, in metres on its floor, from fixed calibrated cameras.
    "tracker", Command
}

#[derive(Debug, Subcommand)]
enum Command {
    Run(Box<run_arguments::RunArgs>),
    Check(check::CheckArgs),
    Serve(serve::ServeArgs),
    Station(Box<station::StationArgs>),
    Watch(watch::WatchArgs),
    Detect(Box<detect::DetectArgs>),
    Link(Box<mot::cli::link::LinkArgs>),
    Agents(agents::AgentsArgs),
    Eval(mot::cli::eval::EvalArgs),
    Events(events::EventsArgs),
    Stats(stats::StatsArgs),
    Masks(masks::MasksArgs),
    Report(report::ReportArgs),
    Export(export::ExportArgs),
    Weightmap(weightmap::WeightMapArgs),
    /// The process of a room of `tracker serve`.
    #[command(name = WORKER, hide = true)]
    RoomWorker,
}

/// Runs the command to its end. Returns the exit status: 0, or 1 when `check` has findings, or 2 after any failure; then
/// one line on standard error names what failed and where.
pub fn run(arguments: &Arguments) -> ExitCode {
    let console = Console::start(1 + arguments.verbose);
    let mut status = 0;
    let printed = command(arguments, &console).and_then(|printed| {
        status = printed.status;
        Ok(shell::console::stdout().write_all(printed.text.as_bytes())?)
    });
    if printed.is_ok() && status != 0 {
        return ExitCode::from(status);
    }
    console.end(printed, CANNOT)
}

/// Result of a subcommand.
pub(crate) struct Printed {
    /// Text for standard output.
    pub(crate) text: String,
    /// Exit status.
    pub(crate) status: u8,
}

impl From<String> for Printed {
    fn from(text: String) -> Self {
        Self { text, status: 0 }
    }
}

fn command(arguments: &Arguments, console: &Console) -> anyhow::Result<Printed> {
    let printed = match &arguments.command {
        Command::Check(args) => return check::check(args).map_err(flags::named),
        Command::Run(args) => run::run(args, console),
        Command::Serve(args) => serve::serve(args, console, arguments.verbose),
        Command::RoomWorker => serve::worker(console),
        Command::Station(args) => station::station(args, console),
        Command::Watch(args) => watch::watch(args),
        Command::Detect(args) => detect::detect(args, console),
        Command::Link(args) => mot::cli::link::link(args, Some(link_colours::look_at_video), console),
        Command::Agents(args) => agents::agents(args, console),
        Command::Eval(args) => mot::cli::eval::eval(args),
        Command::Events(args) => events::events(args),
        Command::Stats(args) => stats::stats(args),
        Command::Masks(args) => masks::masks(args, console),
        Command::Report(args) => report::report(args),
        Command::Export(args) => export::export(args),
        Command::Weightmap(args) => weightmap::weightmap(args),
    };
    printed.map(Printed::from).map_err(flags::named)
}
