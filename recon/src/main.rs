//! `recon`: from what cameras filmed while they were put up to a metric room.
//!
//! Exit status: 0, or 2 when anything cannot be done; then one line on standard error says what and where.
#![forbid(unsafe_code)]

use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use recon::build::{self, BuildOptions, BuildReport, Step};

/// Rooms from captures: each camera is filmed while it is moved to its final pose.
#[derive(Parser)]
#[command(name = "recon", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Say more (-v, -vv).
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,
}

#[derive(Subcommand)]
enum Command {
    Build(Build),
}

/// Build a room directory from a capture project.
///
/// Besides scene.toml, room.ply and the reference images, the room gets preview/NAME.png (reference image, depth,
/// the room redrawn) and report.json.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  recon build room.toml --out myroom
  recon build room.toml --out myroom --zones zones.toml
  recon build room.toml --out myroom --threads 2 --seed 7 -v")]
struct Build {
    /// The capture project.
    #[arg(value_name = "ROOM.toml")]
    project: PathBuf,
    /// The room directory to make; a room that is there already is replaced once the new one is finished.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Take the [[zone]] tables of this file; without it a replaced room's zones are kept.
    #[arg(long, value_name = "FILE")]
    zones: Option<PathBuf>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Threads to work with; all processors by default. The room is the same for any number.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let level = match arguments.verbose {
        0 => tracing::Level::WARN,
        1 => tracing::Level::INFO,
        _ => tracing::Level::DEBUG,
    };
    tracing_subscriber::fmt()
        .with_max_level(level)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .without_time()
        .init();
    let done = match &arguments.command {
        Command::Build(command) => run(command),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // Nobody is left to tell if this fails, too.
            let _ = writeln!(std::io::stderr(), "recon: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(command: &Build) -> anyhow::Result<()> {
    if let Some(threads) = command.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .context("--threads")?;
        calib::vision::set_threads(usize::from(threads))?;
    }
    let options =
        BuildOptions { zones: command.zones.clone(), seed: command.seed, ..BuildOptions::default() };
    let mut progress = Progress::new();
    let report = build::build(&command.project, &command.out, &options, &mut |step| progress.show(step));
    progress.end();
    summarise(&report?, command);
    Ok(())
}

fn summarise(report: &BuildReport, command: &Build) {
    for camera in &report.cameras {
        eprintln!(
            "{}: {} of {} frames placed, {} points to {:.2} px; {:.0} % of the image measured, {:.0} % filled",
            camera.name,
            camera.registered,
            camera.frames,
            camera.points,
            camera.reprojection_rms_px,
            100.0 * camera.measured_share,
            100.0 * camera.filled_share
        );
    }
    eprintln!(
        "picks to {:.2} px, floor to {:.1} cm, {} discs; the room is in {}",
        report.pick_rms_px,
        100.0 * report.floor_rms_m,
        report.discs,
        command.out.display()
    );
}

/// A bar on a terminal, plain lines elsewhere.
struct Progress {
    bar: Option<ProgressBar>,
}

impl Progress {
    fn new() -> Self {
        Self { bar: None }
    }

    fn show(&mut self, step: &Step) {
        if !std::io::stderr().is_terminal() {
            eprintln!("{:2} of {}  {}", step.number, step.of, step.what);
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{bar:24} {pos}/{len}  {elapsed}  {wide_msg}");
            let bar = ProgressBar::new(step.of as u64);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.enable_steady_tick(std::time::Duration::from_millis(200));
            bar
        });
        bar.set_position(step.number as u64);
        bar.set_message(step.what.clone());
    }

    fn end(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}
