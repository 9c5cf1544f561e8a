//! Detection curve: recall against false positives a frame, as detections of ever lower scores are included (figure 7
//! of Okada et al., cited in [`crate::link`]; their horizontal axis is not a frame).

use std::collections::BTreeMap;

use serde_json::{Value as Json, json};

use super::frames::FrameSelection;
use super::instant::SIMILARITY_TOLERANCE;
use super::scenario::{Space, common_space, similarity_and_distance};
use crate::Result;
use crate::rows::{Row, RowFile};

/// Largest number of points in JSON; longer curves are thinned.
const MAX_POINTS: usize = 500;

/// Detection curve.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectionCurve {
    /// Points from the highest score to the lowest.
    pub points: Vec<DetectionPoint>,
    /// Area under recall against precision, 0 to 1, without interpolation.
    pub average_precision: f64,
}

/// Point of the curve: the detections with at least some score.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetectionPoint {
    /// Least score of the detections.
    pub score: f64,
    /// Share of the truth that is found, 0 to 1.
    pub recall: f64,
    /// Share of the detections that match a person, 0 to 1.
    pub precision: f64,
    /// Number of detections without a match, a frame.
    pub false_positives_per_frame: f64,
}

impl DetectionCurve {
    /// Curve of scored rows against the truth; in each frame detections choose in the order of their scores. `None`
    /// without truth.
    ///
    /// # Errors
    /// Files without a common space to compare.
    pub fn new(truth: &RowFile, found: &RowFile, gate: f64, frames: &FrameSelection) -> Result<Option<Self>> {
        let space = common_space(truth, found)?;
        let threshold = if space == Space::Floor { 0.5 } else { gate };
        let mut by_frame: BTreeMap<u32, (Vec<&Row>, Vec<&Row>)> = BTreeMap::new();
        for row in truth.rows.iter().filter(|r| r.confidence != 0.0 && frames.contains(r.frame)) {
            by_frame.entry(row.frame).or_default().0.push(row);
        }
        for row in found.rows.iter().filter(|r| frames.contains(r.frame)) {
            by_frame.entry(row.frame).or_default().1.push(row);
        }
        let people: usize = by_frame.values().map(|(truth, _)| truth.len()).sum();
        if people == 0 {
            return Ok(None);
        }
        let mut judged: Vec<(f64, bool)> = Vec::with_capacity(found.rows.len());
        for (truth, found) in by_frame.values_mut() {
            found.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
            let mut is_taken = vec![false; truth.len()];
            for row in found {
                let alike = |person: &Row| similarity_and_distance(space, gate, None, person, row).0;
                let nearest = (0..truth.len())
                    .filter(|i| !is_taken[*i])
                    .map(|i| (alike(truth[i]), i))
                    .filter(|(similarity, _)| *similarity >= threshold - SIMILARITY_TOLERANCE)
                    .max_by(|a, b| a.0.total_cmp(&b.0));
                if let Some((_, i)) = nearest {
                    is_taken[i] = true;
                }
                judged.push((row.confidence, nearest.is_some()));
            }
        }
        Ok(Some(Self::from_judged(judged, people, by_frame.len())))
    }

    fn from_judged(mut judged: Vec<(f64, bool)>, people: usize, frames: usize) -> Self {
        judged.sort_by(|a, b| b.0.total_cmp(&a.0));
        let (mut right, mut wrong, mut area) = (0usize, 0usize, 0.0);
        let mut points: Vec<DetectionPoint> = Vec::new();
        for (index, (score, is_right)) in judged.iter().enumerate() {
            right += usize::from(*is_right);
            wrong += usize::from(!is_right);
            // Detections of one score are one point.
            if judged.get(index + 1).is_some_and(|next| next.0.total_cmp(score).is_eq()) {
                continue;
            }
            let recall = right as f64 / people as f64;
            let precision = right as f64 / (right + wrong) as f64;
            area += (recall - points.last().map_or(0.0, |p| p.recall)) * precision;
            let false_positives_per_frame = wrong as f64 / frames as f64;
            points.push(DetectionPoint { score: *score, recall, precision, false_positives_per_frame });
        }
        Self { points, average_precision: area }
    }

    /// `{"average_precision":…,"points":[{"score":…,"recall":…,"precision":…,"false_positives_per_frame":…},…]}`, shares
    /// 0 to 1, thinned evenly to a few hundred points.
    pub fn json(&self) -> Json {
        let step = self.points.len().div_ceil(MAX_POINTS).max(1);
        let last = self.points.len().saturating_sub(1);
        let kept = self.points.iter().enumerate().filter(|(i, _)| i % step == 0 || *i == last);
        let points: Vec<Json> = kept
            .map(|(_, p)| {
                json!({
                    "score": p.score,
                    "recall": p.recall,
                    "precision": p.precision,
                    "false_positives_per_frame": p.false_positives_per_frame,
                })
            })
            .collect();
        json!({ "average_precision": self.average_precision, "points": points })
    }
}
