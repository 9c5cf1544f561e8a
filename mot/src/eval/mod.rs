//! Evaluation of tracks against the truth.
//!
//! Two MOTChallenge files → [`Scenario`] (rows side by side, with similarities and the CLEAR correspondence) → one
//! [`TrackMetric`] a file → [`Evaluation`] → table, JSON, report.
//!
//! * [`Clear`] — MOTA, MOTP, MODA, switches, fragmentations, mostly tracked and lost, misses, false positives;
//! * [`IdentityMetric`] — IDF1;
//! * [`Hota`] — HOTA, DetA, AssA and their parts;
//! * [`LastingPairs`] — CLEAR as `motmetrics` counts it;
//! * [`PositionError`] — mean, median and maximum distance;
//! * [`Existence`] — calibration of the rows' confidences;
//! * [`PeopleCount`] — coverage of the true number of people by the distribution that the confidences imply;
//! * [`Sequences`] — several recordings, each and together;
//! * [`DetectionCurve`] — recall against false positives, over the detections' score;
//! * [`Protocol`] — the rows that count, by the rules of a benchmark;
//! * [`plots`] — pictures of all this;
//! * [`align`] — alignment of truth and tracks in two reconstructions of one room.
//!
//! Definitions follow TrackEval, the reference of MOTChallenge, except for fragmentations, which are counted as in
//! `motmetrics`: a person must be *present and missed* between two matches. (TrackEval also counts a person who left
//! and came back, and overlooks a loss in frames without any track; its count is `Frag`.) Where the denominator is 0, a
//! figure is absent rather than 0.

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
mod pair_sums;
mod people_count;
pub mod plots;
mod position;
mod protocol;
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
pub use identity::IdentityMetric;
pub use lasting::LastingPairs;
pub use people_count::PeopleCount;
pub use position::{PositionError, PositionStatistics};
pub use protocol::{JudgedRows, Protocol, ProtocolSummary};
pub use roc::{DetectionCurve, DetectionPoint};
pub use scenario::{Scenario, Space};
pub use sequences::Sequences;

use crate::Result;
use crate::rows::RowFile;
use align::RoomAlignment;

/// A metric of tracks.
pub trait TrackMetric: Sized {
    /// Computes the metric.
    fn of(scenario: &Scenario) -> Self;
    /// Combines several recordings: all counts are added up before anything is divided.
    fn together<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self
    where
        Self: 'a;
    /// Figures in the order of the table.
    fn figures(&self) -> Vec<MetricFigure>;
}

/// A figure of a metric.
#[derive(Debug, Clone, PartialEq)]
pub struct MetricFigure {
    /// Name, as in the papers.
    pub name: &'static str,
    /// Value with its unit.
    pub value: FigureValue,
    /// Meaning in half a sentence.
    pub meaning: &'static str,
}

/// Value of a figure; `None` where it is undefined (no truth, no identities, no match).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FigureValue {
    /// A count.
    Count(Option<usize>),
    /// A real number.
    Real(Option<f64>, Unit),
}

/// Unit of a real figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Percent, 0 to 100.
    Percent,
    /// Metres on the floor.
    Metres,
    /// Pixels in the image.
    Pixels,
    /// A plain number.
    None,
}

impl MetricFigure {
    fn new(name: &'static str, value: FigureValue, meaning: &'static str) -> Self {
        Self { name, value, meaning }
    }
}

impl FigureValue {
    fn count(count: Option<usize>) -> Self {
        Self::Count(count)
    }
    fn real(value: Option<f64>, unit: Unit) -> Self {
        Self::Real(value, unit)
    }
}

/// Converts a share of 1 to percent.
fn percent(share: Option<f64>) -> FigureValue {
    FigureValue::Real(share.map(|s| 100.0 * s), Unit::Percent)
}

/// Options of an evaluation.
#[derive(Debug, Clone, Default)]
pub struct EvalOptions {
    /// Largest distance of a match in metres (floor), or least overlap (image). Default: [`Protocol::gate`].
    pub gate: Option<f64>,
    /// Judged frames; default all.
    pub frames: FrameSelection,
    /// Rules by which rows count.
    pub protocol: Protocol,
}

impl EvalOptions {
    /// Default of [`Self::gate`] for most protocols.
    pub const GATE: f64 = 0.5;
}

/// All metrics of one comparison.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// Rows of truth and tracks side by side.
    pub scenario: Scenario,
    /// CLEAR MOT.
    pub clear: Clear,
    /// Identity.
    pub identity: IdentityMetric,
    /// HOTA.
    pub hota: Hota,
    /// Position error.
    pub position: PositionError,
    /// Calibration of the confidences.
    pub existence: Existence,
    /// Calibration of the number of people.
    pub people_count: PeopleCount,
    /// CLEAR MOT as counted by `motmetrics`.
    pub lasting: LastingPairs,
    /// Alignment of the two rooms, if there were two.
    pub alignment: Option<RoomAlignment>,
    /// Protocol that was followed.
    pub protocol: ProtocolSummary,
}

impl Evaluation {
    /// Compares two files; `alignment` transforms the tracks' floor positions to the truth's frame.
    ///
    /// # Errors
    /// Errors of [`RowFile::read`] and [`Scenario::new`].
    pub fn of_files(
        truth: &Path,
        tracks: &Path,
        options: &EvalOptions,
        alignment: Option<RoomAlignment>,
    ) -> Result<Self> {
        Self::of_rows(&RowFile::read(truth)?, &RowFile::read(tracks)?, options, alignment)
    }

    /// [`Self::of_files`] with rows that were already read.
    ///
    /// # Errors
    /// Errors of [`Protocol::judged`] and [`Scenario::new`].
    pub fn of_rows(
        truth: &RowFile,
        tracks: &RowFile,
        options: &EvalOptions,
        alignment: Option<RoomAlignment>,
    ) -> Result<Self> {
        let JudgedRows { truth, tracks, summary: protocol } = options.protocol.judged(truth, tracks)?;
        let gate = options.gate.unwrap_or(options.protocol.gate());
        let to_truth = alignment.as_ref().map(|a| &a.truth_from_room);
        let scenario = Scenario::new(&truth, &tracks, gate, &options.frames, to_truth)?;
        Ok(Self {
            clear: Clear::of(&scenario),
            identity: IdentityMetric::of(&scenario),
            hota: Hota::of(&scenario),
            position: PositionError::of(&scenario),
            existence: Existence::of(&scenario),
            people_count: PeopleCount::of(&scenario),
            lasting: LastingPairs::of(&scenario),
            scenario,
            alignment,
            protocol,
        })
    }

    /// All figures, in the order of the table.
    pub fn figures(&self) -> Vec<MetricFigure> {
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
mod confidence_tests;
#[cfg(test)]
mod mot15_tests;
#[cfg(test)]
mod tests;
