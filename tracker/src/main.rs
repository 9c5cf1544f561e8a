//! `tracker`: tracks everyone in a room, and evaluates the tracks.
//!
//! Exit status: 0, or 1 when `check` has findings, or 2 after any failure; then one line on standard error names what
//! failed and where.
#![forbid(unsafe_code)]

mod cli;

use std::io::Write;
use std::process::ExitCode;

use shell::console::{CANNOT, Console};

fn main() -> ExitCode {
    let arguments: cli::Arguments = shell::console::arguments();
    let console = Console::start(1 + arguments.verbose);
    let mut status = 0;
    let printed = cli::run(&arguments, &console).and_then(|printed| {
        status = printed.status;
        Ok(shell::console::stdout().write_all(printed.text.as_bytes())?)
    });
    if printed.is_ok() && status != 0 {
        return ExitCode::from(status);
    }
    console.end(printed, CANNOT)
}
