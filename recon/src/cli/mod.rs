//! The command line, one file a subcommand.

mod build;
mod picks;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use shell::console::{CANNOT, Console};

/// Rooms from captures: each camera is filmed while it is moved to its final pose.
#[derive(Parser)]
#[command(name = "recon", version, about)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Say more (-v, -vv; -vvv: everything, with what the video libraries print).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Subcommand)]
enum Command {
    Build(build::Build),
    Picks(picks::Picks),
}

/// Runs the command to its end. Returns the exit status: 0, or 2 when it failed; then one line on standard error names
/// the problem and its place.
pub fn run(arguments: &Arguments) -> ExitCode {
    let console = Console::start(arguments.verbose);
    console.end(arguments.command.run(&console), CANNOT)
}

impl Command {
    fn run(&self, console: &Console) -> anyhow::Result<()> {
        match self {
            Self::Build(command) => command.run(console),
            Self::Picks(command) => command.run(console),
        }
    }
}
