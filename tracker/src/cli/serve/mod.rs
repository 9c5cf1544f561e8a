//! `tracker serve`: the rooms of a site, day after day.
//!
//! One program supervises; each room is a *worker*, another process of this very program. Processes, not threads: a video
//! library that crashes, or a run that takes all the memory, ends one room alone, which is started again after a pause
//! that grows with every failure; the system gives the memory of an ended room back as a whole. A worker gets its
//! arguments by its standard input, so that no stream's password stands in the list of processes, and ends when that
//! input ends: no worker outlives its supervisor, however that ended. By the same way it is told to read its room again
//! (SIGHUP): changed zones, regions and lines are put into the running tracker, which keeps everybody; a room whose
//! cameras, geometry or options have changed is started again alone. What a worker reports (events, heights) comes by its
//! standard output, and its log by its standard error.
//!
//! * `site_file` — `site.toml`; `arguments` — a room's table as arguments of `tracker run`.
//! * `site_plan` — the rooms and doors, checked as a whole.
//! * `supervisor` — the loop over the rooms; `worker_process` — one of them, as the supervisor sees it.
//! * `worker` — the room's process; its outputs and orders are in [`super::room_service`].

mod arguments;
mod site_file;
mod site_plan;
mod supervisor;
mod worker;
mod worker_process;

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;
use shell::console::Console;

use site_plan::SitePlan;
pub(super) use worker::worker;

/// An example of the file, with comments.
const EXAMPLE: &str = include_str!("example.toml");

/// Follow the people of a site's rooms day after day, as one file describes.
///
/// Each room is tracked as `tracker run` does it, in a process of its own, and started again if it ends. Its files are in
/// OUT/ROOM/2026-11-27 (a folder a day, UTC): tracks.jsonl, tracks.txt, boxes, events.jsonl, counts.csv, heat.png and so on; times are
/// seconds since the midnight with which the folder began, and go on over days and restarts, as ids and frames do. Rows
/// are on the disk after a second at most, also when the power fails. OUT/site has people.jsonl (`site_id` of each room's
/// person: whoever walks through a shared door keeps theirs) and events.jsonl of all rooms. SIGHUP reads the file again
/// (a bad one is refused, and the old one holds), SIGTERM and Ctrl-C end it. Paths in the file are relative to its folder.
#[derive(Debug, Args)]
#[command(after_help = concat!("Example of a site.toml:\n\n", include_str!("example.toml")))]
pub(crate) struct ServeArgs {
    /// File that describes the site
    #[arg(value_name = "SITE.toml", required_unless_present = "example")]
    site: Option<PathBuf>,
    /// Print an example of the file, with comments
    #[arg(long)]
    example: bool,
    /// Only check the file
    #[arg(long)]
    check: bool,
}

/// Runs the subcommand.
pub(crate) fn serve(args: &ServeArgs, console: &Console, verbose: u8) -> anyhow::Result<String> {
    let Some(site) = args.site.as_deref().filter(|_| !args.example) else { return Ok(EXAMPLE.to_owned()) };
    let file = enter_folder(site)?;
    if args.check {
        let plan = SitePlan::read(&file)?;
        return Ok(plan.summary());
    }
    supervisor::supervise(&file, console, verbose)?;
    Ok(String::new())
}

/// Makes the file's folder the working directory, to which its paths are relative; returns the file's name.
fn enter_folder(site: &Path) -> anyhow::Result<PathBuf> {
    let folder = site.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder {
        std::env::set_current_dir(folder).with_context(|| site.display().to_string())?;
    }
    let name = site.file_name().with_context(|| format!("{}: is no file", site.display()))?;
    Ok(PathBuf::from(name))
}
