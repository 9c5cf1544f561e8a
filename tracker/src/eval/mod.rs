//! How good tracks are, measured against the truth.
//!
//! Two MOTChallenge files → [`Scenario`] (rows side by side, with similarities and the CLEAR correspondence) →
//! one [`Metric`] a file → [`Evaluation`] → table, JSON, report.
//!
//! * [`Clear`] — MOTA, MOTP, MODA, switches, fragmentations, mostly tracked and lost, misses, false positives;
//! * [`Identity`] — IDF1;
//! * [`Hota`] — HOTA, DetA, AssA and their parts;
//! * [`LastingPairs`] — CLEAR as `motmetrics` counts it;
//! * [`PositionError`] — mean, median and maximum distance;
//! * [`Existence`] — whether rows are somebody as often as their confidences say;
//! * [`PeopleCount`] — whether the true number of people is among those that they make likely;
//! * [`Sequences`] — several recordings, each and together;
//! * [`DetectionCurve`] — found against falsely found, as ever less sure detections are taken;
//! * [`plots`] — pictures of all this;
//! * [`align`] — when truth and tracks live in two reconstructions of one room.
//!
//! Definitions follow TrackEval, the reference of MOTChallenge, save for fragmentations, which are counted as
//! `motmetrics` does: a person must be *present and missed* between two matches. (TrackEval also counts a person
//! who left and came back, and overlooks a loss in frames without any track; its count is `Frag`.) Where there is nothing to divide by,
//! a figure is absent rather than 0.

pub mod align;
mod area;
mod assignment;
mod clear;
mod correspondence;
mod existence;
mod frames;
mod grid;
mod hota;
mod identity;
mod instant;
mod lasting;
mod people_count;
pub mod plots;
mod position;
mod roc;
mod scenario;
mod sequences;
mod table;

use std::path::Path;

pub use area::JudgedArea;
pub use clear::{Clear, Continuity};
pub use existence::{Existence, ReliabilityBin};
pub use frames::{FrameRange, FrameSelection};
pub use hota::{Hota, HotaScores};
pub use identity::Identity;
pub use lasting::LastingPairs;
pub use people_count::PeopleCount;
pub use position::{PositionError, PositionStatistics};
pub use roc::{DetectionCurve, DetectionPoint};
pub use scenario::{Scenario, Space};
pub use sequences::Sequences;

use crate::Result;
use crate::tracks::rows::RowFile;
use align::Alignment;

/// A way to judge tracks.
pub trait Metric: Sized {
    /// Measures.
    fn of(scenario: &Scenario) -> Self;
    /// Of several recordings together: everything that is counted is added up, then compared.
    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self
    where
        Self: 'a;
    /// What it found, in the order in which people read it.
    fn figures(&self) -> Vec<Figure>;
}

/// One figure of a metric.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// As in the papers.
    pub name: &'static str,
    /// With its unit.
    pub value: Value,
    /// In half a sentence.
    pub meaning: &'static str,
}

/// A figure's value; `None` where it means nothing (no truth, no identities, no match).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// How many.
    Count(Option<usize>),
    /// How much.
    Real(Option<f64>, Unit),
}

/// What a real figure is measured in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// 0 to 100.
    Percent,
    /// On the floor.
    Metres,
    /// In the image.
    Pixels,
    /// A plain number.
    None,
}

impl Figure {
    fn new(name: &'static str, value: Value, meaning: &'static str) -> Self {
        Self { name, value, meaning }
    }
}

impl Value {
    fn count(count: Option<usize>) -> Self {
        Self::Count(count)
    }
    fn real(value: Option<f64>, unit: Unit) -> Self {
        Self::Real(value, unit)
    }
}

/// A share of 1 in percent.
fn percent(share: Option<f64>) -> Value {
    Value::Real(share.map(|s| 100.0 * s), Unit::Percent)
}

/// What to compare, and how.
#[derive(Debug, Clone, Default)]
pub struct EvalOptions {
    /// Greatest distance of a match in metres (floor), or least overlap (image). Default 0.5 for both.
    pub gate: Option<f64>,
    /// Which frames are judged; default all.
    pub frames: FrameSelection,
}

impl EvalOptions {
    /// Default of [`Self::gate`].
    pub const GATE: f64 = 0.5;
}

/// Every metric of one comparison.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// What was compared.
    pub scenario: Scenario,
    /// CLEAR MOT.
    pub clear: Clear,
    /// Identity.
    pub identity: Identity,
    /// HOTA.
    pub hota: Hota,
    /// Position error.
    pub position: PositionError,
    /// Whether confidences are true.
    pub existence: Existence,
    /// Whether the number of people is.
    pub people_count: PeopleCount,
    /// CLEAR MOT as `motmetrics` counts it.
    pub lasting: LastingPairs,
    /// How the two rooms were brought together, if there were two.
    pub alignment: Option<Alignment>,
}

impl Evaluation {
    /// Compares two files; `alignment` brings the tracks' floor positions into the truth's frame.
    ///
    /// # Errors
    /// What [`RowFile::read`] and [`Scenario::new`] refuse.
    pub fn of_files(
        truth: &Path,
        tracks: &Path,
        options: &EvalOptions,
        alignment: Option<Alignment>,
    ) -> Result<Self> {
        Self::of_rows(&RowFile::read(truth)?, &RowFile::read(tracks)?, options, alignment)
    }

    /// [`Self::of_files`] with rows that were read already.
    ///
    /// # Errors
    /// What [`Scenario::new`] refuses.
    pub fn of_rows(
        truth: &RowFile,
        tracks: &RowFile,
        options: &EvalOptions,
        alignment: Option<Alignment>,
    ) -> Result<Self> {
        let gate = options.gate.unwrap_or(EvalOptions::GATE);
        let to_truth = alignment.as_ref().map(|a| &a.truth_from_room);
        let scenario = Scenario::new(truth, tracks, gate, &options.frames, to_truth)?;
        Ok(Self {
            clear: Clear::of(&scenario),
            identity: Identity::of(&scenario),
            hota: Hota::of(&scenario),
            position: PositionError::of(&scenario),
            existence: Existence::of(&scenario),
            people_count: PeopleCount::of(&scenario),
            lasting: LastingPairs::of(&scenario),
            scenario,
            alignment,
        })
    }

    /// All figures, in the order of the table.
    pub fn figures(&self) -> Vec<Figure> {
        [
            self.clear.figures(),
            self.identity.figures(),
            self.hota.figures(),
            self.position.figures(),
            self.existence.figures(),
            self.people_count.figures(),
        ]
        .concat()
    }
}

#[cfg(test)]
mod mot15_tests;
#[cfg(test)]
mod tests;
