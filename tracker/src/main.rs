//! `tracker`: follow everyone in a room, and measure how well.
#![forbid(unsafe_code)]

mod cli;

use std::io::{ErrorKind, Write};
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::EnvFilter;

/// Follows every person in a room, in metres on its floor, from fixed calibrated cameras.
#[derive(Debug, Parser)]
#[command(version, max_term_width = 110)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Tell more (-vv: everything).
    #[arg(short, long, action = clap::ArgAction::Count, global = true)]
    verbose: u8,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Eval(cli::eval::EvalArgs),
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let level = ["warn", "info", "debug"][usize::from(arguments.verbose).min(2)];
    tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(level)))
        .with_writer(std::io::stderr)
        .without_time()
        .with_target(false)
        .init();
    let result = match &arguments.command {
        Command::Eval(args) => cli::eval::eval(args),
    };
    let printed = result.and_then(|text| match std::io::stdout().write_all(text.as_bytes()) {
        // Whoever reads may stop early: `tracker eval … | head -1`.
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(()),
    });
    match printed {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
