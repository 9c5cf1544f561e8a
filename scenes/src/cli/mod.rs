//! The command line, one file a subcommand.
// Doc comments of arguments are help texts, in which [[zone]] is a table of a file.
#![allow(rustdoc::broken_intra_doc_links)]

mod check;
mod depth;
mod edit;
mod export;
mod import;
mod plan;

use std::io::Write;
use std::process::ExitCode;

use clap::Subcommand;
use shell::console::{CANNOT, Console};

shell::family_arguments! {
    /// The room model: a room's geometry, and what its cameras see of it.
    "scenes", Command
}

#[derive(Subcommand)]
enum Command {
    Check(check::Check),
    Depth(depth::Depth),
    Plan(plan::Plan),
    Edit(edit::Edit),
    Import(import::Import),
    Export(export::Export),
}

/// Runs the command to its end. Returns the exit status: 0, or 1 when `check` finds a defect in the room, or 2 for any
/// other failure. A reader who closes the pipe early is no failure.
pub fn run(arguments: &Arguments) -> ExitCode {
    let console = Console::start(arguments.verbose);
    let mut out = shell::console::stdout();
    let done = arguments.command.run(&mut out).and_then(|()| Ok(out.flush()?));
    console.end(done, arguments.command.failure())
}

impl Command {
    fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        match self {
            Self::Check(command) => command.run(out),
            Self::Depth(command) => command.run(),
            Self::Plan(command) => command.run(),
            Self::Edit(command) => command.run(out),
            Self::Import(command) => command.run(out),
            Self::Export(command) => command.run(),
        }
    }

    /// Exit status of a failed command: a room that does not pass the check is an answer, not misuse.
    fn failure(&self) -> u8 {
        match self {
            Self::Check(_) => 1,
            _ => CANNOT,
        }
    }
}
