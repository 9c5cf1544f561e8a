//! `calib`: estimates a camera's intrinsics (`intrinsics`) and its pose (`pose`).
//!
//! Exit status: 0, or 2 when the command failed; then one line on standard error names the problem and its place.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    calib::cli::run(&shell::console::arguments())
}
