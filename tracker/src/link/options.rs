//! What may be chosen about linking, and what is chosen where nothing is said.

use super::affinity::{Gate, Relative, Thresholds};
use super::build::Prices;
use super::fill::FillOptions;
use super::tracklet::MotionOptions;
use crate::{Error, Result};

/// Which solver finds the tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SolverKind {
    /// The optimum, with its proof.
    #[default]
    Exact,
    /// Pirsiavash's two-pass dynamic programming: near the optimum.
    Greedy,
}

/// Everything that may be chosen; `None` is the default of the kind of graph.
///
/// Where one of `max_distance`, `max_area_change_px2`, `link_cost`, `birth_cost` or `detection_offset` is given, the graph
/// is the paper's: links pass thresholds and all cost the same, and its optimum is what is written. Where none is given,
/// links cost by distance in box heights and change of size, and the tracks that this gives are linked again, over
/// longer gaps, by where they come from and where they are going.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LinkOptions {
    /// Greatest distance of two linked centres: pixels, or metres on the floor.
    pub max_distance: Option<f64>,
    /// Greatest difference of two linked boxes' areas, square pixels.
    pub max_area_change_px2: Option<f64>,
    /// What a link costs.
    pub link_cost: Option<f64>,
    /// What a track's beginning costs, and its end.
    pub birth_cost: Option<f64>,
    /// A detection costs this minus its score.
    pub detection_offset: Option<f64>,
    /// Links lead over at most so many frames: 1 from a frame to the next only.
    pub max_gap: Option<u32>,
    /// Greatest change of a track's velocity at a detection: pixels (metres) per frame that is not skipped.
    pub direction_threshold: Option<f64>,
    /// Frames left out after each one that is linked.
    pub skip: u32,
    /// Detections with lower scores are left out.
    pub min_score: Option<f64>,
    /// Only detections of this class, as [`crate::tracks::rows::Row::class`] tells it.
    pub class: Option<u32>,
    /// Which solver.
    pub solver: SolverKind,
    /// Leave gaps as they are.
    pub keep_gaps: bool,
    /// Standard deviation in frames of the Gaussian that smooths a track's boxes.
    pub smooth_frames: Option<f64>,
}

/// The paper's graph, where nothing else is said.
mod published {
    /// `C_H` of section 4.
    pub(super) const DETECTION_OFFSET: f64 = 0.2;
    pub(super) const BIRTH_COST: f64 = 1.0;
    pub(super) const LINK_COST: f64 = 0.0;
    /// In box heights, as is the next in shares of the area.
    pub(super) const MAX_DISTANCE: f64 = 0.25;
    pub(super) const MAX_AREA_CHANGE: f64 = 0.35;
}

/// The part of the greatest gap that tracklets are linked over first.
pub(super) const SHORT_GAP_SHARE: f64 = 0.25;

/// How links between tracklets are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Joining {
    pub(super) prices: Prices,
    pub(super) affinity: Relative,
    pub(super) motion: MotionOptions,
    pub(super) max_gap: u32,
}

impl LinkOptions {
    /// Whether the graph is the paper's.
    pub fn is_published(&self) -> bool {
        let given = [
            self.max_distance,
            self.max_area_change_px2,
            self.link_cost,
            self.birth_cost,
            self.detection_offset,
        ];
        given.iter().any(Option::is_some)
    }

    /// Refuses numbers that mean nothing.
    ///
    /// # Errors
    /// Naming the option.
    pub fn check(&self) -> Result<()> {
        let positive = [
            ("--max-distance", self.max_distance),
            ("--max-area-change", self.max_area_change_px2),
            ("--direction-threshold", self.direction_threshold),
            ("--smooth", self.smooth_frames),
        ];
        for (name, value) in positive {
            if let Some(value) = value.filter(|v| !(*v >= 0.0 && v.is_finite())) {
                return Err(Error::option(name, format!("is {value}; give a number from 0")));
            }
        }
        let finite = [
            ("--link-cost", self.link_cost),
            ("--birth-cost", self.birth_cost),
            ("--detection-offset", self.detection_offset),
            ("--min-score", self.min_score),
        ];
        for (name, value) in finite {
            if let Some(value) = value.filter(|v| !v.is_finite()) {
                return Err(Error::option(name, format!("is {value}; give a number")));
            }
        }
        if self.max_gap == Some(0) {
            return Err(Error::option("--max-gap", "is 0; 1 links a frame with the next one only"));
        }
        if self.solver == SolverKind::Greedy && self.direction_threshold.is_some() {
            return Err(Error::option(
                "--solver greedy",
                "knows no --direction-threshold; leave one of them out",
            ));
        }
        Ok(())
    }

    pub(super) fn thresholds(&self) -> Thresholds {
        let gate = |given: Option<f64>, relative: f64| given.map_or(Gate::Relative(relative), Gate::Absolute);
        Thresholds {
            distance: gate(self.max_distance, published::MAX_DISTANCE),
            area_change: gate(self.max_area_change_px2, published::MAX_AREA_CHANGE),
            link_cost: self.link_cost.unwrap_or(published::LINK_COST),
        }
    }

    /// What links detections where nothing is said: conservative, over at most one missed frame.
    pub(super) fn relative() -> Relative {
        Relative {
            sigma_place: 0.042,
            sigma_growth: 0.7,
            sigma_size: 0.075,
            gate: 3.6,
            weight: 0.073,
            miss_cost: 0.17,
        }
    }

    /// Prices of the graph of detections.
    pub(super) fn prices(&self) -> Prices {
        if self.is_published() {
            Prices {
                birth: self.birth_cost.unwrap_or(published::BIRTH_COST),
                detection_offset: self.detection_offset.unwrap_or(published::DETECTION_OFFSET),
            }
        } else {
            Prices { birth: 0.9, detection_offset: 0.35 }
        }
    }

    /// The greatest gap of links between detections.
    pub(super) fn detection_gap(&self) -> u32 {
        // A detection that noise has moved bends the way twice. With a limit on the bend the track must be able to step over
        // it, or it ends there.
        let published = if self.direction_threshold.is_some() { 2 } else { 1 };
        if self.is_published() { self.max_gap.unwrap_or(published) } else { self.max_gap.unwrap_or(2).min(2) }
    }

    /// Linking of tracklets. It is done twice, over [`SHORT_GAP_SHARE`] of the greatest gap first: the longer tracklets of
    /// the second time know their motion better.
    pub(super) fn joining(&self) -> Joining {
        Joining {
            prices: Prices { birth: 0.86, detection_offset: 0.74 },
            affinity: Relative {
                sigma_place: 0.02,
                sigma_growth: 0.064,
                sigma_size: 0.1,
                gate: 6.5,
                weight: 0.014,
                miss_cost: 0.0025,
            },
            motion: MotionOptions { frames: 24, prior: 2.0 },
            max_gap: self.max_gap.unwrap_or(80),
        }
    }

    pub(super) fn fill(&self) -> FillOptions {
        let default = if self.is_published() { 0.0 } else { 5.0 };
        FillOptions { interpolate: !self.keep_gaps, smooth_frames: self.smooth_frames.unwrap_or(default) }
    }
}
