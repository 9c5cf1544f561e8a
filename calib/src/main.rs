//! `calib`: what a camera is (`intrinsics`) and where it stands (`pose`).
//!
//! Exit status: 0, or 2 when anything cannot be done; then one line on standard error says what and where.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

use clap::Parser;
use shell::console::{CANNOT, Console};

fn main() -> ExitCode {
    let arguments = cli::Arguments::parse();
    let console = Console::start(arguments.verbose);
    console.end(arguments.command.run(), CANNOT)
}
