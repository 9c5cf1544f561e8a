//! Straight line of lag over time along which two cameras correlate best.
//!
//! A search over a grid of offsets and drifts finds the peak. It is refined by Newton's method on the sum over all
//! windows of local quadratic fits of the correlation. The distance from the line to a window's own peak is the
//! window's slope at the line, divided by the curvature of all windows together. These residuals give the
//! uncertainty, and the fit to them is robust.

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::OffsetOptions;
use super::correlation::{Bin, PairCorrelation};

/// Step of the search over offsets, seconds.
const STEP_S: f64 = 0.04;
/// Least half-width of the triangle by which the search smooths over lags, seconds …
const SMOOTHING_S: f64 = 0.12;
/// … and the same in intervals between frames: frames at the same rate have lags one interval apart.
const SMOOTHING_INTERVALS: f64 = 0.75;
/// Half-width of the local quadratic fit, seconds, and the same in intervals. The peak of people who walk is about
/// 0.4 s wide.
const FIT_S: f64 = 0.25;
const FIT_INTERVALS: f64 = 1.75;
/// Reach of the search over drifts, standard deviations …
const DRIFT_SIGMAS: f64 = 3.0;
/// … and its step, as the movement of the line's ends, seconds.
const DRIFT_STEP_S: f64 = 0.08;
/// Least share of the greatest energy for a lag to be searched; with less, recordings hardly overlap.
const LEAST_OVERLAP: f64 = 0.25;
/// Least distance of another peak, seconds.
const PEAK_WIDTH_S: f64 = 0.6;
/// Least correlation of a real peak …
const LEAST_CORRELATION: f64 = 0.07;
/// … and greatest correlation allowed away from the peak, as a share of the peak's.
const MOST_SECOND: f64 = 0.7;
/// Mean energy of a pair of frames while one person walks where both cameras see them, on generated scenes.
pub(super) const WALKER_ENERGY: f64 = 1.0;
/// Standard deviation of the slope that one walker's window has at the true offset, 1/s, on generated scenes, and the
/// number of windows for which this expectation counts. The flatter the peak, the farther such a slope moves it: two
/// cameras that look at right angles to each other measure time by range alone, and have flat peaks.
const SLOPE_SIGMA: f64 = 0.11;
const SLOPE_SIGMA_COUNT: f64 = 4.0;
/// Number of people in a window beyond which more add no information: they share the room's errors of range.
const MOST_WALKERS: f64 = 1.0;
/// Number of standard deviations beyond which residuals count less (Huber).
const HUBER: f64 = 2.0;
/// Largest number of Newton's steps, and the step at which they end, seconds.
const MOST_STEPS: usize = 12;
const CONVERGED_S: f64 = 1e-4;

/// An offset that changes at a constant rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct OffsetLine {
    /// Time at which the offset of `value` holds, seconds.
    pub(super) at_s: f64,
    /// Offset in seconds, and its drift in seconds a second.
    pub(super) value: Vector2<f64>,
    pub(super) covariance: Matrix2<f64>,
}

impl OffsetLine {
    /// Inverse of the covariance; zero where there is none.
    pub(super) fn precision(&self) -> Matrix2<f64> {
        self.covariance.try_inverse().unwrap_or_default()
    }

    /// The same line, with its offset at another time, seconds.
    pub(super) fn at(&self, time_s: f64) -> Self {
        let step = Matrix2::new(1.0, time_s - self.at_s, 0.0, 1.0);
        Self { at_s: time_s, value: step * self.value, covariance: step * self.covariance * step.transpose() }
    }
}

/// Window of time; its middle is relative to the energy-weighted mean time, seconds.
struct CorrelationWindow<'a> {
    time_s: f64,
    bins: &'a [Bin],
}

/// A peak of the correlation over offsets and drifts.
#[derive(Debug, Clone, Copy)]
struct Peak {
    value: Vector2<f64>,
    correlation: f64,
    /// Greatest correlation away from the peak.
    second: f64,
}

/// The correlation of one window near a lag: `value + slope·x + half_curvature·x²`.
struct Local {
    energy: f64,
    slope: f64,
    half_curvature: f64,
}

/// Fits the line of a pair whose cameras have `interval_s` between their frames; `None` while there is no real peak.
pub(super) fn fit(pair: &PairCorrelation, interval_s: f64, options: &OffsetOptions) -> Option<OffsetLine> {
    let energy_of = |bins: &[Bin]| bins.iter().map(|bin| bin.energy).sum::<f64>();
    let (mut all, mut moment) = (0.0, 0.0);
    for (time_s, bins) in pair.windows() {
        let energy = energy_of(bins);
        all += energy;
        moment += energy * time_s;
    }
    if all <= 0.0 {
        return None;
    }
    let at_s = moment / all;
    let windows: Vec<CorrelationWindow> =
        pair.windows().map(|(time_s, bins)| CorrelationWindow { time_s: time_s - at_s, bins }).collect();
    let peak = search(&windows, pair.largest_lag_s, interval_s, options)?;
    let is_real = peak.correlation >= LEAST_CORRELATION
        && peak.second <= MOST_SECOND * peak.correlation
        && peak.value.x.abs() <= options.reach_s;
    if !is_real {
        return None;
    }
    let (value, covariance) = refine(&windows, peak.value, interval_s, options)?;
    Some(OffsetLine { at_s, value, covariance })
}

/// Finds the greatest correlation on a grid of offsets and drifts.
fn search(
    windows: &[CorrelationWindow],
    largest_s: f64,
    interval_s: f64,
    options: &OffsetOptions,
) -> Option<Peak> {
    let half_s = SMOOTHING_S.max(SMOOTHING_INTERVALS * interval_s);
    let count = (2.0 * largest_s / STEP_S) as usize + 1;
    let offset_s = |i: usize| i as f64 * STEP_S - largest_s;
    let smooth: Vec<Vec<[f64; 2]>> =
        windows.iter().map(|w| smoothed(w.bins, largest_s, count, half_s)).collect();
    let along = |drift: f64| {
        let mut sums = vec![[0.0; 2]; count];
        for (window, smooth) in windows.iter().zip(&smooth) {
            let shift = (drift * window.time_s / STEP_S).round() as isize;
            for (i, sum) in sums.iter_mut().enumerate() {
                if let Some([energy, product]) = i.checked_add_signed(shift).and_then(|i| smooth.get(i)) {
                    sum[0] += energy;
                    sum[1] += product;
                }
            }
        }
        let most = sums.iter().map(|[energy, _]| *energy).fold(0.0, f64::max);
        let correlation = move |[energy, product]: [f64; 2]| {
            if energy > LEAST_OVERLAP * most { product / energy } else { 0.0 }
        };
        sums.into_iter().map(correlation).collect::<Vec<f64>>()
    };
    let half_span_s = windows.iter().map(|w| w.time_s.abs()).fold(0.0, f64::max);
    let most_drift = DRIFT_SIGMAS * 1e-6 * options.drift_sigma_ppm;
    let steps = (most_drift * half_span_s / DRIFT_STEP_S) as i32;
    let drifts = (-steps..=steps).map(|step| most_drift * f64::from(step) / f64::from(steps.max(1)));
    let best_of = |drift: f64| {
        let curve = along(drift);
        let (at, best) = curve.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        let far = curve.iter().enumerate().filter(|(i, _)| i.abs_diff(at) as f64 * STEP_S > PEAK_WIDTH_S);
        let second = far.map(|(_, c)| *c).fold(0.0, f64::max);
        Some(Peak { value: Vector2::new(offset_s(at), drift), correlation: best, second })
    };
    drifts.filter_map(best_of).max_by(|a, b| a.correlation.total_cmp(&b.correlation))
}

/// Energy and product at each offset of the grid, smoothed over lags by a triangle.
fn smoothed(bins: &[Bin], largest_s: f64, count: usize, half_s: f64) -> Vec<[f64; 2]> {
    let mut grid = vec![[0.0; 2]; count];
    for (bin, lag_s) in bins.iter().filter_map(|bin| Some((bin, bin.lag_s()?))) {
        let place = |lag_s: f64| (lag_s + largest_s) / STEP_S;
        let first = place(lag_s - half_s).ceil().max(0.0) as usize;
        let last = (place(lag_s + half_s).floor() as usize).min(count - 1);
        for (i, sum) in grid.iter_mut().enumerate().take(last + 1).skip(first) {
            let share = 1.0 - (i as f64 - place(lag_s)).abs() * STEP_S / half_s;
            sum[0] += share * bin.energy;
            sum[1] += share * bin.product;
        }
    }
    grid
}

/// Finds the line near a peak at which the correlation is greatest, and its covariance.
fn refine(
    windows: &[CorrelationWindow],
    start: Vector2<f64>,
    interval_s: f64,
    options: &OffsetOptions,
) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let half_s = FIT_S.max(FIT_INTERVALS * interval_s);
    let prior = Matrix2::from_diagonal(&Vector2::new(0.0, (1e-6 * options.drift_sigma_ppm).powi(-2)));
    // Energy that one walker leaves under the kernel of the local fit in a whole window.
    let walker = WALKER_ENERGY * PairCorrelation::window_pairs(interval_s) * 4.0 / 3.0 * half_s;
    let (mut value, mut covariance) = (start, Matrix2::zeros());
    for _ in 0..MOST_STEPS {
        let locals: Vec<(Vector2<f64>, Local)> = windows
            .iter()
            .filter_map(|window| {
                let x = Vector2::new(1.0, window.time_s);
                Some((x, Local::at(window.bins, x.dot(&value), half_s)?))
            })
            .collect();
        let energy: f64 = locals.iter().map(|(_, local)| local.energy).sum();
        let bend: f64 = locals.iter().map(|(_, local)| local.energy * local.half_curvature).sum();
        let half_curvature = bend / energy;
        if half_curvature.is_nan() || half_curvature >= 0.0 {
            return None;
        }
        // Distance of each window's own peak from the line, seconds, and the number of walkers' windows that it
        // counts for.
        let residuals: Vec<(Vector2<f64>, f64, f64)> = locals
            .iter()
            .map(|(x, local)| {
                (*x, -local.slope / (2.0 * half_curvature), (local.energy / walker).min(MOST_WALKERS))
            })
            .collect();
        let squares: f64 =
            residuals.iter().map(|(_, r, weight)| weight * r.min(half_s).max(-half_s).powi(2)).sum();
        let expected_s = SLOPE_SIGMA / (2.0 * half_curvature);
        let variance =
            (SLOPE_SIGMA_COUNT * expected_s.powi(2) + squares) / (SLOPE_SIGMA_COUNT + residuals.len() as f64);
        let (mut normal, mut right) = (prior, -prior * value);
        for (x, residual, weight) in residuals {
            let sigmas = residual.abs() * (weight / variance).sqrt();
            let weight = weight / variance * (HUBER / sigmas).min(1.0);
            normal += x * x.transpose() * weight;
            right += x * (weight * residual);
        }
        covariance = normal.try_inverse()?;
        let step = covariance * right;
        value += step * (0.5 * half_s / step.x.abs()).min(1.0);
        if step.x.abs() < CONVERGED_S {
            break;
        }
    }
    let is_near = (value.x - start.x).abs() < PEAK_WIDTH_S;
    (is_near && covariance.m11 > 0.0).then_some((value, covariance))
}

impl Local {
    /// Fits by least squares, weighted by energy and by a kernel (Epanechnikov's) of this half-width, seconds; `None`
    /// where there are too few lags.
    fn at(bins: &[Bin], lag_s: f64, half_s: f64) -> Option<Self> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (bin, bin_lag_s) in bins.iter().filter_map(|bin| Some((bin, bin.lag_s()?))) {
            // Lags are in half-widths, so that the matrix is well scaled.
            let x = (bin_lag_s - lag_s) / half_s;
            if x.abs() < 1.0 {
                let kernel = 1.0 - x * x;
                let powers = Vector3::new(1.0, x, x * x);
                normal += powers * powers.transpose() * (kernel * bin.energy);
                right += powers * (kernel * bin.product);
            }
        }
        let energy = normal[(0, 0)];
        let solution = (normal / energy).try_inverse()? * (right / energy);
        solution.iter().all(|s| s.is_finite()).then(|| Self {
            energy,
            slope: solution.y / half_s,
            half_curvature: solution.z / (half_s * half_s),
        })
    }
}
