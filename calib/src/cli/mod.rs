//! The command line, one file a subcommand.

mod calibration_verdict;
mod intrinsics;
mod pose;

use std::io::Write;

use clap::{Parser, Subcommand};

/// Camera calibration: intrinsics and pose of a camera.
#[derive(Parser)]
#[command(name = "calib", version, about)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Say more (-v, -vv).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    Intrinsics(intrinsics::Intrinsics),
    Pose(pose::Pose),
}

impl Command {
    pub(crate) fn run(&self) -> anyhow::Result<()> {
        match self {
            Self::Intrinsics(command) => command.run(),
            Self::Pose(command) => command.run(),
        }
    }
}

/// Focal lengths and principal point with a standard deviation each, pixels.
fn print_lens(out: &mut impl Write, k: &calib::Intrinsics, sigma_px: [f64; 4]) -> std::io::Result<()> {
    let s = sigma_px;
    writeln!(out, "focal length     {:.2} ± {:.2}, {:.2} ± {:.2} px", k.fx, s[0], k.fy, s[1])?;
    writeln!(out, "principal point  {:.2} ± {:.2}, {:.2} ± {:.2} px", k.cx, s[2], k.cy, s[3])
}
