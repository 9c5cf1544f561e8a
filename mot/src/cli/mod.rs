//! The commands that need tracks alone, one a file: each maps its options onto the library's, one to one.
// Doc comments of arguments are help texts, in which [[zone]] is a table of a file.
#![allow(rustdoc::broken_intra_doc_links)]

pub mod eval;
mod flags;
pub mod link;

use std::io::Write;
use std::process::ExitCode;

use clap::Subcommand;
use shell::console::{CANNOT, Console};

shell::family_arguments! {
    /// Tracks every person in a room, in metres on its floor, from fixed calibrated cameras.
    "tracker", Command
}

#[derive(Debug, Subcommand)]
enum Command {
    Link(Box<link::LinkArgs>),
    Eval(eval::EvalArgs),
}

/// Runs the command to its end. Returns the exit status: 0, or 2 after any failure; then one line on standard error names
/// what failed and where.
pub fn run(arguments: &Arguments) -> ExitCode {
    let console = Console::start(1 + arguments.verbose);
    let text = match &arguments.command {
        Command::Link(args) => link::link(args, None, &console),
        Command::Eval(args) => eval::eval(args),
    };
    let printed = text.and_then(|text| Ok(shell::console::stdout().write_all(text.as_bytes())?));
    console.end(printed, CANNOT)
}
