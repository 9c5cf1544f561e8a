//! `recon`: builds a metric room from the films that cameras took while they were installed.
//!
//! Exit status: 0, or 1 when a build's verdict is red, or 2 when the command failed; then one line on standard error names
//! the problem and its place.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    recon::cli::run(&shell::console::arguments())
}
