//! `recon`: builds a metric room from the films that cameras took while they were installed.
//!
//! Exit status: 0, or 1 when a build's verdict is red, or 2 when the command failed; then one line on standard error names the problem and its place.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use shell::console::{CANNOT, Console};

fn main() -> ExitCode {
    let arguments: cli::Arguments = shell::console::arguments();
    let console = Console::start(arguments.verbose);
    let done = arguments.command.run(&console);
    let failure = done.as_ref().err().map_or(CANNOT, cli::Command::failure);
    console.end(done, failure)
}
