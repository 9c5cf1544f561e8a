//! `tracker`: tracks everyone in a room, and evaluates the tracks.
//!
//! Exit status: 0, or 1 when `check` has findings, or 2 after any failure; then one line on standard error names what
//! failed and where.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    tracker::cli::run(&shell::console::arguments())
}
