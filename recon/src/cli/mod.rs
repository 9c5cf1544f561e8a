//! The command line, one file a subcommand.

mod build;
mod picks;
mod relocate;

use clap::{Parser, Subcommand};
use shell::console::Console;

/// Rooms from captures: each camera is filmed while it is moved to its final pose.
#[derive(Parser)]
#[command(name = "recon", version, about)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Say more (-v, -vv; -vvv: everything, with what the video libraries print).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    Build(build::Build),
    Picks(picks::Picks),
    Relocate(relocate::Relocate),
}

impl Command {
    pub(crate) fn run(&self, console: &Console) -> anyhow::Result<()> {
        match self {
            Self::Build(command) => command.run(console),
            Self::Picks(command) => command.run(console),
            Self::Relocate(command) => command.run(console),
        }
    }
}
