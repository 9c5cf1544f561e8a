//! Correlation of two cameras' responses, by time and by lag.

use std::collections::BTreeMap;

use super::OffsetOptions;
use super::filter::product;
use super::history::{History, ResponseFrame};

/// Length of the windows over which observations are gathered, seconds: about one walk through a room in one
/// direction, so that the windows' results are nearly independent.
const WINDOW_S: f64 = 4.0;
/// Width of a bin of lags, seconds; each bin keeps the mean of its lags.
const BIN_S: f64 = 0.02;
/// Margin beyond the largest offset within which lags are gathered, too, seconds, to compare the peak with them.
pub(super) const MARGIN_S: f64 = 1.0;

/// Correlation of two cameras. The lag of two frames is the time to add to the second camera's time to get the first
/// one's, seconds.
#[derive(Debug, Clone)]
pub(super) struct PairCorrelation {
    /// Indices of the two cameras, the lower first.
    pub(super) cameras: [usize; 2],
    /// Largest lag that is gathered, seconds.
    pub(super) largest_lag_s: f64,
    /// Bins of each window by its number: the time of its start, divided by its length.
    windows: BTreeMap<i64, Vec<Bin>>,
}

/// Pairs of frames of about the same lag.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Bin {
    /// Sum of the products of the two norms: equals `product` if the responses are equal but for a factor.
    pub(super) energy: f64,
    /// Sum of lag times energy, seconds.
    lag_s: f64,
    /// Sum of the scalar products.
    pub(super) product: f64,
}

impl Bin {
    /// Mean lag, seconds; `None` for an empty bin.
    pub(super) fn lag_s(&self) -> Option<f64> {
        (self.energy > 0.0).then(|| self.lag_s / self.energy)
    }
}

impl PairCorrelation {
    pub(super) fn new(cameras: [usize; 2], options: &OffsetOptions) -> Self {
        Self { cameras, largest_lag_s: options.reach_s + MARGIN_S, windows: BTreeMap::new() }
    }

    /// The other camera of the pair; `None` for a camera that is not in it.
    pub(super) fn other(&self, camera: usize) -> Option<usize> {
        match self.cameras {
            [a, b] if a == camera => Some(b),
            [a, b] if b == camera => Some(a),
            _ => None,
        }
    }

    /// Correlates a camera's new observation with those of the other camera.
    pub(super) fn add(&mut self, camera: usize, new: &ResponseFrame, other: &History) {
        let [first, second] = self.cameras;
        let is_first = camera == first;
        let (norm_of_new, norm_of_old) = if is_first { (second, first) } else { (first, second) };
        let reach_s = self.largest_lag_s;
        for old in other.between(new.time_s - reach_s, new.time_s + reach_s) {
            let energy = f64::from(new.norms[norm_of_new] * old.norms[norm_of_old]);
            if energy > 0.0 {
                let product = f64::from(product(&new.responses, &old.responses));
                let lag_s = if is_first { new.time_s - old.time_s } else { old.time_s - new.time_s };
                self.insert(0.5 * (new.time_s + old.time_s), lag_s, energy, product);
            }
        }
    }

    fn insert(&mut self, time_s: f64, lag_s: f64, energy: f64, product: f64) {
        let bins = (2.0 * self.largest_lag_s / BIN_S) as usize + 1;
        let window = self.windows.entry((time_s / WINDOW_S).floor() as i64);
        let bin = &mut window.or_insert_with(|| vec![Bin::default(); bins])
            [(((lag_s + self.largest_lag_s) / BIN_S) as usize).min(bins - 1)];
        bin.energy += energy;
        bin.lag_s += lag_s * energy;
        bin.product += product;
    }

    /// Number of pairs of frames in a window for each second of lags, with this interval between frames, seconds.
    pub(super) fn window_pairs(interval_s: f64) -> f64 {
        WINDOW_S / (interval_s * interval_s)
    }

    /// The windows in order: time of the middle, seconds, and bins in order of lag.
    pub(super) fn windows(&self) -> impl Iterator<Item = (f64, &[Bin])> {
        self.windows.iter().map(|(number, bins)| ((*number as f64 + 0.5) * WINDOW_S, bins.as_slice()))
    }

    /// Drops the windows that end before this time, seconds.
    pub(super) fn forget_before(&mut self, time_s: f64) {
        while let Some(first) = self.windows.first_entry() {
            if (*first.key() as f64 + 1.0) * WINDOW_S > time_s {
                break;
            }
            first.remove();
        }
    }
}
