//! Several recordings: each on its own, and all together.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json, json};

use super::{
    Clear, EvalOptions, Evaluation, Existence, Hota, IdentityMetric, LastingPairs, MetricFigure, PeopleCount,
    PositionError, TrackMetric,
};
use crate::{Error, Result};

/// Paths at which a sequence's folder may hold its truth: this project's and MOTChallenge's.
const TRUTH_FILES: [&str; 2] = ["truth.txt", "gt/gt.txt"];

/// Evaluations of several recordings.
#[derive(Debug, Clone)]
pub struct Sequences {
    /// Evaluations with the sequences' names.
    pub each: Vec<(String, Evaluation)>,
    together: Together,
}

/// Metrics over all recordings: all counts are added up before anything is divided.
#[derive(Debug, Clone)]
struct Together {
    clear: Clear,
    identity: IdentityMetric,
    hota: Hota,
    position: PositionError,
    existence: Existence,
    people_count: PeopleCount,
    lasting: LastingPairs,
}

impl Sequences {
    /// Compares the folder `truth` (`SEQUENCE/truth.txt` or `SEQUENCE/gt/gt.txt`) with the folder `tracks`
    /// (`SEQUENCE.txt`, or `SEQUENCE/tracks.txt`).
    ///
    /// # Errors
    /// A folder without sequences, a sequence without tracks, or an error of [`Evaluation::of_files`].
    pub fn of_folders(truth: &Path, tracks: &Path, options: &EvalOptions) -> Result<Self> {
        let entries = std::fs::read_dir(truth).map_err(Error::io(truth))?;
        let mut folders: Vec<PathBuf> = entries.filter_map(|e| Some(e.ok()?.path())).collect();
        folders.sort();
        let mut each = Vec::new();
        for folder in folders {
            let Some(truth) = TRUTH_FILES.iter().map(|f| folder.join(f)).find(|p| p.is_file()) else {
                continue;
            };
            let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let candidates = [tracks.join(format!("{name}.txt")), tracks.join(&name).join("tracks.txt")];
            let Some(found) = candidates.iter().find(|p| p.is_file()) else {
                return Err(Error::content(
                    &candidates[0],
                    "whole file",
                    format!("is not there, but {} is; every sequence needs its tracks", truth.display()),
                ));
            };
            each.push((name, Evaluation::of_files(&truth, found, options, None)?));
        }
        if each.is_empty() {
            return Err(Error::content(
                truth,
                "folder",
                "holds no sequence; one is a folder SEQUENCE with truth.txt or gt/gt.txt in it",
            ));
        }
        Ok(Self::of(each))
    }

    /// Combines evaluations with their names.
    pub fn of(each: Vec<(String, Evaluation)>) -> Self {
        let all = || each.iter().map(|(_, e)| e);
        let together = Together {
            clear: Clear::together(all().map(|e| &e.clear)),
            identity: IdentityMetric::together(all().map(|e| &e.identity)),
            hota: Hota::together(all().map(|e| &e.hota)),
            position: PositionError::together(all().map(|e| &e.position)),
            existence: Existence::together(all().map(|e| &e.existence)),
            people_count: PeopleCount::together(all().map(|e| &e.people_count)),
            lasting: LastingPairs::together(all().map(|e| &e.lasting)),
        };
        Self { each, together }
    }

    /// All figures of all recordings together.
    pub fn figures(&self) -> Vec<MetricFigure> {
        let t = &self.together;
        [
            t.clear.figures(),
            t.identity.figures(),
            t.hota.figures(),
            t.position.figures(),
            t.existence.figures(),
            t.people_count.figures(),
        ]
        .concat()
    }

    /// Text table with a line a figure and a column a sequence; the last column is for all together.
    pub fn table(&self) -> String {
        let columns: Vec<(&str, Vec<MetricFigure>)> = self
            .each
            .iter()
            .map(|(name, evaluation)| (name.as_str(), evaluation.figures()))
            .chain(std::iter::once(("together", self.figures())))
            .collect();
        let overall = self.figures();
        let name_width = overall.iter().map(|f| f.name.chars().count()).max().unwrap_or(0);
        // Writing to a string cannot fail, here and below.
        let mut text = format!("{:name_width$}", "");
        for (name, _) in &columns {
            let _ = write!(text, "  {name:>12}");
        }
        text.push('\n');
        for (row, figure) in overall.iter().enumerate() {
            let _ = write!(text, "{:name_width$}", figure.name);
            for (name, figures) in &columns {
                let width = name.chars().count().max(12);
                let cell = figures.get(row).map_or(String::new(), MetricFigure::text);
                let _ = write!(text, "  {cell:>width$}");
            }
            text.push('\n');
        }
        for (name, evaluation) in &self.each {
            let protocol = evaluation.protocol.text();
            if let Some(protocol) = protocol.strip_prefix("; ") {
                let _ = writeln!(text, "{name}: {protocol}");
            }
        }
        text
    }

    /// `{"sequences": {NAME: …}, "together": …}`; each as [`Evaluation::json`].
    pub fn json(&self) -> Json {
        let sequences: Map<String, Json> =
            self.each.iter().map(|(name, evaluation)| (name.clone(), evaluation.json())).collect();
        let sum = |count: fn(&Evaluation) -> usize| self.each.iter().map(|(_, e)| count(e)).sum::<usize>();
        let mut together = Map::new();
        together.insert("people".into(), json!(sum(|e| e.scenario.people)));
        together.insert("tracks".into(), json!(sum(|e| e.scenario.tracks)));
        together.insert("truth_rows".into(), json!(sum(|e| e.scenario.truth_rows)));
        together.insert("track_rows".into(), json!(sum(|e| e.scenario.track_rows)));
        super::table::insert_figures(&mut together, &self.figures());
        together.insert("reliability".into(), self.together.existence.json());
        together.insert("motmetrics".into(), super::table::figures_json(&self.together.lasting.figures()));
        json!({ "sequences": sequences, "together": together })
    }
}
