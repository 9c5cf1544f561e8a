//! The command line, one file a subcommand.

mod check;
mod depth;
mod edit;
mod export;
mod import;
mod plan;

use std::io::Write;

use clap::{Parser, Subcommand};
use shell::console::CANNOT;

/// The room model: a room's geometry, and what its cameras see of it.
#[derive(Parser)]
#[command(name = "scenes", version, about)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Say more (-v, -vv).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub(crate) verbose: u8,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    Check(check::Check),
    Depth(depth::Depth),
    Plan(plan::Plan),
    Edit(edit::Edit),
    Import(import::Import),
    Export(export::Export),
}

impl Command {
    pub(crate) fn run(&self, out: &mut impl Write) -> anyhow::Result<()> {
        match self {
            Self::Check(command) => command.run(out),
            Self::Depth(command) => command.run(),
            Self::Plan(command) => command.run(),
            Self::Edit(command) => command.run(out),
            Self::Import(command) => command.run(out),
            Self::Export(command) => command.run(),
        }
    }

    /// Exit status of a failed command: a room that does not pass the check is an answer, not misuse.
    pub(crate) fn failure(&self) -> u8 {
        match self {
            Self::Check(_) => 1,
            _ => CANNOT,
        }
    }
}
