//! Messages between the supervisor and a room's worker: a line of JSON each.

use std::io::Write;

use serde::{Deserialize, Serialize};

use crate::TrackId;
use crate::events::Event;

/// From the supervisor, by the worker's standard input. Its end ends the worker.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(in crate::cli) enum Order {
    /// The first line: arguments of `tracker run`.
    Run(Vec<String>),
    /// The room's directory may have changed.
    ReadRoom,
}

/// From the worker, by its standard output.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(in crate::cli) enum Report {
    /// An event that happened at this time, seconds since 1970.
    Event { utc_s: f64, event: Event },
    /// Present heights of people, metres.
    Heights(Vec<(TrackId, f64)>),
}

/// Writes a message.
pub(in crate::cli) fn send(to: &mut impl Write, message: &impl Serialize) -> std::io::Result<()> {
    let line = serde_json::to_string(message)?;
    to.write_all((line + "\n").as_bytes())?;
    to.flush()
}
