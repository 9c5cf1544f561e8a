//! The report: one self-contained page that shows what a run did.
//!
//! `tracks.jsonl`, `timings.json` and the films of a run, its room and, where there is one, the truth →
//! `recording` → a section each: floor plan (`floor_plan`), stills at telling moments (`moments`, `stills`),
//! predicted visibility over time (`timeline`), evaluation and time per stage (`tables`) → one HTML file
//! (`page`). Pictures are embedded and drawings are inline SVG: the page asks the network for nothing.

mod belonging;
mod floor_plan;
mod markup;
mod moments;
mod page;
mod recording;
mod stills;
mod tables;
mod timeline;

use std::path::{Path, PathBuf};

use crate::Result;
use recording::Recording;

/// What to report on.
#[derive(Debug, Clone)]
pub struct ReportSources {
    /// The folder that `tracker run` wrote.
    pub run: PathBuf,
    /// The room directory of the run.
    pub room: PathBuf,
    /// True floor positions, if known.
    pub truth: Option<PathBuf>,
    /// The room in whose frame the truth stands, if that is another one.
    pub truth_room: Option<PathBuf>,
}

/// How the page looks.
#[derive(Debug, Clone, PartialEq)]
pub struct ReportOptions {
    /// Stills per camera. Default 3.
    pub stills: usize,
    /// People in the timeline; those with the longest tracks. Default 24.
    pub people: usize,
}

impl Default for ReportOptions {
    fn default() -> Self {
        Self { stills: 3, people: 24 }
    }
}

/// Writes the page, whole or not at all.
///
/// # Errors
/// A source that cannot be read, named with its place; the page's folder.
pub fn write(sources: &ReportSources, page: &Path, options: &ReportOptions) -> Result<()> {
    let recording = Recording::read(sources)?;
    let html = page::html(&recording, options)?;
    Ok(calib::files::write_atomic(page, html.as_bytes())?)
}

#[cfg(test)]
mod tests;
