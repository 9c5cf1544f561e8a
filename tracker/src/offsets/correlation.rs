//! How two cameras' responses correlate, by time and by lag.

use std::collections::BTreeMap;

use super::OffsetOptions;
use super::filter::product;
use super::history::{History, Observation};

/// Observations are gathered over windows of this length: about a way through a room in one direction, so that what one
/// window says is nearly independent of what the next says.
const WINDOW_S: f64 = 4.0;
/// Lags are gathered in bins of this width, each with the mean of its lags.
const BIN_S: f64 = 0.02;
/// Lags are gathered as far beyond the largest offset, to compare the peak with.
pub(super) const MARGIN_S: f64 = 1.0;

/// The correlation of two cameras. The lag of two frames is what has to be added to the second camera's time to get the
/// first one's.
#[derive(Debug, Clone)]
pub(super) struct PairCorrelation {
    /// The two cameras, the lower number first.
    pub(super) cameras: [usize; 2],
    /// The largest lag that is gathered, seconds.
    pub(super) largest_lag_s: f64,
    /// By their number: the time of their middle, divided by their length.
    windows: BTreeMap<i64, Vec<Bin>>,
}

/// Pairs of frames of about the same lag.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Bin {
    /// Sum of the products of the two norms: what `product` would be if the responses were equal but for a factor.
    pub(super) energy: f64,
    /// Sum of lag times energy.
    lag_s: f64,
    /// Sum of the scalar products.
    pub(super) product: f64,
}

impl Bin {
    /// The mean lag; `None` of an empty bin.
    pub(super) fn lag_s(&self) -> Option<f64> {
        (self.energy > 0.0).then(|| self.lag_s / self.energy)
    }
}

impl PairCorrelation {
    pub(super) fn new(cameras: [usize; 2], options: &OffsetOptions) -> Self {
        Self { cameras, largest_lag_s: options.reach_s + MARGIN_S, windows: BTreeMap::new() }
    }

    /// The other camera of the pair; `None` of a camera that is not in it.
    pub(super) fn other(&self, camera: usize) -> Option<usize> {
        match self.cameras {
            [a, b] if a == camera => Some(b),
            [a, b] if b == camera => Some(a),
            _ => None,
        }
    }

    /// Takes in a camera's new observation beside those of the other camera.
    pub(super) fn add(&mut self, camera: usize, new: &Observation, other: &History) {
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

    /// How many pairs of frames a window has for each second of lags, with this interval between frames.
    pub(super) fn window_pairs(interval_s: f64) -> f64 {
        WINDOW_S / (interval_s * interval_s)
    }

    /// The windows in order: the time of the middle, and bins in order of lag.
    pub(super) fn windows(&self) -> impl Iterator<Item = (f64, &[Bin])> {
        self.windows.iter().map(|(number, bins)| ((*number as f64 + 0.5) * WINDOW_S, bins.as_slice()))
    }

    /// Drops the windows that end before this time.
    pub(super) fn forget_before(&mut self, time_s: f64) {
        while let Some(first) = self.windows.first_entry() {
            if (*first.key() as f64 + 1.0) * WINDOW_S > time_s {
                break;
            }
            first.remove();
        }
    }
}
