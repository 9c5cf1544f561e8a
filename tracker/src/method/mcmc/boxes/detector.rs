//! Parameters of the detector, learnt while it runs: probability of detection by the visible fraction, number of
//! false boxes, and spread of the boxes' edges.

use super::camera::{ExpectedBox, POINTS};

/// Middles of the bins of the visible fraction.
const BINS: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];
/// Prior hits in each bin, of [`PRIOR_TRIALS`]: detectors find most of the people who are half visible.
const PRIOR_HITS: [f64; 5] = [2.0, 4.0, 8.0, 16.0, 18.0];
const PRIOR_TRIALS: f64 = 20.0;
/// Number of trials of a bin above which its counts are halved.
const MOST_TRIALS: f64 = 600.0;
/// Range of the probability of detection.
const PROBABILITIES: std::ops::RangeInclusive<f64> = 0.05..=0.97;
/// Least number of points in the image of a person whose detection is expected.
const LEAST_POINTS: u32 = 4;
/// Probability that a person outside the image is detected nevertheless.
const OUTSIDE: f64 = 0.01;

/// Prior number of false boxes a picture.
const PRIOR_CLUTTER: f64 = 1.0;
const LEAST_CLUTTER: f64 = 0.1;
/// Weight of the newest picture in the running mean of false boxes.
const FOLLOW: f64 = 0.03;
/// Largest width and height of false boxes, as fractions of the image's; their places are uniform.
const CLUTTER_WIDTH: f64 = 0.25;
const CLUTTER_HEIGHT: f64 = 0.5;

/// Prior standard deviations of a box's middle column, width, upper and lower edge, metres at the person's distance.
const SIGMAS_M: [f64; 4] = [0.05, 0.12, 0.05, 0.06];
/// Additional standard deviation of every box, as a fraction of the image's height: pixels, annotation, calibration.
const SIGMA_PART: f64 = 0.004;
/// Bounds of the learnt variances, as multiples of the square of [`SIGMAS_M`].
const LEAST_SCALES: [f64; 4] = [0.12, 0.2, 0.3, 0.3];
const MOST_SCALE: f64 = 4.0;
/// Change of the log variance by one residual: the variances follow the median of the residuals.
const SCALE_STEP: f64 = 0.03;
/// Median of the absolute value of a normal residual, in standard deviations.
const MEDIAN_SIGMAS: f64 = 0.6745;

/// Degrees of freedom of the residuals' Student-t distribution: boxes of partly hidden people deviate far.
const FREEDOM: f64 = 6.0;
/// Log normalisation of that distribution in four dimensions, scaled so that the variances are those given:
/// `Γ((ν+4)/2) / (Γ(ν/2) ((ν−2)π)²)`, for ν = 6 `Γ(5)/Γ(3) = 12`.
const LOG_CONSTANT: f64 = -2.577_141_844;

/// Detected box in one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Detected {
    /// Left, upper, right and lower edge, pixels.
    pub(super) edges: [f64; 4],
    /// Whether the image's border cuts the box at each edge.
    pub(super) cut: [bool; 4],
}

/// Parameters of the detector in all cameras.
#[derive(Debug, Clone)]
pub(super) struct Detector {
    hits: [f64; 5],
    trials: [f64; 5],
    /// Expected number of false boxes a picture, one entry a camera.
    clutter: Vec<f64>,
    /// Learnt factors of the variances.
    scales: [f64; 4],
    /// Entry for each number of visible points: log (1 − p), p / (1 − p).
    by_points: [[f64; 2]; POINTS as usize + 1],
    /// The same for a person outside the image.
    outside: [f64; 2],
}

impl Detector {
    pub(super) fn new(cameras: usize) -> Self {
        let mut detector = Self {
            hits: PRIOR_HITS,
            trials: [PRIOR_TRIALS; 5],
            clutter: vec![PRIOR_CLUTTER; cameras],
            scales: [1.0; 4],
            by_points: [[0.0; 2]; POINTS as usize + 1],
            outside: [(-OUTSIDE).ln_1p(), 0.0],
        };
        detector.tabulate();
        detector
    }

    /// Sets the detection probability to 0, for tests without learning.
    #[cfg(test)]
    pub(super) fn blind(&mut self) {
        self.by_points = [[0.0; 2]; POINTS as usize + 1];
        self.outside = [0.0; 2];
    }

    fn tabulate(&mut self) {
        let rates: [f64; 5] = std::array::from_fn(|bin| self.hits[bin] / self.trials[bin]);
        for (points, entry) in self.by_points.iter_mut().enumerate() {
            let p = interpolated(points as f64 / f64::from(POINTS), &rates)
                .clamp(*PROBABILITIES.start(), *PROBABILITIES.end());
            *entry = [(-p).ln_1p(), p / (1.0 - p)];
        }
    }

    /// Log probability of a missed detection, and odds of a detection, of a person with this many points in the image
    /// and visible. A person of whom next to nothing is in the image is not detected.
    pub(super) fn miss_and_odds(&self, inside: u32, visible: u32) -> [f64; 2] {
        if inside < LEAST_POINTS { self.outside } else { self.by_points[visible as usize] }
    }

    /// Log density of false boxes in a camera with an image of this size, 1/px⁴.
    pub(super) fn log_clutter(&self, camera: usize, width_px: f64, height_px: f64) -> f64 {
        let sizes = CLUTTER_WIDTH * width_px * CLUTTER_HEIGHT * height_px;
        self.clutter[camera].ln() - (width_px * height_px * sizes).ln()
    }

    /// Distribution of the boxes of a person at this depth (metres) around the expected one.
    pub(super) fn noise(&self, focal_px: f64, height_px: f64, depth_m: f64) -> Noise {
        let px_per_m = focal_px / depth_m;
        let of_image = (SIGMA_PART * height_px).powi(2);
        let variances: [f64; 4] =
            std::array::from_fn(|i| (SIGMAS_M[i] * px_per_m).powi(2) * self.scales[i] + of_image);
        Noise {
            log_peak: LOG_CONSTANT - 0.5 * (variances[0] * variances[1] * variances[2] * variances[3]).ln(),
            weights: variances.map(f64::recip),
        }
    }

    /// Updates the detection probability by a person's number of visible points in a picture and the probability that
    /// they were detected.
    pub(super) fn learn_hit(&mut self, visible: u32, found: f64) {
        let part = f64::from(visible) / f64::from(POINTS);
        let nearest = |a: &usize, b: &usize| (BINS[*a] - part).abs().total_cmp(&(BINS[*b] - part).abs());
        let bin = (0..BINS.len()).min_by(nearest).unwrap_or(0);
        self.hits[bin] += found;
        self.trials[bin] += 1.0;
        if self.trials[bin] > MOST_TRIALS {
            self.hits[bin] *= 0.5;
            self.trials[bin] *= 0.5;
        }
    }

    /// Updates the clutter of a camera by the number of false boxes of a picture.
    pub(super) fn learn_clutter(&mut self, camera: usize, count: f64) {
        let clutter = &mut self.clutter[camera];
        *clutter += FOLLOW * (count.max(LEAST_CLUTTER) - *clutter);
    }

    /// Updates the variances by a box that belongs to a person with the probability `weight`.
    pub(super) fn learn_noise(
        &mut self,
        noise: &Noise,
        expected: &ExpectedBox,
        detected: &Detected,
        weight: f64,
    ) {
        let residuals = residuals(expected, detected, [false; 4]);
        let is_whole = [
            !(detected.cut[0] || detected.cut[2]),
            !(detected.cut[0] || detected.cut[2]),
            !detected.cut[1],
            !detected.cut[3],
        ];
        for i in (0..4).filter(|i| is_whole[*i]) {
            let sigmas = residuals[i] * noise.weights[i].sqrt();
            let sign = if sigmas.abs() > MEDIAN_SIGMAS { 1.0 } else { -1.0 };
            let scale = self.scales[i] * (SCALE_STEP * weight * sign).exp();
            self.scales[i] = scale.clamp(LEAST_SCALES[i], MOST_SCALE);
        }
    }

    /// Makes the updates effective: recomputes the table of detection probabilities.
    pub(super) fn apply_learnt(&mut self) {
        self.tabulate();
    }
}

/// Distribution of one person's boxes around the expected one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Noise {
    pub(super) log_peak: f64,
    /// Inverse variances of the residuals, 1/px².
    pub(super) weights: [f64; 4],
}

impl Noise {
    /// Squared Mahalanobis distance above which the log density is below `log_least`.
    pub(super) fn max_squared_sigmas(&self, log_least: f64) -> f64 {
        (FREEDOM - 2.0) * (((self.log_peak - log_least) * (2.0 / (FREEDOM + 4.0))).exp() - 1.0)
    }

    /// Squared Mahalanobis distance of residuals.
    pub(super) fn squared_sigmas(&self, residuals: &[f64; 4]) -> f64 {
        residuals.iter().zip(&self.weights).map(|(r, w)| r * r * w).sum()
    }

    /// Density at this squared distance, divided by `exp(log_base)`.
    pub(super) fn density_over(&self, squared_sigmas: f64, log_base: f64) -> f64 {
        let tail = 1.0 + squared_sigmas / (FREEDOM - 2.0);
        (self.log_peak - log_base).exp() / (tail * tail * tail * tail * tail)
    }

    /// Weight of a box at this squared distance in a robust least-squares fit, at most 1.
    pub(super) fn robust_weight(squared_sigmas: f64) -> f64 {
        ((FREEDOM + 4.0) / (FREEDOM + squared_sigmas)).min(1.0)
    }
}

/// Residuals of a detected box, pixels: middle column, width, upper and lower edge. `censored` edges have none, since
/// both boxes end at the image's border.
pub(super) fn residuals(expected: &ExpectedBox, detected: &Detected, censored: [bool; 4]) -> [f64; 4] {
    let difference = |i: usize| if censored[i] { 0.0 } else { detected.edges[i] - expected.edges[i] };
    let (left, right) = (difference(0), difference(2));
    [0.5 * (left + right), right - left, difference(1), difference(3)]
}

/// Linear interpolation at the visible fraction `part` of values given at the bins' middles.
fn interpolated(part: f64, values: &[f64; 5]) -> f64 {
    let above = BINS.iter().position(|middle| *middle >= part);
    match above {
        Some(0) => values[0],
        None => values[4],
        Some(i) => {
            let t = (part - BINS[i - 1]) / (BINS[i] - BINS[i - 1]);
            values[i - 1] + t * (values[i] - values[i - 1])
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_constant_normalises_four_dimensions() {
        // ∫ (1 + s²/4)⁻⁵ over four dimensions is 2π² ∫ s³ (1 + s²/4)⁻⁵ ds.
        let step = 1e-3;
        let radial: f64 = (0..200_000)
            .map(|i| {
                let s = (f64::from(i) + 0.5) * step;
                s.powi(3) * (1.0 + s * s / 4.0).powi(-5) * step
            })
            .sum();
        let whole = 2.0 * std::f64::consts::PI.powi(2) * radial;
        assert_relative_eq!(LOG_CONSTANT.exp() * whole, 1.0, epsilon = 1e-4);
    }

    #[test]
    fn hit_rates_clutter_and_noise_are_learnt() {
        let mut detector = Detector::new(1);
        let expected = ExpectedBox { edges: [100.0, 50.0, 140.0, 150.0], depth_m: 5.0 };
        let before = detector.noise(500.0, 480.0, 5.0);
        for i in 0..500 {
            detector.learn_hit(POINTS, 0.5);
            detector.learn_clutter(0, 3.0);
            let off = if i % 2 == 0 { 0.5 } else { -0.5 };
            let edges = [100.0 + off, 50.0 + off, 140.0 + off, 150.0 + off];
            let noise = detector.noise(500.0, 480.0, 5.0);
            detector.learn_noise(&noise, &expected, &Detected { edges, cut: [false; 4] }, 1.0);
        }
        detector.apply_learnt();
        let [miss, odds] = detector.miss_and_odds(POINTS, POINTS);
        assert!((odds - 1.0).abs() < 0.15 && (miss - 0.5_f64.ln()).abs() < 0.1, "{miss} {odds}");
        assert!(detector.miss_and_odds(LEAST_POINTS - 1, POINTS)[1] <= 0.0);
        assert!((detector.clutter[0] - 3.0).abs() < 0.01);
        let after = detector.noise(500.0, 480.0, 5.0);
        assert!(before.weights.iter().zip(after.weights).all(|(before, after)| after > *before));
    }

    #[test]
    fn the_farthest_residuals_have_the_least_density() {
        let noise = Detector::new(1).noise(500.0, 480.0, 5.0);
        let far = noise.max_squared_sigmas(-20.0);
        assert_relative_eq!(noise.density_over(far, -20.0), 1.0, epsilon = 1e-9);
    }
}
