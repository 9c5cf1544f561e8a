//! Options of linking, and their defaults.

use shell::options::check_ranges;
use shell::ranges::{AREA_PX2, COLOR_DISTANCE, COST, FRAMES, PIXEL_DISTANCE, RATE_HZ, SOME_FRAMES};

use super::affinity::{Gate, Thresholds};
use super::build::Prices;
use super::fill::FillOptions;
use super::motion::MotionModel;
use crate::rows::Row;
use crate::{Error, Result};

/// Solver that finds the tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum SolverKind {
    /// The optimum, with its certificate.
    #[default]
    Exact,
    /// Pirsiavash's two-pass dynamic programming: near the optimum.
    Greedy,
}

/// Options of linking; `None` is the default of the kind of graph.
///
/// If one of `max_distance`, `max_area_change_px2`, `max_colour_distance`, `link_cost`, `birth_cost` or
/// `detection_offset` is given, the graph is the paper's: links pass thresholds and all cost the same, and its optimum
/// is the result. Otherwise links cost by a motion model ([`MotionModel`]), and the resulting tracks are linked again
/// over longer gaps by their motion.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LinkOptions {
    /// Largest distance of two linked centres: pixels, or metres on the floor.
    pub max_distance: Option<f64>,
    /// Largest difference of two linked boxes' areas, square pixels.
    pub max_area_change_px2: Option<f64>,
    /// Largest Hellinger distance of two linked boxes' colours, where detections have them.
    pub max_colour_distance: Option<f64>,
    /// Cost of a link.
    pub link_cost: Option<f64>,
    /// Cost of a track's beginning, and of its end.
    pub birth_cost: Option<f64>,
    /// Offset of a detection's cost, which is the offset minus the detection's score.
    pub detection_offset: Option<f64>,
    /// Frames per second; [`LinkOptions::ASSUMED_RATE`] if unknown.
    pub frames_per_s: Option<f64>,
    /// Largest gap of a link, frames: 1 links consecutive frames only.
    pub max_gap: Option<u32>,
    /// Number of frames after which links between detections are final; `None`: never.
    pub window: Option<u32>,
    /// Largest change of a track's velocity at a detection: pixels (metres) per linked frame.
    pub direction_threshold: Option<f64>,
    /// Number of frames skipped after each linked one.
    pub skip: u32,
    /// Least score; detections with lower scores are ignored.
    pub min_score: Option<f64>,
    /// Class of the detections to link, as in [`crate::rows::Row::class`].
    pub class: Option<u32>,
    /// Solver.
    pub solver: SolverKind,
    /// Whether gaps stay unfilled.
    pub keep_gaps: bool,
    /// Standard deviation of the Gaussian that smooths a track's boxes, frames.
    pub smooth_frames: Option<f64>,
}

/// Defaults of the paper's graph.
mod published {
    /// `C_H` of section 4.
    pub(super) const DETECTION_OFFSET: f64 = 0.2;
    pub(super) const BIRTH_COST: f64 = 1.0;
    pub(super) const LINK_COST: f64 = 0.0;
    /// Distance in box heights; the change of area below is in shares of the area.
    pub(super) const MAX_DISTANCE: f64 = 0.25;
    pub(super) const MAX_AREA_CHANGE: f64 = 0.35;
    /// The same clothes in other light stay below this, other clothes seldom do.
    pub(super) const MAX_COLOUR_DISTANCE: f64 = 0.6;
}

/// Defaults with the motion model: prices in scores, times in seconds.
mod chosen {
    /// Price of a track's beginning, and of its end.
    pub(super) const BIRTH: f64 = 0.85;
    /// Score that a detection needs to be linked at all…
    pub(super) const DETECTION_OFFSET: f64 = 0.35;
    /// …and that a track needs on average to be kept, if it is long enough.
    pub(super) const TRACK_OFFSET: f64 = 0.72;
    /// A single detection may be missed within the first graph; longer gaps are left to tracklets.
    pub(super) const DETECTION_GAP: u32 = 2;
    pub(super) const MAX_GAP_S: f64 = 2.5;
    /// Tracklets are linked over shorter gaps first: the velocities of the second round are then known better.
    pub(super) const SHORT_GAP_SHARE: f64 = 0.5;
    pub(super) const SMOOTH_S: f64 = 0.2;
}

/// Options of the linking of tracklets.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Joining {
    pub(super) prices: Prices,
    pub(super) model: MotionModel,
    /// Largest gap of each round, frames.
    pub(super) max_gaps: [u32; 2],
}

impl LinkOptions {
    /// Frame rate assumed if unknown, frames per second.
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

    /// Checks the options.
    ///
    /// # Errors
    /// Names the first invalid option.
    pub fn check(&self) -> Result<()> {
        let given = [
            ("max_distance", self.max_distance, PIXEL_DISTANCE),
            ("max_area_change_px2", self.max_area_change_px2, AREA_PX2),
            ("max_colour_distance", self.max_colour_distance, COLOR_DISTANCE),
            ("direction_threshold", self.direction_threshold, PIXEL_DISTANCE),
            ("smooth_frames", self.smooth_frames, FRAMES),
            ("link_cost", self.link_cost, COST),
            ("birth_cost", self.birth_cost, COST),
            ("detection_offset", self.detection_offset, COST),
            ("min_score", self.min_score, COST),
            ("frames_per_s", self.frames_per_s, RATE_HZ),
            ("skip", Some(f64::from(self.skip)), FRAMES),
        ];
        check_ranges(given.into_iter().filter_map(|(name, value, range)| Some((name, value?, range))))?;
        if self.window == Some(0) {
            return Err(Error::option("window", "is 0; give frames from 1"));
        }
        if self.max_gap == Some(0) {
            return Err(Error::option("max_gap", "is 0; 1 links a frame with the next one only"));
        }
        let gaps = [("window", self.window), ("max_gap", self.max_gap)];
        check_ranges(
            gaps.into_iter().filter_map(|(name, frames)| Some((name, f64::from(frames?), SOME_FRAMES))),
        )?;
        if self.solver == SolverKind::Greedy && self.direction_threshold.is_some() {
            return Err(Error::option(
                "solver",
                "the greedy solver has no direction threshold; leave one of them out",
            ));
        }
        Ok(())
    }

    /// Whether a row of detections has the requested class and score.
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

    /// Rate of the linked frames, frames per second.
    fn rate(&self) -> f64 {
        self.frames_per_s.unwrap_or(Self::ASSUMED_RATE) / f64::from(self.skip + 1)
    }

    /// Motion model for links between detections.
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

    /// Largest gap of links between detections, frames.
    pub(super) fn detection_gap(&self) -> u32 {
        // A detection that noise has moved bends the track twice. With a limit on turns the track must be able to pass
        // over it, or it ends there.
        let published = if self.direction_threshold.is_some() { 2 } else { 1 };
        if self.is_published() {
            self.max_gap.unwrap_or(published)
        } else {
            self.max_gap.map_or(chosen::DETECTION_GAP, |gap| gap.min(chosen::DETECTION_GAP))
        }
    }

    /// Options of the linking of tracklets, in two rounds.
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
