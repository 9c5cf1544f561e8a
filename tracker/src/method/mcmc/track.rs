//! A person over time, as the sampler carries them from moment to moment.

use nalgebra::{Matrix2, Vector2};

use super::boxes::Shown;
use super::evidence::Evidence;
use super::motion::Motion;
use super::options::{McmcOptions, Spread};
use super::outage::OUTAGE_S;
use super::passage::Passage;
use super::person::{Key, Known, Place};
use super::tally::Sums;
use crate::TrackId;
use crate::silhouette::Body;

/// A silhouette seen in full says this much about its person's radius and height, in metres (one standard deviation):
/// gait and the mask's own errors go on from moment to moment.
const RADIUS_SEEN_SIGMA_M: f64 = 0.10;
const HEIGHT_SEEN_SIGMA_M: f64 = 0.20;
/// What is believed of a person's size fades by this much in a second.
const RADIUS_DRIFT_M: f64 = 0.005;
const HEIGHT_DRIFT_M: f64 = 0.005;
/// Around what a person measures, a single moment's body varies by this: strides, swinging arms, a bent back.
const RADIUS_POSE_SIGMA_M: f64 = 0.025;
const HEIGHT_POSE_SIGMA_M: f64 = 0.02;

/// Nobody is surer to be there, or not, than this.
const SUREST_NATS: f64 = 12.0;

/// Somebody of whom no camera sees this part is out of sight.
const IN_SIGHT: f64 = 0.1;
/// Moments that follow each other faster say the same.
const INDEPENDENT_AFTER_S: f64 = 0.08;
/// What was there at the beginning and has never been farther than this from its place may be anything.
const MOVED_M: f64 = 0.5;

/// A track found at the start whose person has not moved is believed once the cameras have shown a person for so long, seconds.
const STANDS_FOR_S: f64 = 2.0;

/// How far from their prediction people are at most (a third of it, metres), and how much farther for every second in which they
/// are not where they are believed to be.
const ASTRAY_M: f64 = 0.35;
const ASTRAY_SPEED_M_S: f64 = 1.0;

/// Somebody who went through a door and is out of sight has left once the uncertainty of the place passes this, metres (one
/// standard deviation), at this rate per second.
const LOST_BEHIND_DOOR_M: f64 = 1.0;
const LEAVES_BEHIND_DOOR_PER_S: f64 = 2.0;
/// Somebody out of sight who has stayed with a smaller probability is not followed any more.
const GONE: f64 = 0.1;

/// Somebody who for this long is not where a camera sees clearly was never there.
const CONTRADICTED_FOR_S: f64 = 3.0;

/// When somebody was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Found {
    /// At the start: what has always stood there may be anything.
    AtStart,
    /// After an outage of all cameras: what was put there meanwhile may be furniture.
    AfterOutage,
    /// In between.
    Appearing,
}

impl Found {
    /// Seconds for which cameras have to show an average person before one is believed in who has not moved.
    fn stands_for_s(self) -> f64 {
        match self {
            Self::AtStart => STANDS_FOR_S,
            Self::AfterOutage | Self::Appearing => 0.0,
        }
    }
}

/// A person the sampler follows.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub(super) key: Key,
    /// Given once the person is believed in.
    pub(super) id: Option<TrackId>,
    pub(super) motion: Motion,
    pub(super) radius: Spread,
    pub(super) height: Spread,
    /// Log odds of being there.
    pub(super) log_odds: f64,
    /// For how long a camera that should see this person has not.
    contradicted_s: f64,
    /// Whether a detector's boxes speak against this person, all in all.
    pub(super) is_doubted: bool,
    /// What has spoken for this person since birth, beyond what chance explains, nats.
    pub(super) earned_nats: f64,
    /// Whether some camera saw this person at the last moment.
    pub(super) in_sight: bool,
    found: Found,
    /// Where somebody was found who did not appear before the cameras' eyes, until they move.
    still_at: Option<Vector2<f64>>,
    /// Way through the zones of people who leave; `None` until the first prediction.
    passage: Option<Passage>,
    /// Probability of not having left since a camera last saw the person.
    stayed: f64,
    /// Seconds for which the cameras have shown an average person there; `None` when they did not at the last moment.
    upright_s: Option<f64>,
}

impl Track {
    /// Somebody born in this moment.
    pub(super) fn born(sums: &Sums, found: Found, options: &McmcOptions) -> Self {
        let gait = Matrix2::identity() * options.motion.gait_sigma_m.powi(2);
        let mut track = Self {
            key: sums.key,
            id: None,
            motion: Motion::appeared(sums.place(), &(sums.covariance() + gait), &options.motion),
            radius: options.radius,
            height: options.height,
            log_odds: 0.0,
            contradicted_s: 0.0,
            is_doubted: false,
            earned_nats: 0.0,
            in_sight: true,
            found,
            still_at: (found != Found::Appearing).then(|| sums.place()),
            passage: None,
            stayed: 1.0,
            upright_s: None,
        };
        track.resize(sums, 1.0);
        track
    }

    /// Carries the belief on in time.
    pub(super) fn predict(&mut self, dt_s: f64, options: &McmcOptions) {
        let in_sight = self.in_sight && dt_s < OUTAGE_S;
        self.motion.predict(dt_s, in_sight, &options.motion);
        let drifted = |s: &Spread, drift: f64, most: f64| Spread {
            sigma_m: (s.sigma_m.powi(2) + drift.powi(2) * dt_s).sqrt().min(most),
            ..*s
        };
        self.radius = drifted(&self.radius, RADIUS_DRIFT_M, options.radius.sigma_m);
        self.height = drifted(&self.height, HEIGHT_DRIFT_M, options.height.sigma_m);
    }

    /// Takes in the largest fraction of the person that any camera saw.
    pub(super) fn see(&mut self, visible: f64) {
        self.in_sight = visible >= IN_SIGHT;
    }

    /// Takes in a moment's states. `visible` is the largest fraction of the person that any camera saw.
    pub(super) fn update(&mut self, sums: &Sums, visible: f64, options: &McmcOptions) {
        self.see(visible);
        if visible == 0.0 {
            // Nobody looked: whatever the chain did, it was not for what it saw.
            return;
        }
        self.motion.condition(&sums.place(), &sums.covariance(), &options.motion);
        self.resize(sums, visible);
    }

    /// Takes in where a detector's boxes show the person, and how large.
    pub(super) fn measure(&mut self, shown: &Shown, options: &McmcOptions) {
        self.motion.measure(&shown.place, &shown.covariance, &options.motion);
        (self.radius, self.height) = (shown.radius, shown.height);
    }

    /// The same for somebody who was born in this moment.
    pub(super) fn appear(&mut self, shown: &Shown, options: &McmcOptions) {
        let gait = Matrix2::identity() * options.motion.gait_sigma_m.powi(2);
        self.motion = Motion::appeared(shown.place, &(shown.covariance + gait), &options.motion);
        (self.radius, self.height) = (shown.radius, shown.height);
    }

    fn resize(&mut self, sums: &Sums, visible: f64) {
        let seen = |s: &Spread, seen_m: f64, sigma_m: f64| {
            let gain = visible * s.sigma_m.powi(2) / (s.sigma_m.powi(2) + sigma_m.powi(2));
            Spread { mean_m: s.mean_m + gain * (seen_m - s.mean_m), sigma_m: s.sigma_m * (1.0 - gain).sqrt() }
        };
        self.radius = seen(&self.radius, sums.radius_m(), RADIUS_SEEN_SIGMA_M);
        self.height = seen(&self.height, sums.height_m(), HEIGHT_SEEN_SIGMA_M);
    }

    /// Takes in that the person may have left unseen, with this probability.
    pub(super) fn may_have_left(&mut self, probability: f64) {
        let there = self.existence() * (1.0 - probability);
        self.log_odds = (there / (1.0 - there)).ln().clamp(-SUREST_NATS, SUREST_NATS);
    }

    /// Takes in that a person out of sight may have left unseen in `dt_s` seconds. `at_exit`: whether the person was, and is now
    /// predicted to be, in a zone of people who leave.
    pub(super) fn may_leave_unseen(&mut self, at_exit: [bool; 2], dt_s: f64, options: &McmcOptions) {
        let place = self.motion.silhouette_place();
        let [was_at_exit, is_at_exit] = at_exit;
        let passage = self.passage.get_or_insert(Passage::new(place, was_at_exit));
        if self.in_sight {
            passage.follow(place, is_at_exit, dt_s);
        }
        let is_leaving = passage.is_leaving();
        if self.in_sight {
            self.stayed = 1.0;
            return;
        }
        let largest_m2 = self.motion.silhouette_covariance().symmetric_eigenvalues().max();
        let is_lost = is_leaving && largest_m2 > LOST_BEHIND_DOOR_M.powi(2);
        let per_s = if is_lost { LEAVES_BEHIND_DOOR_PER_S } else { options.unseen_leaves_per_s };
        self.stayed *= (-per_s * dt_s).exp();
    }

    /// Whether the person is out of sight and has probably left.
    pub(super) fn is_gone(&self) -> bool {
        self.stayed < GONE
    }

    /// Takes in a moment's evidence about whether this person is there at all.
    pub(super) fn weigh(&mut self, evidence: &Evidence, dt_s: f64) {
        let new = (dt_s / INDEPENDENT_AFTER_S).min(1.0);
        self.log_odds = (self.log_odds + new * evidence.for_presence()).clamp(-SUREST_NATS, SUREST_NATS);
        self.earned_nats += new * evidence.beyond_chance();
        self.contradicted_s = if evidence.is_against() { self.contradicted_s + dt_s } else { 0.0 };
        self.is_doubted = evidence.is_by_boxes && self.log_odds < 0.0;
        self.upright_s = evidence.is_upright.then(|| self.upright_s.map_or(0.0, |since_s| since_s + dt_s));
        let place = self.motion.place();
        self.still_at = self.still_at.filter(|found| (place - found).norm() < MOVED_M);
    }

    /// Whether there is reason enough to believe that this is a person.
    pub(super) fn is_believable(&self, options: &McmcOptions) -> bool {
        self.earned_nats >= options.believed_at_nats
            && (!self.may_be_furniture() || self.upright_s.is_some_and(|s| s >= self.found.stands_for_s()))
    }

    /// Whether this may be what was there before the cameras looked, for all that its motion says.
    pub(super) fn may_be_furniture(&self) -> bool {
        self.still_at.is_some()
    }

    /// Whether this person may be a mistake: not believed in yet, or for long not where cameras see clearly.
    pub(super) fn is_tentative(&self) -> bool {
        self.id.is_none() || self.is_doubted || self.contradicted_s > CONTRADICTED_FOR_S
    }

    /// The one goes on as the other: what belongs to a person and not to a place changes sides.
    pub(super) fn exchange_names(&mut self, other: &mut Self) {
        std::mem::swap(&mut self.id, &mut other.id);
        std::mem::swap(&mut self.radius, &mut other.radius);
        std::mem::swap(&mut self.height, &mut other.height);
    }

    /// Probability of being there, by the cameras' evidence; what may happen out of sight has its own ([`Self::presence`]).
    pub(super) fn existence(&self) -> f64 {
        1.0 / (1.0 + (-self.log_odds).exp())
    }

    /// Probability of being in the room.
    pub(super) fn presence(&self) -> f64 {
        self.existence() * self.stayed
    }

    /// What is known before the next moment is looked at.
    pub(super) fn known(&self) -> Known {
        Known {
            place: Place::new(
                self.motion.silhouette_place(),
                &self.motion.silhouette_covariance(),
                self.astray_m(),
            ),
            radius: posed(&self.radius, RADIUS_POSE_SIGMA_M),
            height: posed(&self.height, HEIGHT_POSE_SIGMA_M),
            log_odds: self.log_odds,
            fit: None,
        }
    }

    /// How far from the prediction they may be: farther the longer cameras contradict it.
    fn astray_m(&self) -> f64 {
        ASTRAY_M + ASTRAY_SPEED_M_S * self.contradicted_s
    }

    /// The most probable body, as it is seen.
    pub(super) fn body(&self) -> Body {
        let place = self.motion.silhouette_place();
        Body { x_m: place.x, y_m: place.y, radius_m: self.radius.mean_m, height_m: self.height.mean_m }
    }
}

/// What a single moment may show of a size that is known this well.
fn posed(size: &Spread, pose_sigma_m: f64) -> Spread {
    Spread { sigma_m: size.sigma_m.hypot(pose_sigma_m), ..*size }
}
