//! Input of every metric: truth and tracks, frame by frame, with the similarity of each pair.
//!
//! On the floor, similarity is `max(0, 1 − d / (2 · gate))` of the distance d, so that 0.5 lies exactly at the gate:
//! the rule of MOTChallenge 3-D and of TrackEval's Euclidean similarity. In the image it is the intersection over union
//! of the boxes, and the gate is the least that counts.

use std::collections::{BTreeMap, HashMap};

use super::correspondence::correspond;
use super::frames::FrameSelection;
use super::grid::PairTable;
use super::instant::Instant;
use crate::rows::{Row, RowFile};
use crate::{Error, Result};

/// Space in which truth and tracks are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Space {
    /// Positions on the floor, metres.
    Floor,
    /// Boxes in an image, pixels.
    Image,
}

/// Truth and tracks side by side, ready for every metric.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Space of the comparison.
    pub space: Space,
    /// Largest distance of a match in metres, or its least overlap.
    pub gate: f64,
    /// Whether truth and tracks both have identities; otherwise only detection can be judged.
    pub has_identities: bool,
    /// Number of different people in the truth (rows, where it has no identities).
    pub people: usize,
    /// Number of different tracks.
    pub tracks: usize,
    /// Number of rows of the truth that count.
    pub truth_rows: usize,
    /// Number of rows of the tracks that count.
    pub track_rows: usize,
    /// Ids of the people in the truth; empty where it has none.
    pub(super) people_ids: Vec<u32>,
    /// Frames with a row, in order.
    pub(super) instants: Vec<Instant>,
}

impl Scenario {
    /// Pairs truth and tracks frame by frame.
    ///
    /// Truth rows whose 7th column is 0 do not count, nor do rows outside `frames`. `to_truth` transforms the tracks'
    /// floor positions to the truth's frame.
    ///
    /// # Errors
    /// Files without a common space to compare (one on the floor, the other in an image), a file in which some rows
    /// have identities and some do not, or a gate that is no positive number.
    pub fn new(
        truth: &RowFile,
        tracks: &RowFile,
        gate: f64,
        frames: &FrameSelection,
        to_truth: Option<&nalgebra::Isometry2<f64>>,
    ) -> Result<Self> {
        let space = common_space(truth, tracks)?;
        let largest = if space == Space::Image { 1.0 } else { f64::INFINITY };
        if !(gate > 0.0 && gate <= largest && gate.is_finite()) {
            return Err(Error::option(
                "gate",
                match space {
                    Space::Floor => format!("is {gate}; give metres above 0"),
                    Space::Image => format!("is {gate}; boxes are matched on overlap: above 0, up to 1"),
                },
            ));
        }
        if space == Space::Image && to_truth.is_some() {
            return Err(Error::option(
                "to_truth",
                "boxes in an image belong to no room; leave the rooms out",
            ));
        }
        let counts = |row: &&Row| frames.contains(row.frame);
        let truth_rows: Vec<&Row> =
            truth.rows.iter().filter(|r| r.confidence != 0.0).filter(counts).collect();
        let track_rows: Vec<&Row> = tracks.rows.iter().filter(counts).collect();
        let has_identities = identities(truth, &truth_rows)? & identities(tracks, &track_rows)?;

        let (mut people, mut track_ids) = (IdIndices::default(), IdIndices::default());
        let mut by_frame: BTreeMap<u32, (Vec<&Row>, Vec<&Row>)> = BTreeMap::new();
        for row in &truth_rows {
            by_frame.entry(row.frame).or_default().0.push(row);
        }
        for row in &track_rows {
            by_frame.entry(row.frame).or_default().1.push(row);
        }
        let pair = |truth: &Row, track: &Row| similarity_and_distance(space, gate, to_truth, truth, track);
        let mut instants: Vec<Instant> = by_frame
            .iter()
            .map(|(frame, (truth, tracks))| {
                let (similarity, distance) =
                    PairTable::pair_from_fn(truth.len(), tracks.len(), |i, j| pair(truth[i], tracks[j]));
                Instant {
                    frame: *frame,
                    truth: truth.iter().map(|r| people.of(r, has_identities)).collect(),
                    tracks: tracks.iter().map(|r| track_ids.of(r, has_identities)).collect(),
                    confidence: tracks.iter().map(|r| r.confidence).collect(),
                    similarity,
                    distance,
                    matches: Vec::new(),
                }
            })
            .collect();
        let threshold = if space == Space::Floor { 0.5 } else { gate };
        correspond(&mut instants, people.count, threshold);
        Ok(Self {
            space,
            gate,
            has_identities,
            people: people.count,
            tracks: track_ids.count,
            truth_rows: truth_rows.len(),
            track_rows: track_rows.len(),
            people_ids: if has_identities { people.ids } else { Vec::new() },
            instants,
        })
    }

    /// Whether all confidences of the tracks can be probabilities; detectors write scores of other kinds there.
    pub(super) fn has_probabilities(&self) -> bool {
        self.instants.iter().flat_map(|i| &i.confidence).all(|c| (0.0..=1.0).contains(c))
    }

    /// Least similarity of a match.
    pub(super) fn threshold(&self) -> f64 {
        if self.space == Space::Floor { 0.5 } else { self.gate }
    }
}

/// Boxes where both files have them, otherwise positions.
pub(super) fn common_space(truth: &RowFile, tracks: &RowFile) -> Result<Space> {
    // Two empty files compare on the floor, which is what this crate's trackers write.
    let nothing = truth.rows.is_empty() && tracks.rows.is_empty();
    if truth.has_boxes() && tracks.has_boxes() && !nothing {
        return Ok(Space::Image);
    }
    if truth.is_on_floor() && tracks.is_on_floor() {
        return Ok(Space::Floor);
    }
    let kind = |file: &RowFile| match (file.is_on_floor(), file.has_boxes()) {
        (true, _) => "holds floor positions",
        (false, true) => "holds boxes",
        (false, false) => "mixes floor positions and boxes",
    };
    Err(Error::content(
        &tracks.path,
        "whole file",
        format!(
            "{}, but the truth {} {}; compare files of the same kind",
            kind(tracks),
            truth.path.display(),
            kind(truth)
        ),
    ))
}

/// Whether the rows of a file have identities; all of them or none.
fn identities(file: &RowFile, rows: &[&Row]) -> Result<bool> {
    let nameless = rows.iter().find(|r| r.id.is_none());
    match nameless {
        Some(row) if rows.iter().any(|r| r.id.is_some()) => Err(Error::content(
            &file.path,
            format!("line {}", row.line),
            "has id −1 while other rows have identities; give it one, or −1 to all",
        )),
        nameless => Ok(nameless.is_none()),
    }
}

pub(super) fn similarity_and_distance(
    space: Space,
    gate: f64,
    to_truth: Option<&nalgebra::Isometry2<f64>>,
    truth: &Row,
    track: &Row,
) -> (f64, f64) {
    match (space, truth.position, track.position, truth.pixel_box, track.pixel_box) {
        (Space::Floor, Some(p), Some(q), ..) => {
            let distance = (to_truth.map_or(q, |t| t * q) - p).norm();
            ((1.0 - distance / (2.0 * gate)).max(0.0), distance)
        }
        (Space::Image, .., Some(a), Some(b)) => (a.iou(&b), (a.foot() - b.foot()).norm()),
        // `common_space` guarantees that every row has the compared quantity.
        _ => (0.0, f64::INFINITY),
    }
}

/// Map from ids to consecutive indices; without identities every row is a person of its own.
#[derive(Default)]
struct IdIndices {
    index_of: HashMap<u32, usize>,
    /// Ids in the order of their indices.
    ids: Vec<u32>,
    count: usize,
}

impl IdIndices {
    fn of(&mut self, row: &Row, has_identities: bool) -> usize {
        let fresh = self.count;
        let index = match row.id.filter(|_| has_identities) {
            Some(id) => *self.index_of.entry(id).or_insert(fresh),
            None => fresh,
        };
        if index == fresh {
            self.ids.extend(row.id);
            self.count += 1;
        }
        index
    }
}
