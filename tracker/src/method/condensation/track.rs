//! Track of one person: a filter that is updated over time, also without detections, and deleted in the end.

use nalgebra::{Vector2, Vector3};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use super::exclusion::HeadDistribution;
use super::filter::HeadFilter;
use super::options::{CondensationOptions, HeadMotionOptions};
use super::shoulder;
use super::step_times::StepTimes;
use super::weight::{ExpectedHead, WeighingInput};
use crate::TrackId;

/// Largest walking speed, m/s.
const FASTEST_M_S: f64 = 3.0;
/// Time constant of the velocity estimate, seconds: the position itself is uncertain by centimetres.
const LEARNT_IN_S: f64 = 0.35;
/// Standard deviation of a new head's position, metres.
const FOUND_SIGMA_M: f64 = 0.05;
/// Interval between tests for a track on a shoulder, seconds.
const LOOKS_UP_EVERY_S: f64 = 0.25;

/// Divisor of the number of hypotheses from the second layer on: they fill at most an eighth of the volume.
const CLOSER: usize = 2;

/// Track of a person.
#[derive(Debug, Clone)]
pub(super) struct HeadTrack {
    /// Id; given when the track is confirmed.
    pub(super) id: Option<TrackId>,
    /// Hypotheses of the head's position.
    pub(super) filter: HeadFilter,
    /// Mean and covariance of the filter.
    pub(super) gaussian: HeadDistribution,
    /// Velocity on the floor, m/s.
    pub(super) velocity: Vector2<f64>,
    /// Total time for which two cameras have seen the person, seconds.
    pub(super) seen_s: f64,
    /// Time since they last did, seconds.
    pub(super) unseen_s: f64,
    /// Time for which the track has been at another track's place, seconds.
    pub(super) doubled_s: f64,
    /// Agreement of the cameras lately, 0 to 1.
    pub(super) trust: f32,
    /// Time since the last test for a head above, seconds.
    looked_up_s: f64,
    /// Whether that test found a head.
    seems_shoulder: bool,
    /// N.
    hypotheses: usize,
    sigma_m: Vector3<f64>,
    expected: Vector3<f64>,
    rng: Pcg64Mcg,
}

impl HeadTrack {
    /// New track of a head that was found. `key` makes its random numbers independent of other tracks.
    pub(super) fn born(found: &ExpectedHead, key: u64, options: &CondensationOptions) -> Self {
        // Multiplied by the golden ratio, so that neighbouring seeds and keys share no stream.
        let mut rng = Pcg64Mcg::seed_from_u64(options.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ key);
        let sigma = Vector3::repeat(FOUND_SIGMA_M);
        let filter = HeadFilter::around(&found.head, &sigma, options.hypotheses, &mut rng);
        Self {
            id: None,
            gaussian: filter.gaussian(),
            filter,
            velocity: Vector2::zeros(),
            seen_s: 0.0,
            unseen_s: 0.0,
            doubled_s: 0.0,
            trust: found.trust,
            looked_up_s: 0.0,
            seems_shoulder: false,
            hypotheses: options.hypotheses,
            sigma_m: sigma,
            expected: found.head,
            rng,
        }
    }

    /// Predicts the hypotheses.
    pub(super) fn predict(&mut self, dt_s: f64, motion: &HeadMotionOptions, times: &mut StepTimes) {
        times.hypotheses.start();
        self.velocity *= if motion.memory_s > 0.0 { (-dt_s / motion.memory_s).exp() } else { 0.0 };
        let drift = self.velocity.push(0.0) * dt_s;
        let sideways = motion.step_m + motion.speed_m_s * dt_s;
        self.sigma_m =
            Vector3::new(sideways, sideways, 0.5 * motion.step_m + motion.vertical_speed_m_s * dt_s);
        self.filter.predict(self.hypotheses, &drift, &self.sigma_m, &mut self.rng);
        self.expected = self.gaussian.mean + drift;
        times.hypotheses.stop();
    }

    /// Weighs the hypotheses; from the second layer on, they are first resampled with a smaller spread.
    pub(super) fn weigh(&mut self, layer: usize, input: &WeighingInput<'_>, times: &mut StepTimes) {
        if layer > 0 {
            times.hypotheses.start();
            let sigma = self.sigma_m * 0.5_f64.powi(layer as i32);
            self.filter.redraw(self.hypotheses.div_ceil(CLOSER), &sigma, &mut self.rng);
            times.hypotheses.stop();
        }
        self.filter.weigh(input, times);
    }

    /// Updates the track or, when two cameras did not see the head, keeps the predicted hypotheses: they spread until
    /// it is seen again.
    pub(super) fn update(&mut self, dt_s: f64, input: &WeighingInput<'_>, options: &CondensationOptions) {
        let motion = &options.motion;
        let support = self.filter.support(self.trust, input);
        let is_seen = support.is_seen(options.life.seen_at) && self.filter.weights.iter().any(|w| *w > 0.0);
        let agreed = if is_seen { support.all } else { 0.0 };
        self.trust += (agreed - self.trust) * -(-dt_s / options.life.trusted_in_s).exp_m1() as f32;
        if !is_seen {
            self.filter.keep_prediction();
            self.gaussian = self.filter.gaussian();
            self.unseen_s += dt_s;
            return;
        }
        self.gaussian = self.filter.gaussian();
        self.seen_s += dt_s;
        self.unseen_s = 0.0;
        if motion.memory_s > 0.0 {
            let surprise = (self.gaussian.mean - self.expected).xy() / dt_s;
            self.velocity += surprise * -(-dt_s / LEARNT_IN_S).exp_m1();
            self.velocity = self.velocity.cap_magnitude(FASTEST_M_S);
        }
    }

    /// Moves a track to the head above it when two tests in a row find that it follows a shoulder.
    pub(super) fn check_for_shoulder(&mut self, dt_s: f64, input: &WeighingInput<'_>, highest_m: f64) {
        self.looked_up_s += dt_s;
        if self.unseen_s > 0.0 || (self.looked_up_s < LOOKS_UP_EVERY_S && !self.seems_shoulder) {
            return;
        }
        self.looked_up_s = 0.0;
        let support = self.filter.support(self.trust, input);
        let above =
            shoulder::head_above(&self.head(), &support, input, &mut self.rng).filter(|(head, its)| {
                its.all >= shoulder::AS_GOOD * support.all && !its.is_doubtful() && head.z <= highest_m
            });
        if let Some((head, _)) = above.filter(|_| self.seems_shoulder) {
            self.filter.restart(&head, &Vector3::repeat(FOUND_SIGMA_M), &mut self.rng);
            self.gaussian = self.filter.gaussian();
        }
        self.seems_shoulder = above.is_some() && !self.seems_shoulder;
    }

    /// Estimated centre of the head, metres.
    pub(super) fn head(&self) -> Vector3<f64> {
        self.gaussian.mean
    }
}
