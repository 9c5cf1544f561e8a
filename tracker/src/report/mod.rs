//! The report: one self-contained page about a run.
//!
//! `tracks.jsonl`, the events, `timings.json` and the films of a run, its room and, where there is one, the truth →
//! `recording` → a section each: who came, when, and who was where how long (`day`), floor plan (`floor_plan`), stills at
//! informative moments (`moments`, `stills`), predicted visibility over time (`timeline`), evaluation and time per stage
//! (`tables`) → one HTML file (`page`). Pictures are embedded and
//! drawings are inline SVG, so the page loads nothing from the network.

mod belonging;
mod day;
mod floor_plan;
mod markup;
mod moments;
mod page;
mod recording;
mod stills;
mod tables;
mod thinning;
mod time_axis;
mod timeline;

use std::path::{Path, PathBuf};

use crate::Result;
use recording::RunRecording;

/// Input of the report.
#[derive(Debug, Clone)]
pub struct ReportSources {
    /// Folder that `tracker run` wrote.
    pub run: PathBuf,
    /// Room directory of the run.
    pub room: PathBuf,
    /// File of true floor positions, if known.
    pub truth: Option<PathBuf>,
    /// Room in whose frame the truth is, if that is another one.
    pub truth_room: Option<PathBuf>,
}

/// Options of the page.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportOptions {
    /// Number of stills per camera. Default 3.
    pub stills: usize,
    /// Largest number of people in the timeline, those with the longest tracks. Default 24.
    pub people: usize,
}

impl Default for ReportOptions {
    fn default() -> Self {
        Self { stills: 3, people: 24 }
    }
}

/// Writes the page atomically.
///
/// # Errors
/// A source that cannot be read (with its place), or a page that cannot be written.
pub fn write(sources: &ReportSources, page: &Path, options: &ReportOptions) -> Result<()> {
    let recording = RunRecording::read(sources)?;
    let html = page::html(&recording, options)?;
    Ok(calib::files::write_atomic(page, html.as_bytes())?)
}

#[cfg(test)]
mod tests;
