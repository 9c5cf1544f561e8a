//! The command line, one file a subcommand.

mod intrinsics;
mod pose;

use clap::Parser;

/// Camera calibration: what a camera is, and where it stands.
#[derive(Parser)]
#[command(name = "calib", version, about)]
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
