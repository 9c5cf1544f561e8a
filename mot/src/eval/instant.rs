//! One frame of truth and tracks side by side.

use super::grid::PairTable;

/// Tolerance of a similarity that should lie exactly at a threshold (as in TrackEval).
pub(super) const SIMILARITY_TOLERANCE: f64 = f64::EPSILON;

/// A match of a person and a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RowMatch {
    /// Index of the person in the scenario.
    pub(super) person: usize,
    /// Index of the track in the scenario.
    pub(super) track: usize,
    /// Similarity, 0 to 1.
    pub(super) similarity: f64,
    /// Distance: metres on the floor, pixels in the image.
    pub(super) distance: f64,
}

/// One frame, with indices into the scenario's people and tracks.
#[derive(Debug, Clone)]
pub(super) struct Instant {
    /// Number of the frame, from 1.
    pub(super) frame: u32,
    /// People of the truth in this frame.
    pub(super) truth: Vec<usize>,
    /// Tracks in this frame.
    pub(super) tracks: Vec<usize>,
    /// Confidences of the tracks' rows.
    pub(super) confidence: Vec<f64>,
    /// Similarity of each truth row (down) and track row (across), 0 to 1.
    pub(super) similarity: PairTable,
    /// Distance of each pair: metres on the floor, pixels between the boxes' foot points in the image.
    pub(super) distance: PairTable,
    /// CLEAR correspondence.
    pub(super) matches: Vec<RowMatch>,
}
