//! `tracker`: follow everyone in a room, and measure how well.
//!
//! Exit status: 0, or 2 when anything cannot be done; then one line on standard error says what and where.
#![forbid(unsafe_code)]

mod cli;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;
use shell::console::{CANNOT, Console};

fn main() -> ExitCode {
    let arguments = cli::Arguments::parse();
    let console = Console::start(1 + arguments.verbose);
    let printed =
        cli::run(&arguments, &console).and_then(|text| Ok(std::io::stdout().write_all(text.as_bytes())?));
    console.end(printed, CANNOT)
}
