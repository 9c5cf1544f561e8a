//! The command line, one file a subcommand.

mod calibration_verdict;
mod intrinsics;
mod pose;

use std::io::Write;
use std::process::ExitCode;

use clap::Subcommand;
use shell::console::{CANNOT, Console};

shell::family_arguments! {
    /// Camera calibration: intrinsics and pose of a camera.
    "calib", Command
}

#[derive(Subcommand)]
enum Command {
    Intrinsics(intrinsics::Intrinsics),
    Pose(pose::Pose),
}

/// Runs the command to its end. Returns the exit status: 0, or 2 when it failed; then one line on standard error names
/// the problem and its place.
pub fn run(arguments: &Arguments) -> ExitCode {
    let console = Console::start(arguments.verbose);
    console.end(arguments.command.run(), CANNOT)
}

impl Command {
    fn run(&self) -> anyhow::Result<()> {
        match self {
            Self::Intrinsics(command) => command.run(),
            Self::Pose(command) => command.run(),
        }
    }
}

/// Focal lengths and principal point with a standard deviation each, pixels.
fn print_lens(out: &mut impl Write, k: &crate::Intrinsics, sigma_px: [f64; 4]) -> std::io::Result<()> {
    let s = sigma_px;
    writeln!(out, "focal length     {:.2} ± {:.2}, {:.2} ± {:.2} px", k.fx, s[0], k.fy, s[1])?;
    writeln!(out, "principal point  {:.2} ± {:.2}, {:.2} ± {:.2} px", k.cx, s[2], k.cy, s[3])
}
