//! `roomtrack`: the one program that people call. What needs numbers alone is done here: a room's model, the evaluation and
//! linking of tracks. Any other command goes to `roomtrack-vision`, which loads OpenCV and FFmpeg with the hundred and fifty
//! libraries that they need: half a second from a cold disk.
//!
//! Exit status: that of the command; 2 after any failure, then one line on standard error names the problem and its
//! place.
#![forbid(unsafe_code)]

mod numbers;
mod vision;

use std::ffi::OsString;
use std::process::ExitCode;

fn main() -> ExitCode {
    let words: Vec<OsString> = std::env::args_os().skip(1).collect();
    if numbers::suffice(&words) { numbers::run() } else { vision::become_it(&words) }
}
