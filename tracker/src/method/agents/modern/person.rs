//! One person as one station knows of them: a body, which is followed, and an identity, which it carries.

use nalgebra::Matrix2;

use super::super::TargetId;
use super::measurement::Measurement;
use super::motion::Motion;
use super::signature::MeanLook;

/// Most people whom a station knows of: one bit each.
pub(super) const MOST_PEOPLE: usize = 64;
/// Weight of learnt looks from which they tell people apart.
pub(super) const LEARNT: f64 = 3.0;

/// What belongs to an id: it moves to another body where two were mistaken for each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Identity {
    /// The person's id.
    pub(super) target: TargetId,
    /// Looks while it was certain who this was.
    pub(super) learnt: MeanLook,
}

/// Somebody in the room. Sets of people are bits by index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Person {
    /// Number of the body, never given again.
    pub(super) serial: u32,
    /// Who it is taken for.
    pub(super) identity: Identity,
    /// Probability of being each person, when the body last met somebody.
    pub(super) prior: [f64; MOST_PEOPLE],
    /// Who it may be: those with a probability.
    pub(super) may_be: u64,
    /// Place and velocity.
    pub(super) motion: Motion,
    /// Height, metres.
    pub(super) height_m: f64,
    /// Looks since it last met somebody, the older the fainter.
    pub(super) evidence: MeanLook,
    /// People who were told from this one in one packet, now.
    pub(super) measured_with: u64,
    /// Time since it last met somebody, seconds.
    pub(super) apart_s: f64,
    /// Time for which its looks have not been those of its identity, seconds.
    pub(super) misfit_s: f64,
    /// Time since it is known, seconds.
    pub(super) age_s: f64,
    /// Time since anybody measured this body, seconds.
    pub(super) missed_s: f64,
    /// Time since this station measured it, seconds.
    pub(super) unseen_s: f64,
    /// Time since another station measured it, seconds.
    pub(super) unheard_s: f64,
    /// Time for which some station should have measured it and none did, seconds.
    pub(super) overdue_s: f64,
    /// Time for which it has been on another's place with one measurement for the two, seconds.
    pub(super) twin_s: f64,
    /// Time for which it has been set aside as one too many, seconds; `None`: it is followed.
    pub(super) spare_s: Option<f64>,
    /// Whether the body was measured inside the room, apart from others.
    pub(super) was_inside: bool,
    /// Whether it was on its way out after that, when it was last measured apart from others.
    pub(super) was_leaving: bool,
    /// Time for which somebody whom this station alone sees seems to be another whom others see, seconds.
    pub(super) contradicted_s: f64,
    /// Time since image tracking was asked to look for it, seconds.
    pub(super) asked_s: f64,
    /// Image track of this station that follows it, seen now or not.
    pub(super) track: Option<u32>,
    /// Number of this station's agent that follows it.
    pub(super) agent: Option<u32>,
    /// Whether it is measured this moment, and only by measurements that may be of somebody near.
    pub(super) is_crowded: bool,
}

impl Person {
    /// Somebody measured for the first time.
    pub(super) fn new(target: TargetId, measurement: &Measurement) -> Self {
        Self {
            serial: 0,
            identity: Identity { target, learnt: MeanLook::none() },
            prior: [0.0; MOST_PEOPLE],
            may_be: 0,
            motion: Motion::new(measurement.position, measurement.velocity, measurement.covariance),
            height_m: measurement.height_m,
            evidence: MeanLook::none(),
            measured_with: 0,
            apart_s: 0.0,
            misfit_s: 0.0,
            age_s: 0.0,
            missed_s: 0.0,
            unseen_s: f64::INFINITY,
            unheard_s: f64::INFINITY,
            overdue_s: 0.0,
            twin_s: 0.0,
            spare_s: None,
            was_inside: false,
            was_leaving: false,
            contradicted_s: 0.0,
            asked_s: f64::INFINITY,
            track: None,
            agent: None,
            is_crowded: measurement.is_crowded,
        }
    }

    /// Lets `dt` seconds pass.
    pub(super) fn predict(&mut self, dt: f64, acceleration: f64, kept: f64) {
        self.motion.predict(dt, acceleration);
        if self.missed_s > 0.3 {
            self.motion.slow_down(dt);
        }
        self.evidence.fade(kept);
        self.measured_with = 0;
        self.age_s += dt;
        self.apart_s += dt;
        self.missed_s += dt;
        self.unseen_s += dt;
        self.unheard_s += dt;
        self.asked_s += dt;
    }

    /// Puts the body to where somebody is measured whom nobody follows.
    pub(super) fn move_to(&mut self, measurement: &Measurement) {
        self.motion = Motion::new(measurement.position, measurement.velocity, measurement.covariance);
        self.evidence = MeanLook::none();
        self.missed_s = 0.0;
        self.overdue_s = 0.0;
        self.twin_s = 0.0;
        self.spare_s = None;
        self.is_crowded = measurement.is_crowded;
    }

    /// Takes a measurement in; its errors last from frame to frame by `inflation` of its covariance. A look of a
    /// measurement that is surely of this body counts as `look_weight` independent ones.
    pub(super) fn take_in(&mut self, measurement: &Measurement, inflation: f64, look_weight: f64) {
        self.motion.update(&measurement.position, &(measurement.covariance * inflation));
        self.height_m += 0.05 * (measurement.height_m - self.height_m);
        if self.missed_s > 0.0 {
            self.is_crowded = true;
        }
        self.is_crowded &= measurement.is_crowded;
        self.missed_s = 0.0;
        self.overdue_s = 0.0;
        if let (Some(signature), false) = (&measurement.signature, measurement.is_crowded) {
            self.evidence.add(signature, look_weight);
            if self.may_be.is_power_of_two() && self.misfit_s == 0.0 {
                self.identity.learnt.add(signature, look_weight);
            }
        }
    }

    /// Whether nobody has measured this body for so long that it may be anywhere near, or it is one too many.
    pub(super) fn is_lost(&self, after_s: f64) -> bool {
        self.missed_s >= after_s || self.spare_s.is_some()
    }

    /// Whether its identity's looks are known well enough to tell people apart.
    pub(super) fn is_learnt(&self) -> bool {
        self.identity.learnt.weight >= LEARNT
    }

    /// Log-likelihood of the looks of this body if it were `identity`.
    pub(super) fn log_likelihood(&self, identity: &Identity) -> f64 {
        if self.evidence.weight < 0.5 || identity.learnt.weight < LEARNT {
            return 0.0;
        }
        self.evidence.log_likelihood(&identity.learnt)
    }

    /// Covariance of the place, m².
    pub(super) fn covariance(&self) -> Matrix2<f64> {
        self.motion.place
    }
}
