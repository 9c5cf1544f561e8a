//! Options of a run's events.

use anyhow::Context;
use clap::{Args, ValueEnum};
use scenes::room::Room;

use super::start::Start;
use crate::events::{Clock, EventFileOptions};
use crate::source::NamedSource;

/// Whether a run writes its events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Switch {
    /// Always.
    On,
    /// Never.
    Off,
}

/// Interval of the counts, seconds: an option of a run, and of the events of a finished one.
#[derive(Debug, Args)]
pub(super) struct CountArguments {
    /// Interval of the rows of counts.csv, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0)]
    counts_every: f64,
}

impl CountArguments {
    pub(super) fn options(&self) -> EventFileOptions {
        EventFileOptions { counts_every_s: self.counts_every, ..EventFileOptions::default() }
    }
}

#[derive(Debug, Args)]
#[command(next_help_heading = "Events")]
pub(super) struct EventArguments {
    /// Write OUT/events.jsonl, counts.csv, heat.csv, heat.png and groups.csv [default: on in a room with zones, regions or
    /// lines]
    #[arg(long, value_name = "WHEN", require_equals = true, num_args = 0..=1, default_missing_value = "on")]
    events: Option<Switch>,
    #[command(flatten)]
    counts: CountArguments,
    /// Time of day of the first frame, which tracks.jsonl and events.jsonl then have as `clock`: RFC 3339
    /// (2026-11-26T09:00:00+01:00); `file`: when the first --video was recorded, as its container states it, else when
    /// the file was made; `now`: the present, for live cameras
    #[arg(long, value_name = "TIME|file|now")]
    start: Option<Start>,
}

impl EventArguments {
    pub(super) fn options(&self) -> EventFileOptions {
        self.counts.options()
    }

    /// Whether the events of a run in this room are written.
    pub(super) fn are_on(&self, room: &Room) -> bool {
        let has_places = !(room.zones.is_empty() && room.regions.is_empty() && room.lines.is_empty());
        self.events.map_or(has_places, |switch| switch == Switch::On)
    }

    /// Time of day, if it was given or can be asked for.
    pub(super) fn clock(&self, videos: &[NamedSource]) -> anyhow::Result<Option<Clock>> {
        let clock = self.start.as_ref().map(|start| start.clock(videos)).transpose();
        clock.context("--start")
    }
}
