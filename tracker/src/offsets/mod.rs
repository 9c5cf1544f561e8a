//! Time offsets and clock drifts between cameras, estimated from the people that several cameras see.
//!
//! A person stands at one place of the floor at one time in every camera's view. For each camera a matched filter
//! ([`filter`]) therefore responds, frame by frame, at the cells of the floor where the mask shows a person of average
//! build; and two cameras' responses correlate best when the times of one are shifted by the offset between their
//! clocks.
//!
//! 1. [`filter`] — masks to responses on the cells of the floor.
//! 2. [`history`] — one camera's responses over time, without their static part, which carries no information about
//!    time.
//! 3. [`correlation`] — two cameras' responses, correlated by lag and by time. Every pair of frames counts at its own
//!    lag (the discrete correlation function of Edelson and Krolik, "The discrete correlation function: a new method
//!    for analyzing unevenly sampled variability data", Astrophysical Journal 333, 1988), so that rates may differ,
//!    frames may be lost and times may jitter without anything being interpolated.
//! 4. [`fit`] — the straight line of lag over time on which a pair correlates best, its uncertainty, and whether the
//!    peak is real.
//! 5. [`network`] — the offsets of all cameras together, from those of the pairs.
//!
//! The remaining error is one of range: a person whose legs are hidden, or who is tall, seems nearer or farther than
//! they are, which looks like an earlier or later time, depending on their direction. It averages out over directions,
//! and the uncertainty is that of independent walks through the room, not of frames.

mod correlation;
mod filter;
mod fit;
mod history;
mod network;
mod options;
#[cfg(test)]
mod tests;

use self::correlation::PairCorrelation;
use self::filter::PersonFilters;
use self::history::History;
#[cfg(doc)]
use crate::Error;
use crate::Result;
use crate::observation::Mask;
use crate::prepared_room::PreparedRoom;

pub use self::network::CameraOffset;
pub use self::options::OffsetOptions;

/// Offsets of all cameras, as estimated at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Offsets {
    /// Time for which the offsets hold: the latest observed, seconds.
    pub at_s: f64,
    /// One for each camera of the stage.
    pub cameras: Vec<CameraOffset>,
}

impl Offsets {
    /// Seconds to add to a time of this camera to get the reference camera's clock; 0 while the offset is not known.
    pub fn correction_s(&self, camera: usize, time_s: f64) -> f64 {
        let offset = &self.cameras[camera];
        if offset.is_known { offset.offset_s + 1e-6 * offset.drift_ppm * (time_s - self.at_s) } else { 0.0 }
    }
}

/// Estimates the offsets between the cameras of a stage from their foreground masks.
///
/// ```no_run
/// use tracker::observation::Mask;
/// use tracker::offsets::{OffsetEstimator, OffsetOptions, Offsets};
/// use tracker::prepared_room::Stage;
///
/// fn offsets(stage: &Stage, masks: Vec<(usize, f64, Mask)>) -> tracker::Result<Offsets> {
///     let mut estimator = OffsetEstimator::new(stage, OffsetOptions::recording())?;
///     for (camera, time_s, mask) in masks {
///         estimator.observe(camera, time_s, &mask)?;
///     }
///     Ok(estimator.estimate())
/// }
/// ```
#[derive(Debug, Clone)]
pub struct OffsetEstimator {
    options: OffsetOptions,
    filters: PersonFilters,
    /// Number of masks so far, by camera.
    frames: Vec<u32>,
    histories: Vec<History>,
    /// Pairs of cameras that share floor, the lower number first.
    pairs: Vec<PairCorrelation>,
    /// Latest time observed by any camera, seconds.
    latest_s: f64,
}

impl OffsetEstimator {
    /// Prepares the estimator for a room.
    ///
    /// # Errors
    /// [`Error::Option`] when an option makes no sense.
    pub fn new(room: &PreparedRoom, options: OffsetOptions) -> Result<Self> {
        options.validate()?;
        let filters = PersonFilters::new(room);
        let count = room.cameras.len();
        let both = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
        let pairs = both.filter(|[a, b]| filters.share_floor(*a, *b));
        Ok(Self {
            pairs: pairs.map(|cameras| PairCorrelation::new(cameras, &options)).collect(),
            histories: vec![History::default(); count],
            frames: vec![0; count],
            latest_s: f64::NEG_INFINITY,
            filters,
            options,
        })
    }

    /// Takes in a camera's mask, of its pinhole image; 0 is background. Times are the camera's own, in seconds.
    ///
    /// Cameras may come in any order, also one after the other as far as [`OffsetOptions::keep_s`] reaches. The
    /// frames of one camera come in order of time, and one that does not is left out. Frames beyond 15 a second are
    /// left out, too. Where a recording is only sampled, give runs of consecutive frames, 10 s and longer, not single
    /// frames.
    ///
    /// # Errors
    /// [`Error::FrameSize`] when the mask has not the size of the camera's images.
    pub fn observe(&mut self, camera: usize, time_s: f64, mask: &Mask) -> Result<()> {
        self.frames[camera] += 1;
        self.filters.check(camera, self.frames[camera], mask)?;
        if !self.histories[camera].is_due(time_s) {
            return Ok(());
        }
        let responses = self.filters.responses(camera, mask);
        let norms = |responses: &[i8]| self.filters.norms(camera, responses);
        if self.histories[camera].push(time_s, &responses, norms)
            && let Some(new) = self.histories[camera].latest()
        {
            for pair in &mut self.pairs {
                if let Some(other) = pair.other(camera) {
                    pair.add(camera, new, &self.histories[other]);
                }
            }
        }
        self.latest_s = self.latest_s.max(time_s);
        self.histories[camera].forget_before(time_s - self.options.keep_s);
        let oldest_s = self.latest_s - self.options.window_s;
        self.pairs.iter_mut().for_each(|pair| pair.forget_before(oldest_s));
        Ok(())
    }

    /// Estimates the offsets from all observations within [`OffsetOptions::window_s`].
    pub fn estimate(&self) -> Offsets {
        let lines = self.pairs.iter().filter_map(|pair| {
            let interval_s =
                pair.cameras.map(|c| self.histories[c].interval_s()).into_iter().fold(0.0, f64::max);
            Some((pair.cameras, fit::fit(pair, interval_s, &self.options)?.at(self.latest_s)))
        });
        let lines: Vec<_> = lines.collect();
        Offsets { at_s: self.latest_s, cameras: network::solve(self.histories.len(), &lines, &self.options) }
    }
}
