//! State of one person at one station: a body, which is tracked, and the identity that it carries.

use nalgebra::Matrix2;

use super::super::TargetId;
use super::measurement::Measurement;
use super::motion::Motion;
use super::signature::MeanLook;

/// Maximum number of people of a station: one bit each.
pub(super) const MOST_PEOPLE: usize = 64;
/// Weight from which learnt looks say by themselves that a newcomer is or is not this person.
pub(super) const LEARNT: f64 = 10.0;
/// Weight from which learnt looks are compared with those of others after a meeting: there the two alternatives share
/// most of their errors.
const COMPARABLE: f64 = 3.0;

/// Id and learnt looks of a person; they move to another body when two were swapped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Identity {
    /// The person's id.
    pub(super) target: TargetId,
    /// Looks measured while the identity was certain.
    pub(super) learnt: MeanLook,
}

/// Person in the room. Sets of people are bits by index.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Person {
    /// Number of the body; not reused.
    pub(super) serial: u32,
    /// Current identity.
    pub(super) identity: Identity,
    /// Probability of each identity at the body's last meeting.
    pub(super) prior: [f64; MOST_PEOPLE],
    /// Set of the possible identities.
    pub(super) may_be: u64,
    /// Place and velocity.
    pub(super) motion: Motion,
    /// Height, metres.
    pub(super) height_m: f64,
    /// Looks since the last meeting, with weights that decay with age.
    pub(super) evidence: MeanLook,
    /// Set of the people who were measured together with this one by one sender at this moment.
    pub(super) measured_with: u64,
    /// Time since the last meeting, seconds.
    pub(super) apart_s: f64,
    /// Time for which the looks have contradicted the identity, seconds.
    pub(super) misfit_s: f64,
    /// Time since the birth, seconds.
    pub(super) age_s: f64,
    /// Time since any station measured the body, seconds.
    pub(super) missed_s: f64,
    /// Time since this station measured the body, seconds.
    pub(super) unseen_s: f64,
    /// Time since another station measured the body, seconds.
    pub(super) unheard_s: f64,
    /// Time for which a station should have measured the body and none did, seconds.
    pub(super) overdue_s: f64,
    /// Time for which the body and another at the same place have shared one measurement, seconds.
    pub(super) twin_s: f64,
    /// Time since the body was set aside as a duplicate, seconds; `None` for a tracked body.
    pub(super) spare_s: Option<f64>,
    /// Whether the body was measured inside the room, apart from others.
    pub(super) was_inside: bool,
    /// Whether the body was on its way out after that, when last measured apart from others.
    pub(super) was_leaving: bool,
    /// Time for which other stations' measurements have contradicted this station's image track, seconds.
    pub(super) contradicted_s: f64,
    /// Time since image tracking was asked to propose a birth here, seconds.
    pub(super) asked_s: f64,
    /// Image track of this station that follows the body, measured now or not.
    pub(super) track: Option<u32>,
    /// Number of this station's agent for the body.
    pub(super) agent: Option<u32>,
    /// Whether all measurements of the latest measured moment may be of another person nearby.
    pub(super) is_crowded: bool,
}

impl Person {
    /// Creates a person from the first measurement.
    pub(super) fn new(target: TargetId, measurement: &Measurement) -> Self {
        Self {
            serial: 0,
            identity: Identity { target, learnt: MeanLook::none() },
            prior: [0.0; MOST_PEOPLE],
            may_be: 0,
            motion: Motion::first(measurement.position, measurement.velocity, measurement.covariance),
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

    /// Predicts the person `dt` seconds ahead. `acceleration` is its standard deviation, m/s²; `kept` is the factor of
    /// the weight of evidence.
    pub(super) fn predict(&mut self, dt: f64, acceleration: f64, kept: f64) {
        self.motion.walk(dt, acceleration);
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

    /// Restarts the body from an unassociated measurement.
    pub(super) fn move_to(&mut self, measurement: &Measurement) {
        self.motion = Motion::first(measurement.position, measurement.velocity, measurement.covariance);
        self.evidence = MeanLook::none();
        self.missed_s = 0.0;
        self.overdue_s = 0.0;
        self.twin_s = 0.0;
        self.spare_s = None;
        self.is_crowded = measurement.is_crowded;
    }

    /// Updates the person with a measurement. `inflation` multiplies its covariance, because errors are correlated from
    /// frame to frame; the look of an uncrowded measurement counts as `look_weight` independent ones.
    pub(super) fn update(&mut self, measurement: &Measurement, inflation: f64, look_weight: f64) {
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

    /// Whether the body has not been measured for `after_s` seconds or is set aside as a duplicate.
    pub(super) fn is_lost(&self, after_s: f64) -> bool {
        self.missed_s >= after_s || self.spare_s.is_some()
    }

    /// Whether the identity's learnt looks suffice to discriminate people.
    pub(super) fn is_learnt(&self) -> bool {
        self.identity.learnt.weight >= LEARNT
    }

    /// Whether the identity's learnt looks may be compared with those of others.
    pub(super) fn is_comparable(&self) -> bool {
        self.identity.learnt.weight >= COMPARABLE
    }

    /// Log-likelihood of this body's looks under `identity`, nats; 0 when either has too few looks.
    pub(super) fn log_likelihood(&self, identity: &Identity) -> f64 {
        if self.evidence.weight < 0.5 || identity.learnt.weight < COMPARABLE {
            return 0.0;
        }
        self.evidence.log_likelihood(&identity.learnt)
    }

    /// Covariance of the place, m².
    pub(super) fn covariance(&self) -> Matrix2<f64> {
        self.motion.position_covariance
    }
}
