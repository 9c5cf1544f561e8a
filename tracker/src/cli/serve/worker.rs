//! The process of one room.

use std::io::{BufRead, BufReader};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Context;
use shell::console::Console;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

use super::site_plan::run_options;
use crate::cli::room_service::{Order, RoomService};
use crate::cli::run;

/// Runs the worker: what it has to do comes by standard input.
pub(crate) fn worker(console: &Console) -> anyhow::Result<String> {
    let is_ended = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        flag::register(signal, Arc::clone(&is_ended)).context("the signals that end a worker")?;
    }
    // The supervisor decides what a hang-up means.
    flag::register(SIGHUP, Arc::default()).context("the signal that workers ignore")?;
    let mut lines = BufReader::new(std::io::stdin()).lines();
    let first = lines.next().context("a worker is started by `tracker serve`")?;
    let Order::Run(arguments) = serde_json::from_str(&first?)? else {
        anyhow::bail!("the arguments are missing")
    };
    let args = run_options(&arguments).map_err(anyhow::Error::msg)?;
    run::run_as(&args, console, Some(RoomService::start(lines.map_while(Result::ok), is_ended)))
}
