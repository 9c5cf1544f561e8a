//! `scenes`: shows, checks and edits a room directory, and renders its cameras' views.
//!
//! Exit status: 0, or 1 when `check` finds a defect in the room, or 2 for any other failure. A reader who closes the
//! pipe early is no failure.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    scenes::cli::run(&shell::console::arguments())
}
