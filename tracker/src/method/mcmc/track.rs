//! A track: one person as the sampler carries them from moment to moment.

use nalgebra::{Matrix2, Vector2};

use super::boxes::BoxMeasurement;
use super::evidence::Evidence;
use super::motion::Motion;
use super::options::McmcOptions;
use super::outage::OUTAGE_S;
use super::passage::Passage;
use super::person::{Key, Known, Place};
use super::posture::{Postures, Size};
use super::sighting::Sighting;
use super::tally::Sums;
use super::traits::{LearntTraits, ShownTraits};
use super::vector_places::VectorPlaces;
use crate::TrackId;
use crate::identity::mean_vector::MeanVector;
use crate::silhouette::Body;

/// Bound of the absolute log odds of existence, nats.
const MAX_LOG_ODDS: f64 = 12.0;

/// Visible fraction below which a person is out of sight, for the camera that sees most.
const MIN_VISIBLE: f64 = 0.1;
/// Interval from which on the evidence of successive moments counts as independent, seconds; evidence at shorter
/// intervals is scaled down.
const INDEPENDENT_AFTER_S: f64 = 0.08;
/// Distance from its first place from which on a track found at the start counts as moved, metres; before, it may be
/// furniture.
const MOVED_M: f64 = 0.5;

/// Time for which the cameras have to show an average person before an unmoved track found at the start is confirmed,
/// seconds.
const STANDS_FOR_S: f64 = 2.0;

/// Standard deviation by which people deviate from their prediction, metres (the gate is at three of it), and its
/// growth for each second in which cameras contradict the track, m/s.
const DEVIATION_M: f64 = 0.35;
const DEVIATION_SPEED_M_S: f64 = 1.0;

/// Standard deviation of the place, metres, above which a person who went through a door and is out of sight counts
/// as leaving, and the rate of leaving, 1/s.
const LOST_BEHIND_DOOR_M: f64 = 1.0;
const LEAVES_BEHIND_DOOR_PER_S: f64 = 2.0;
/// A track out of sight ends when its probability of having stayed falls below this.
const MIN_STAYED: f64 = 0.1;

/// A track that a camera with a clear view contradicts for this long may be deleted anywhere, seconds.
const CONTRADICTED_FOR_S: f64 = 3.0;

/// Phase of the stream in which a track was born.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BirthPhase {
    /// At the start of the stream, when the track may be furniture that has always stood there.
    AtStart,
    /// After an outage of all cameras, during which furniture may have been moved.
    AfterOutage,
    /// At any other time.
    Appearing,
}

impl BirthPhase {
    /// Time for which the cameras have to show an average person before an unmoved track is confirmed, seconds.
    fn stands_for_s(self) -> f64 {
        match self {
            Self::AtStart => STANDS_FOR_S,
            Self::AfterOutage | Self::Appearing => 0.0,
        }
    }
}

/// Track of one person.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub(super) key: Key,
    /// Identity, assigned when the track is confirmed.
    pub(super) id: Option<TrackId>,
    pub(super) motion: Motion,
    pub(super) postures: Postures,
    /// Log odds of existence by the cameras' evidence.
    pub(super) log_odds: f64,
    /// Time for which the evidence has spoken against the track, seconds.
    contradicted_s: f64,
    /// Whether the accumulated evidence of a detector's boxes speaks against the track.
    pub(super) is_doubted: bool,
    /// Evidence for the person since birth, beyond what chance explains, nats.
    pub(super) earned_nats: f64,
    /// Whether some camera saw this person at the last moment.
    pub(super) in_sight: bool,
    found: BirthPhase,
    /// Birth place of a track found at the start or after an outage, metres; `None` once it has moved.
    still_at: Option<Vector2<f64>>,
    /// Passage through the exit zones; `None` until the first prediction.
    passage: Option<Passage>,
    /// Probability of not having left since a camera last saw the person.
    stayed: f64,
    /// Time for which the cameras have shown an average person there, seconds; `None` if not at the last moment.
    upright_s: Option<f64>,
    /// Traits that the last moment's boxes showed.
    pub(super) shown: ShownTraits,
    /// Average of these traits.
    pub(super) learnt: LearntTraits,
    /// Whether the track began where people come in.
    pub(super) may_have_come_in: bool,
    /// Place at the last moment whose masks showed the person.
    pub(super) sighting: Option<Sighting>,
}

impl Track {
    /// New track of a person born in this moment.
    pub(super) fn born(sums: &Sums, found: BirthPhase, options: &McmcOptions) -> Self {
        let gait = Matrix2::identity() * options.motion.gait_sigma_m.powi(2);
        Self {
            key: sums.key,
            id: None,
            motion: Motion::appeared(sums.place(), &(sums.covariance() + gait), &options.motion),
            postures: Postures::of_newcomer([sums.radius_m(), sums.height_m()], options),
            log_odds: 0.0,
            contradicted_s: 0.0,
            is_doubted: false,
            earned_nats: 0.0,
            in_sight: true,
            found,
            still_at: (found != BirthPhase::Appearing).then(|| sums.place()),
            passage: None,
            stayed: 1.0,
            upright_s: None,
            shown: ShownTraits::default(),
            learnt: LearntTraits::default(),
            may_have_come_in: true,
            sighting: None,
        }
    }

    /// Predicts motion and size `dt_s` seconds ahead.
    pub(super) fn predict(&mut self, dt_s: f64, options: &McmcOptions) {
        let in_sight = self.in_sight && dt_s < OUTAGE_S;
        self.shown = ShownTraits::default();
        self.motion.predict(dt_s, in_sight, &options.motion);
        self.postures.predict(dt_s, self.motion.belief.velocity().norm(), options);
    }

    /// Records whether any camera sees the person, by the largest visible fraction.
    pub(super) fn see(&mut self, visible: f64) {
        self.in_sight = visible >= MIN_VISIBLE;
    }

    /// Updates motion and size by a moment's states. `visible` is the largest fraction of the person that any camera
    /// saw.
    pub(super) fn update(&mut self, sums: &Sums, visible: f64, options: &McmcOptions) {
        self.see(visible);
        if visible == 0.0 {
            // No camera saw the person, so the states hold no measurement.
            return;
        }
        self.motion.condition(&sums.place(), &sums.covariance(), &options.motion);
        self.postures.update(&sums.postures, visible);
    }

    /// Updates motion and size by the measurement of a detector's boxes.
    pub(super) fn measure(&mut self, shown: &BoxMeasurement, options: &McmcOptions) {
        self.motion.measure(&shown.place, &shown.covariance, &options.motion);
        self.take_size(shown);
    }

    /// Initialises motion and size of a track born in this moment by the measurement of a detector's boxes.
    pub(super) fn appear(&mut self, shown: &BoxMeasurement, options: &McmcOptions) {
        let gait = Matrix2::identity() * options.motion.gait_sigma_m.powi(2);
        self.motion = Motion::appeared(shown.place, &(shown.covariance + gait), &options.motion);
        self.take_size(shown);
    }

    fn take_size(&mut self, shown: &BoxMeasurement) {
        *self.postures.stature_mut() = Size { radius: shown.radius, height: shown.height };
        (self.shown.height, self.shown.radius) = (shown.height_seen, shown.radius_seen);
    }

    /// Adds the vectors of the moment's boxes to the traits it showed, and learns these traits.
    pub(super) fn learn_traits(&mut self, vector: MeanVector) {
        self.shown.vector = vector;
        self.learnt.add(&self.shown);
    }

    /// Multiplies the probability of existence by the probability of not having left unseen.
    pub(super) fn may_have_left(&mut self, probability: f64) {
        let there = self.existence() * (1.0 - probability);
        self.log_odds = (there / (1.0 - there)).ln().clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS);
    }

    /// Updates the probability that a person out of sight has stayed, over `dt_s` seconds. `at_exit`: whether the
    /// person was, and is now predicted to be, in an exit zone.
    pub(super) fn may_leave_unseen(&mut self, at_exit: [bool; 2], dt_s: f64, options: &McmcOptions) {
        let place = self.motion.silhouette_place();
        let [was_at_exit, is_at_exit] = at_exit;
        let passage = self.passage.get_or_insert(Passage::new(place, was_at_exit));
        if self.in_sight {
            passage.follow(place, is_at_exit, dt_s);
        }
        let is_leaving = passage.is_leaving();
        if self.in_sight || options.unseen_leaves_per_s <= 0.0 {
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
        self.stayed < MIN_STAYED
    }

    /// Updates the log odds of existence and the confirmation counters by a moment's evidence.
    pub(super) fn update_existence(&mut self, evidence: &Evidence, dt_s: f64) {
        let new = (dt_s / INDEPENDENT_AFTER_S).min(1.0);
        self.log_odds = (self.log_odds + new * evidence.for_presence()).clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS);
        self.earned_nats += new * evidence.beyond_chance();
        self.contradicted_s = if evidence.is_against() { self.contradicted_s + dt_s } else { 0.0 };
        self.is_doubted = evidence.is_by_boxes && self.log_odds < 0.0;
        self.upright_s = evidence.is_upright.then(|| self.upright_s.map_or(0.0, |since_s| since_s + dt_s));
        let place = self.motion.place();
        self.still_at = self.still_at.filter(|found| (place - found).norm() < MOVED_M);
    }

    /// Whether the evidence suffices to confirm the track as a person.
    pub(super) fn is_confirmable(&self, options: &McmcOptions) -> bool {
        self.earned_nats >= options.believed_at_nats
            && (!self.may_be_furniture() || self.upright_s.is_some_and(|s| s >= self.found.stands_for_s()))
    }

    /// Names the track as a person who was never seen before.
    pub(super) fn name_anew(&mut self, next_id: &mut u32) {
        self.id = Some(TrackId(*next_id));
        *next_id += 1;
    }

    /// Whether the track may be furniture: found at the start or after an outage, and not moved since.
    pub(super) fn may_be_furniture(&self) -> bool {
        self.still_at.is_some()
    }

    /// Whether the track is tentative and may be deleted anywhere: unconfirmed, doubted by boxes, or contradicted for
    /// too long.
    pub(super) fn is_tentative(&self) -> bool {
        self.id.is_none() || self.is_doubted || self.contradicted_s > CONTRADICTED_FOR_S
    }

    /// Exchanges with another track what belongs to the person rather than to the place: id, standing size and traits.
    pub(super) fn exchange_names(&mut self, other: &mut Self) {
        std::mem::swap(&mut self.id, &mut other.id);
        std::mem::swap(self.postures.stature_mut(), other.postures.stature_mut());
        std::mem::swap(&mut self.learnt, &mut other.learnt);
    }

    /// Probability of existence by the cameras' evidence; leaving unseen is part of [`Self::presence`].
    pub(super) fn existence(&self) -> f64 {
        1.0 / (1.0 + (-self.log_odds).exp())
    }

    /// Probability that the person exists and has not left unseen.
    pub(super) fn presence(&self) -> f64 {
        self.existence() * self.stayed
    }

    /// Prior of the person for the next moment.
    pub(super) fn known(&self) -> Known {
        Known {
            place: Place::new(
                self.motion.silhouette_place(),
                &self.motion.silhouette_covariance(),
                self.deviation_m(),
            ),
            size: self.postures.prior(),
            log_odds: self.log_odds,
            fit: None,
            vectors: VectorPlaces::default(),
        }
    }

    /// Standard deviation of deviations from the prediction, metres; it grows while cameras contradict the track.
    fn deviation_m(&self) -> f64 {
        DEVIATION_M + DEVIATION_SPEED_M_S * self.contradicted_s
    }

    /// Most probable body at the place of its silhouette.
    pub(super) fn body(&self) -> Body {
        let (place, size) = (self.motion.silhouette_place(), self.postures.size());
        Body { x_m: place.x, y_m: place.y, radius_m: size.radius.mean_m, height_m: size.height.mean_m }
    }
}
