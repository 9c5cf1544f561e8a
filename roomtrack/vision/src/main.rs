//! `roomtrack-vision`: the programs `calib`, `scenes`, `recon` and `tracker` in one, each a family of commands. `roomtrack`
//! starts it for the commands that need OpenCV or FFmpeg, and for the texts about all of them.
//!
//! Exit status: that of the command; 2 after any failure, then one line on standard error names the problem and its
//! place.
#![forbid(unsafe_code)]

mod arguments;
mod documents;

use std::process::ExitCode;

use clap::FromArgMatches;
use shell::console::{CANNOT, Console};

use arguments::{Arguments, Family};

fn main() -> ExitCode {
    roomtrack::join();
    let parsed = shell::console::parsed(arguments::command(), Arguments::from_arg_matches);
    let documents = match parsed.family {
        Family::Calib(arguments) => return calib::cli::run(&arguments),
        Family::Scenes(arguments) => return scenes::cli::run(&arguments),
        Family::Recon(arguments) => return recon::cli::run(&arguments),
        Family::Tracker(arguments) => return tracker::cli::run(&arguments),
        Family::Completions { shell } => documents::completions(shell),
        Family::Man { out } => documents::man_pages(&out),
    };
    Console::start(0).end(documents, CANNOT)
}
