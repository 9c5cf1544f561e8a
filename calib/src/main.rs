//! `calib`: estimates a camera's intrinsics (`intrinsics`) and its pose (`pose`).
//!
//! Exit status: 0, or 2 when the command failed; then one line on standard error names the problem and its place.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use shell::console::{CANNOT, Console};

fn main() -> ExitCode {
    let arguments: cli::Arguments = shell::console::arguments();
    let console = Console::start(arguments.verbose);
    console.end(arguments.command.run(), CANNOT)
}
