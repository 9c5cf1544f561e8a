//! What may be chosen about linking, and what is chosen where nothing is said.

use super::affinity::{Gate, Thresholds};
use super::build::Prices;
use super::fill::FillOptions;
use super::motion::MotionModel;
use crate::tracks::rows::Row;
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
/// Where one of `max_distance`, `max_area_change_px2`, `max_colour_distance`, `link_cost`, `birth_cost` or `detection_offset`
/// is given, the graph is the paper's: links pass thresholds and all cost the same, and its optimum is what is written.
/// Where none is given, links cost by a model of how people move ([`MotionModel`]), and the tracks that this gives are
/// linked again, over longer gaps, by where they come from and where they are going.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LinkOptions {
    /// Greatest distance of two linked centres: pixels, or metres on the floor.
    pub max_distance: Option<f64>,
    /// Greatest difference of two linked boxes' areas, square pixels.
    pub max_area_change_px2: Option<f64>,
    /// Greatest Hellinger distance of two linked boxes' colours, where detections have them.
    pub max_colour_distance: Option<f64>,
    /// What a link costs.
    pub link_cost: Option<f64>,
    /// What a track's beginning costs, and its end.
    pub birth_cost: Option<f64>,
    /// A detection costs this minus its score.
    pub detection_offset: Option<f64>,
    /// Frames per second; [`LinkOptions::ASSUMED_RATE`] where nobody says.
    pub frames_per_s: Option<f64>,
    /// Links lead over at most so many frames: 1 from a frame to the next only.
    pub max_gap: Option<u32>,
    /// Links between detections are settled for good after so many frames; `None`: never.
    pub window: Option<u32>,
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
    /// The same clothes in other light stay below, other clothes seldom do.
    pub(super) const MAX_COLOUR_DISTANCE: f64 = 0.6;
}

/// What is chosen where nothing is said, beside the model of motion: prices in scores, times in seconds.
mod chosen {
    /// Of a track's beginning, and of its end.
    pub(super) const BIRTH: f64 = 0.85;
    /// What a detection's score must be worth to be linked at all, …
    pub(super) const DETECTION_OFFSET: f64 = 0.35;
    /// … and in the mean of a track that is long enough to be kept.
    pub(super) const TRACK_OFFSET: f64 = 0.72;
    /// A single detection may be missed between two that are linked at once; longer gaps are for tracklets.
    pub(super) const DETECTION_GAP: u32 = 2;
    pub(super) const MAX_GAP_S: f64 = 2.5;
    /// Tracklets are linked over shorter gaps first: the longer ones of the second time know their motion better.
    pub(super) const SHORT_GAP_SHARE: f64 = 0.5;
    pub(super) const SMOOTH_S: f64 = 0.2;
}

/// How links between tracklets are found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Joining {
    pub(super) prices: Prices,
    pub(super) model: MotionModel,
    /// The greatest gap of each round.
    pub(super) max_gaps: [u32; 2],
}

impl LinkOptions {
    /// Frames per second of a recording of which nobody knows it.
    pub const ASSUMED_RATE: f64 = 25.0;

    /// Whether the graph is the paper's.
    pub fn is_published(&self) -> bool {
        let given = [
            self.max_distance,
            self.max_area_change_px2,
            self.max_colour_distance,
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
            ("--max-colour-distance", self.max_colour_distance),
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
        if let Some(rate) = self.frames_per_s.filter(|rate| !(*rate > 0.0 && rate.is_finite())) {
            return Err(Error::option("--rate", format!("is {rate}; give the frames per second")));
        }
        if self.window == Some(0) {
            return Err(Error::option("--window", "is 0; give frames from 1"));
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

    /// Whether a row of detections is of the class and has the score that is asked for.
    pub fn wants(&self, row: &Row) -> bool {
        self.min_score.is_none_or(|least| row.confidence >= least)
            && self.class.is_none_or(|class| row.class() == Some(class))
    }

    pub(super) fn thresholds(&self) -> Thresholds {
        let gate = |given: Option<f64>, relative: f64| given.map_or(Gate::Relative(relative), Gate::Absolute);
        Thresholds {
            distance: gate(self.max_distance, published::MAX_DISTANCE),
            area_change: gate(self.max_area_change_px2, published::MAX_AREA_CHANGE),
            colour_distance: self.max_colour_distance.unwrap_or(published::MAX_COLOUR_DISTANCE),
            link_cost: self.link_cost.unwrap_or(published::LINK_COST),
        }
    }

    /// Frames per second of what is linked.
    fn rate(&self) -> f64 {
        self.frames_per_s.unwrap_or(Self::ASSUMED_RATE) / f64::from(self.skip + 1)
    }

    /// What links detections where nothing is said.
    pub(super) fn motion(&self, on_floor: bool) -> MotionModel {
        MotionModel::of_detections(self.rate(), on_floor)
    }

    /// Prices of the graph of detections.
    pub(super) fn prices(&self) -> Prices {
        if self.is_published() {
            Prices {
                birth: self.birth_cost.unwrap_or(published::BIRTH_COST),
                detection_offset: self.detection_offset.unwrap_or(published::DETECTION_OFFSET),
            }
        } else {
            Prices { birth: chosen::BIRTH, detection_offset: chosen::DETECTION_OFFSET }
        }
    }

    /// The greatest gap of links between detections.
    pub(super) fn detection_gap(&self) -> u32 {
        // A detection that noise has moved bends the way twice. With a limit on the bend the track must be able to step over
        // it, or it ends there.
        let published = if self.direction_threshold.is_some() { 2 } else { 1 };
        if self.is_published() {
            self.max_gap.unwrap_or(published)
        } else {
            self.max_gap.map_or(chosen::DETECTION_GAP, |gap| gap.min(chosen::DETECTION_GAP))
        }
    }

    /// Linking of tracklets, in two rounds.
    pub(super) fn joining(&self, on_floor: bool) -> Joining {
        let max_gap = self.max_gap.unwrap_or((chosen::MAX_GAP_S * self.rate()).round().max(2.0) as u32);
        Joining {
            prices: Prices { birth: chosen::BIRTH, detection_offset: chosen::TRACK_OFFSET },
            model: MotionModel::of_tracklets(self.rate(), on_floor),
            max_gaps: [(chosen::SHORT_GAP_SHARE * f64::from(max_gap)) as u32, max_gap],
        }
    }

    pub(super) fn fill(&self) -> FillOptions {
        let default = if self.is_published() { 0.0 } else { chosen::SMOOTH_S * self.rate() };
        FillOptions { interpolate: !self.keep_gaps, smooth_frames: self.smooth_frames.unwrap_or(default) }
    }
}
