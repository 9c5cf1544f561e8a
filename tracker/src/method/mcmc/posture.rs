//! Posture of a person: standing, seated or crouching, as modes of one person's size, with transitions in time.
//!
//! A hidden Markov model. Given the posture, radius and height of a moment are normal; the prior of a moment is their
//! mixture ([`SizePrior`]), the posterior share of each posture comes from the sampler's states ([`PostureShares`]), and
//! between moments people sit down, crouch and rise at constant rates. The height of the standing posture is the
//! stature: it is kept while somebody sits, and belongs to the identity.
//!
//! Ratios of heights: R. Drillis, R. Contini, "Body segment parameters", 1966 (sitting height 0.52 of the stature, on a
//! seat at the height of the knees).

use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::options::{McmcOptions, Spread};
use crate::silhouette::Body;

/// Number of postures.
const POSTURES: usize = 3;
/// Indices of the postures.
const STANDING: usize = 0;
const SEATED: usize = 1;
const CROUCHING: usize = 2;

/// Height of the head above the floor as a fraction of the stature, mean and standard deviation.
const SEATED_HEIGHT: [f64; 2] = [0.77, 0.04];
const CROUCHING_HEIGHT: [f64; 2] = [0.6, 0.07];
/// Growth of the radius when the knees are bent, with its standard deviation, metres.
const BENT_WIDER_M: [f64; 2] = [0.03, 0.02];

/// Rate at which people who stand still crouch, as a fraction of the rate at which they sit down.
const CROUCHES: f64 = 0.2;
/// Rates of rising from a seat, and from crouching, 1/s.
const RISES_PER_S: f64 = 1.0 / 60.0;
const GETS_UP_PER_S: f64 = 0.5;
/// Speed at which people hardly sit down any more, m/s.
const WALKING_M_S: f64 = 0.4;
/// Probability below which the size of a posture is that of the stature, as nothing has been seen of it.
const UNSEEN: f64 = 1e-3;
/// Least probability of a posture that is possible at all.
const LEAST: f64 = 1e-9;

/// Standard deviations of the radius and the height measured from one fully visible silhouette, metres: gait and
/// errors of the mask are correlated from moment to moment.
const RADIUS_SEEN_SIGMA_M: f64 = 0.10;
const HEIGHT_SEEN_SIGMA_M: f64 = 0.20;
/// Random walk of a person's radius and height, metres of standard deviation after one second.
const RADIUS_DRIFT_M: f64 = 0.005;
const HEIGHT_DRIFT_M: f64 = 0.005;
/// Standard deviations of a single moment's radius and height around those of the posture, metres: strides, swinging
/// arms, a bent back.
const RADIUS_POSE_SIGMA_M: f64 = 0.025;
const HEIGHT_POSE_SIGMA_M: f64 = 0.02;

/// Normal distributions of radius and height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    pub(super) radius: Spread,
    pub(super) height: Spread,
}

impl Size {
    /// Size of an adult, before anything is known of this one.
    pub(super) fn prior(options: &McmcOptions) -> Self {
        Self { radius: options.radius, height: options.height }
    }

    pub(super) fn log_density(&self, body: &Body) -> f64 {
        self.radius.log_density(body.radius_m) + self.height.log_density(body.height_m)
    }

    /// Radius and height drawn from the distribution, metres.
    fn sample(&self, rng: &mut Pcg64Mcg) -> [f64; 2] {
        [self.radius.sample(rng), self.height.sample(rng)]
    }

    /// Squared distance from the mean, in standard deviations.
    fn squared_sigmas(&self, body: &Body) -> f64 {
        let of = |spread: &Spread, value_m: f64| ((value_m - spread.mean_m) / spread.sigma_m).powi(2);
        of(&self.radius, body.radius_m) + of(&self.height, body.height_m)
    }

    /// Size of a bent posture of a standing person.
    fn bent(&self, [share, deviation]: [f64; 2]) -> Self {
        let stature = &self.height;
        let height = Spread {
            mean_m: share * stature.mean_m,
            sigma_m: (share * stature.sigma_m).hypot(deviation * stature.mean_m),
        };
        let [wider_m, wider_sigma_m] = BENT_WIDER_M;
        let radius = Spread {
            mean_m: self.radius.mean_m + wider_m,
            sigma_m: self.radius.sigma_m.hypot(wider_sigma_m),
        };
        Self { radius, height }
    }

    /// Distribution in a single moment.
    fn posed(&self) -> Self {
        let wider = |size: &Spread, by_m: f64| Spread { sigma_m: size.sigma_m.hypot(by_m), ..*size };
        Self {
            radius: wider(&self.radius, RADIUS_POSE_SIGMA_M),
            height: wider(&self.height, HEIGHT_POSE_SIGMA_M),
        }
    }

    /// Distribution after a time without observations; `most` bounds the standard deviations.
    fn drifted(&self, dt_s: f64, most: &Self) -> Self {
        let of = |size: &Spread, drift_m: f64, most: &Spread| Spread {
            sigma_m: (size.sigma_m.powi(2) + drift_m.powi(2) * dt_s).sqrt().min(most.sigma_m),
            ..*size
        };
        Self {
            radius: of(&self.radius, RADIUS_DRIFT_M, &most.radius),
            height: of(&self.height, HEIGHT_DRIFT_M, &most.height),
        }
    }

    /// Distribution after one moment showed this radius and height, of which `visible` was in sight.
    fn updated(&self, [radius_m, height_m]: [f64; 2], visible: f64) -> Self {
        let of = |size: &Spread, seen_m: f64, sigma_m: f64| {
            let gain = visible * size.sigma_m.powi(2) / (size.sigma_m.powi(2) + sigma_m.powi(2));
            Spread {
                mean_m: size.mean_m + gain * (seen_m - size.mean_m),
                sigma_m: size.sigma_m * (1.0 - gain).sqrt(),
            }
        };
        Self {
            radius: of(&self.radius, radius_m, RADIUS_SEEN_SIGMA_M),
            height: of(&self.height, height_m, HEIGHT_SEEN_SIGMA_M),
        }
    }
}

/// Prior of the size in one moment: a mixture.
#[derive(Debug, Clone, Copy)]
pub(super) struct SizePrior {
    /// Weights of the modes; their sum is 1.
    weights: [f64; POSTURES],
    log_weights: [f64; POSTURES],
    modes: [Size; POSTURES],
}

impl SizePrior {
    /// Mixture of these modes; the weights add up to 1.
    pub(super) fn new(weights: [f64; POSTURES], modes: [Size; POSTURES]) -> Self {
        Self { weights, log_weights: weights.map(f64::ln), modes }
    }

    /// Prior of one mode.
    #[cfg(test)]
    pub(super) fn of_one(size: Size) -> Self {
        Self::new([1.0, 0.0, 0.0], [size; POSTURES])
    }

    /// Prior of people who were never seen before.
    pub(super) fn of_newcomers(options: &McmcOptions) -> Self {
        let adult = Size::prior(options);
        Self::new([1.0, 0.0, 0.0], [adult; POSTURES])
    }

    pub(super) fn log_density(&self, body: &Body) -> f64 {
        log_mixture(&self.log_weights, &self.modes, body)
    }

    /// Radius and height drawn from the prior, metres.
    pub(super) fn sample(&self, rng: &mut Pcg64Mcg) -> [f64; 2] {
        let has_one = self.weights[0] >= 1.0;
        let mut mark = if has_one { 0.0 } else { rng.random::<f64>() };
        let reached = self.weights.iter().position(|weight| {
            mark -= weight;
            mark < 0.0
        });
        self.modes[reached.unwrap_or(0)].sample(rng)
    }

    /// Whether there is more than one mode.
    pub(super) fn has_choice(&self) -> bool {
        self.weights[0] < 1.0
    }

    /// Most probable mode.
    pub(super) fn main(&self) -> &Size {
        let best = (0..POSTURES).max_by(|a, b| self.weights[*a].total_cmp(&self.weights[*b]));
        &self.modes[best.unwrap_or(0)]
    }

    /// Radius and height drawn from a mode chosen with equal probability, metres, so that chains reach rare modes.
    pub(super) fn sample_any_mode(&self, rng: &mut Pcg64Mcg) -> [f64; 2] {
        self.modes[rng.random_range(0..POSTURES)].sample(rng)
    }

    /// Log density of [`Self::sample_any_mode`].
    pub(super) fn log_density_of_any_mode(&self, body: &Body) -> f64 {
        log_mixture(&[-(POSTURES as f64).ln(); POSTURES], &self.modes, body)
    }

    /// Posterior probability of each mode, given the body.
    pub(super) fn shares(&self, body: &Body) -> [f64; POSTURES] {
        /// Squared standard deviations up to which a body is plainly of a mode, and from which on it is plainly not.
        const PLAINLY: [f64; 2] = [6.0, 40.0];
        let far =
            |mode: usize| self.weights[mode] == 0.0 || self.modes[mode].squared_sigmas(body) > PLAINLY[1];
        if self.weights[0] > 0.5 && self.modes[0].squared_sigmas(body) < PLAINLY[0] && far(1) && far(2) {
            return [1.0, 0.0, 0.0];
        }
        let whole = self.log_density(body);
        std::array::from_fn(|mode| {
            if self.weights[mode] > 0.0 {
                (self.log_weights[mode] + self.modes[mode].log_density(body) - whole).exp()
            } else {
                0.0
            }
        })
    }
}

/// Log density of a mixture.
fn log_mixture(log_weights: &[f64; POSTURES], modes: &[Size; POSTURES], body: &Body) -> f64 {
    let logs: [f64; POSTURES] = std::array::from_fn(|mode| {
        if log_weights[mode].is_finite() {
            log_weights[mode] + modes[mode].log_density(body)
        } else {
            f64::NEG_INFINITY
        }
    });
    let largest = logs.into_iter().fold(f64::NEG_INFINITY, f64::max);
    largest + logs.iter().map(|log| (log - largest).exp()).sum::<f64>().ln()
}

/// Sums over sampled states of the posterior share of each posture, and of radius and height weighted by it.
#[derive(Debug, Clone, Default)]
pub(super) struct PostureShares {
    shares: [f64; POSTURES],
    radius: [f64; POSTURES],
    height: [f64; POSTURES],
}

impl PostureShares {
    /// Adds one state.
    pub(super) fn add(&mut self, prior: &SizePrior, body: &Body) {
        for (mode, share) in prior.shares(body).into_iter().enumerate() {
            self.shares[mode] += share;
            self.radius[mode] += share * body.radius_m;
            self.height[mode] += share * body.height_m;
        }
    }
}

/// Belief about a person's posture, and about the size in each posture.
#[derive(Debug, Clone)]
pub(super) struct Postures {
    probabilities: [f64; POSTURES],
    sizes: [Size; POSTURES],
}

impl Postures {
    /// Belief about a newcomer who showed this radius and height, metres, in a moment.
    pub(super) fn of_newcomer([radius_m, height_m]: [f64; 2], options: &McmcOptions) -> Self {
        let adult = Size::prior(options);
        let size = adult.updated([radius_m, height_m], 1.0);
        let mut postures = Self { probabilities: [1.0, 0.0, 0.0], sizes: [size; POSTURES] };
        postures.derive_unseen();
        postures
    }

    /// Sets the sizes of postures that were not seen by that of the standing person.
    fn derive_unseen(&mut self) {
        let standing = self.sizes[STANDING];
        for (posture, ratio) in [(SEATED, SEATED_HEIGHT), (CROUCHING, CROUCHING_HEIGHT)] {
            if self.probabilities[posture] < UNSEEN {
                self.sizes[posture] = standing.bent(ratio);
            }
        }
    }

    /// Predicts `dt_s` seconds ahead for a person of this speed, m/s.
    pub(super) fn predict(&mut self, dt_s: f64, speed_m_s: f64, options: &McmcOptions) {
        let most = Size::prior(options);
        self.sizes[STANDING] = self.sizes[STANDING].drifted(dt_s, &most);
        if options.sits_down_per_s > 0.0 {
            let still = (-(speed_m_s / WALKING_M_S).powi(2)).exp();
            let [standing, seated, crouching] = self.probabilities;
            let within = |per_s: f64| -(-per_s * dt_s).exp_m1();
            let sits = standing * within(options.sits_down_per_s * still);
            let crouches = standing * within(options.sits_down_per_s * CROUCHES * still);
            let (rises, gets_up) = (seated * within(RISES_PER_S), crouching * within(GETS_UP_PER_S));
            self.set([
                standing - sits - crouches + rises + gets_up,
                seated + sits - rises,
                crouching + crouches - gets_up,
            ]);
        }
        self.derive_unseen();
    }

    /// Updates posture and sizes by a moment's states; `visible` is the largest fraction that any camera saw.
    pub(super) fn update(&mut self, seen: &PostureShares, visible: f64) {
        let states: f64 = seen.shares.iter().sum();
        if states <= 0.0 {
            return;
        }
        if self.probabilities[STANDING] < 1.0 {
            self.set(seen.shares.map(|share| share / states));
        }
        for (posture, size) in self.sizes.iter_mut().enumerate() {
            let share = seen.shares[posture];
            if share > UNSEEN * states {
                let shown = [seen.radius[posture] / share, seen.height[posture] / share];
                *size = size.updated(shown, visible * share / states);
            }
        }
    }

    /// Sets the probabilities; the possible ones stay possible.
    fn set(&mut self, probabilities: [f64; POSTURES]) {
        let probabilities = probabilities.map(|p| p.max(LEAST));
        let sum: f64 = probabilities.iter().sum();
        self.probabilities = probabilities.map(|p| p / sum);
    }

    /// Prior of the size in the next moment.
    pub(super) fn prior(&self) -> SizePrior {
        SizePrior::new(self.probabilities, self.sizes.map(|size| size.posed()))
    }

    /// Size in the most probable posture.
    pub(super) fn size(&self) -> &Size {
        let best = (0..POSTURES).max_by(|a, b| self.probabilities[*a].total_cmp(&self.probabilities[*b]));
        &self.sizes[best.unwrap_or(STANDING)]
    }

    /// Size of the standing person.
    pub(super) fn stature_mut(&mut self) -> &mut Size {
        &mut self.sizes[STANDING]
    }
}

#[cfg(test)]
mod tests;
