//! The command line, one file a subcommand.
// Doc comments of arguments are help texts, in which [[zone]] is a table of a file.
#![allow(rustdoc::broken_intra_doc_links)]

mod build;
mod export;
mod picks;
mod picks_page;
mod relocate;

use std::process::ExitCode;

use clap::Subcommand;
use shell::console::{CANNOT, Console};

shell::family_arguments! {
    /// Rooms from captures: each camera is filmed while it is moved to its final pose.
    "recon", Command
}

#[derive(Subcommand)]
enum Command {
    Build(build::Build),
    Picks(picks::Picks),
    Relocate(relocate::Relocate),
    Export(export::Export),
}

/// Exit status of a build whose verdict is red.
const RED: u8 = 1;

/// Runs the command to its end. Returns the exit status: 0, or 1 when a build's verdict is red, or 2 when it failed; then one
/// line on standard error names the problem and its place.
pub fn run(arguments: &Arguments) -> ExitCode {
    let console = Console::start(arguments.verbose);
    let done = arguments.command.run(&console);
    let failure = done.as_ref().err().map_or(CANNOT, failure);
    console.end(done, failure)
}

/// Exit status of a command that ended with this error.
fn failure(error: &anyhow::Error) -> u8 {
    if error.is::<build::RedRoom>() { RED } else { CANNOT }
}

impl Command {
    fn run(&self, console: &Console) -> anyhow::Result<()> {
        match self {
            Self::Build(command) => command.run(console),
            Self::Picks(command) => command.run(console),
            Self::Relocate(command) => command.run(console),
            Self::Export(command) => command.run(console),
        }
    }
}
