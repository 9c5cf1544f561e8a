//! One frame of truth and tracks side by side.

use super::grid::Grid;

/// Rounding of a similarity that should lie exactly at a threshold (as in TrackEval).
pub(super) const SIMILARITY_TOLERANCE: f64 = f64::EPSILON;

/// A person and the track that stands for them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Match {
    /// Index of the person in the scenario.
    pub(super) person: usize,
    /// Index of the track in the scenario.
    pub(super) track: usize,
    /// Their similarity.
    pub(super) similarity: f64,
    /// Their distance: metres on the floor, pixels in the image.
    pub(super) distance: f64,
}

/// One frame: who is there, by index into the scenario's people and tracks.
#[derive(Debug, Clone)]
pub(super) struct Instant {
    /// From 1.
    pub(super) frame: u32,
    /// People of the truth.
    pub(super) truth: Vec<usize>,
    /// Tracks.
    pub(super) tracks: Vec<usize>,
    /// What the tracks' rows say about how sure they are.
    pub(super) confidence: Vec<f64>,
    /// Similarity of each truth row (down) with each track row (across), 0 to 1.
    pub(super) similarity: Grid,
    /// Distance of each pair: metres on the floor, pixels between the boxes' foot points in the image.
    pub(super) distance: Grid,
    /// The CLEAR correspondence.
    pub(super) matches: Vec<Match>,
}
