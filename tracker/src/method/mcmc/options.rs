//! Options of the sampler, with the reason for each default. "Published" refers to the paper cited in [`super`].

use serde::{Deserialize, Serialize};

use crate::likelihood::{LikelihoodRule, Simulation};
use crate::silhouette::Body;
use crate::{Error, Result};

/// Rule by which a proposed state is accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acceptance {
    /// As published: `min(1, L_new / L_old)`. The only priors are E and R, and the proposal ratio is left out.
    Published,
    /// Green's reversible jump: the posterior ratio (likelihood, motion, size, birth and death) times the proposal ratio.
    ReversibleJump,
}

/// Normal distribution over a length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Mean, metres.
    pub mean_m: f64,
    /// Standard deviation, metres.
    pub sigma_m: f64,
}

/// Relative frequencies of the moves; only their proportions matter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MoveWeights {
    /// ADD: adds a person.
    pub add: f64,
    /// DELETE: removes a person.
    pub delete: f64,
    /// UPDATE-P: changes a person's place.
    pub position: f64,
    /// UPDATE-S: changes a person's size.
    pub size: f64,
}

impl Default for MoveWeights {
    /// Most steps refine the places and sizes of people; births and deaths are rare, and a data-driven ADD needs few
    /// attempts.
    fn default() -> Self {
        Self { add: 0.06, delete: 0.06, position: 0.66, size: 0.22 }
    }
}

/// Options of the motion model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionOptions {
    /// Spectral density of the acceleration, m²/s³: how suddenly the velocity changes. At 1.5 a walker can turn a
    /// corner (1.2 m/s to the side) within half a second at two standard deviations.
    pub acceleration_density: f64,
    /// Memory time of the velocity of a person in sight, seconds. Infinite: constant velocity, as published (equation
    /// 1).
    pub velocity_memory_s: f64,
    /// Memory time of the velocity of a person out of sight, seconds: the person walks on for about this long, since
    /// they may have stopped there.
    pub unseen_velocity_memory_s: f64,
    /// Standard deviation of the velocity of a person who has just appeared, m/s: people come in walking.
    pub initial_speed_sigma: f64,
    /// Standard deviation of the silhouette's place around that of the person, beyond the sampler's own, metres:
    /// swinging arms and legs move the silhouette.
    pub gait_sigma_m: f64,
    /// Lead of a walker's silhouette over the person's place per unit of velocity, seconds: a trunk that leans
    /// forward by five degrees, as walkers' do, brings the middle of the silhouette 3 cm ahead of the pelvis at 1.2
    /// m/s.
    pub lean_s: f64,
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self {
            acceleration_density: 1.5,
            velocity_memory_s: 8.0,
            unseen_velocity_memory_s: 1.5,
            initial_speed_sigma: 1.2,
            gait_sigma_m: 0.08,
            lean_s: 0.025,
        }
    }
}

/// Options for moments in which a detector's boxes are the only observations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoxOptions {
    /// Whether boxes are the only observations of the whole stream. Then more people can be followed than masks can
    /// count.
    pub alone: bool,
    /// Least number of burn-in steps of a moment, for each person and each place proposed by boxes.
    pub burn_in_per_person: u32,
    /// Least number of kept steps of a moment, for each person and each place proposed by boxes.
    pub kept_per_person: u32,
    /// Least distance of a person born in this moment from everybody else, metres: boxes distinguish people this
    /// close.
    pub apart_m: f64,
    /// Factor of `log R`: two people 10 cm apart are rare, one person tracked twice is not.
    pub repulsion_weight: f64,
}

impl Default for BoxOptions {
    fn default() -> Self {
        Self {
            alone: false,
            burn_in_per_person: 25,
            kept_per_person: 50,
            apart_m: 0.3,
            repulsion_weight: 4.0,
        }
    }
}

/// The options of [`super::Mcmc`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct McmcOptions {
    /// Seed of the random number generator; the same seed gives the same bytes.
    pub seed: u64,
    /// B: burn-in steps of a moment, which are discarded (published: 100).
    pub burn_in_steps: u32,
    /// N: kept steps of a moment, whose mean is the estimate (published: 100).
    pub kept_steps: u32,
    /// Least number of burn-in and of kept steps for each person: a chain that changes one person a step needs steps
    /// for every one (published: 0).
    pub steps_per_person: u32,
    /// Longest time step for which these numbers of steps are made, seconds; longer time steps get proportionally
    /// more, because people may have moved farther (published: infinite).
    pub steps_for_s: f64,
    /// Factor of the steps in a moment in which the predicted people leave foreground unexplained (published: 1).
    pub surprise: f64,
    /// Relative frequencies of the moves.
    pub moves: MoveWeights,
    /// Options for moments with boxes and no masks.
    pub boxes: BoxOptions,
    /// Likelihood of masks, V(S).
    pub likelihood: LikelihoodRule,
    /// Rule by which a proposal is accepted.
    pub acceptance: Acceptance,
    /// λ of the repulsion R(S), 1/m.
    pub repulsion_per_m: f64,
    /// Prior of the radii of people's ellipsoids: arms and gait included, half of a shoulder width of 0.5 m.
    pub radius: Spread,
    /// Prior of people's heights, shoes included.
    pub height: Spread,
    /// Standard deviation of a step of UPDATE-P, metres. A mixture of a third, one and three times this is used.
    pub position_step_m: f64,
    /// Standard deviation of a step of UPDATE-S in radius, metres.
    pub radius_step_m: f64,
    /// Standard deviation of a step of UPDATE-S in height, metres.
    pub height_step_m: f64,
    /// Options of the motion model.
    pub motion: MotionOptions,
    /// Rate of births over all zones together, 1/s.
    pub births_per_s: f64,
    /// Rate at which one person in sight turns out to be two, 1/s: a second person came in beside or behind them. The
    /// second person may be born outside zones (published: 0).
    pub companions_per_s: f64,
    /// Rate at which a person is born outside the zones, per second in which the cameras persistently show one whom
    /// no track explains (published: 0).
    pub rescues_per_s: f64,
    /// Foreground that a new person has to explain beyond chance, as a fraction of a typical silhouette in one
    /// camera. Shadows, swinging limbs and reflections leave pieces of unexplained foreground that are no people.
    pub birth_evidence: f64,
    /// Rate at which a person in an exit zone leaves, 1/s.
    pub deaths_per_s: f64,
    /// Rate at which a person whom no camera sees leaves the room unseen, 1/s (published: 0). It is low because
    /// hidden people usually come out again.
    pub unseen_leaves_per_s: f64,
    /// Rate at which a person who stands still sits down, 1/s (published: 0, people stand).
    pub sits_down_per_s: f64,
    /// Fraction of ADD's proposals drawn where unexplained foreground is; the rest is uniform over the zones
    /// (published: 0).
    pub informed_births: f64,
    /// Time for which people may be born anywhere, seconds, from the first moment with a mask and from the first one
    /// after an outage of all cameras of two seconds or more, since they may have been inside already (published: 0).
    pub settling_s: f64,
    /// Evidence at which a new person is confirmed, nats beyond chance: the person gets an id, is reported, and can
    /// no longer be deleted outside zones. One moment contributes at most 4, so this sets the number of moments
    /// needed.
    pub believed_at_nats: f64,
    /// Lag of the smoother, seconds: estimates of a moment are reported after this time, corrected by the following
    /// moments, and include the people confirmed meanwhile (published: 0).
    pub lag_s: f64,
    /// Largest number of people at one time, up to [`Simulation::MAX_BODIES`], by boxes alone up to
    /// [`Self::MOST_BY_BOXES`]; further people are not tracked.
    pub max_people: usize,
}

impl Default for McmcOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            burn_in_steps: 100,
            kept_steps: 100,
            steps_per_person: 33,
            steps_for_s: 1.0 / 12.0,
            surprise: 4.0,
            moves: MoveWeights::default(),
            boxes: BoxOptions::default(),
            likelihood: LikelihoodRule::Bernoulli {
                core: 0.91,
                limbs: 0.57,
                reach: 0.2,
                outside: 0.02,
                independent_pixels: 30.0,
            },
            acceptance: Acceptance::ReversibleJump,
            repulsion_per_m: 6.0,
            radius: Spread { mean_m: Body::ADULT.radius_m, sigma_m: 0.05 },
            height: Spread { mean_m: Body::ADULT.height_m, sigma_m: 0.10 },
            position_step_m: 0.05,
            radius_step_m: 0.015,
            height_step_m: 0.03,
            motion: MotionOptions::default(),
            births_per_s: 0.05,
            companions_per_s: 0.02,
            rescues_per_s: 0.05,
            birth_evidence: 0.2,
            deaths_per_s: 0.5,
            unseen_leaves_per_s: 1.0 / 600.0,
            sits_down_per_s: 0.0,
            informed_births: 0.8,
            settling_s: 0.5,
            believed_at_nats: 8.0,
            lag_s: 0.4,
            max_people: 24,
        }
    }
}

impl McmcOptions {
    /// A person of average size, at the origin.
    pub(super) fn average_body(&self) -> Body {
        Body { x_m: 0.0, y_m: 0.0, radius_m: self.radius.mean_m, height_m: self.height.mean_m }
    }

    /// Options for a detector's boxes alone.
    ///
    /// Boxes show a person's middle, whose velocity is steadier than that of a silhouette, and they need no distance
    /// between people. The memory of the velocity covers several steps at two moments a second as well as at thirty.
    /// Within the lag, exchanged tracks and ids are recognised, and it is seen who had come in or left.
    /// Chosen on generated crowds of 10 and 15 people, and on wildtrack, which was looked at meanwhile.
    #[must_use]
    pub fn of_boxes() -> Self {
        Self {
            motion: MotionOptions {
                initial_speed_sigma: 0.8,
                acceleration_density: 0.16,
                velocity_memory_s: 3.0,
                gait_sigma_m: 0.03,
                lean_s: 0.0,
                ..MotionOptions::default()
            },
            boxes: BoxOptions { alone: true, ..BoxOptions::default() },
            sits_down_per_s: 0.0,
            lag_s: 10.0,
            max_people: Self::MOST_BY_BOXES,
            ..Self::default()
        }
    }

    /// Rate at which people who stand still sit down where postures are followed, 1/s: every two minutes.
    pub const SITS_DOWN_PER_S: f64 = 1.0 / 120.0;

    /// Largest number of people that are tracked by boxes alone.
    pub const MOST_BY_BOXES: usize = 255;

    /// Options of the published sampler, for comparison: overlap ratio, no prior, no proposal ratio, births uniform
    /// over the zones and nowhere else, UPDATE-P by normal steps alone, constant velocity.
    ///
    /// Details that the paper does not specify stay as in the defaults: identities (a person deleted and added again
    /// in one moment keeps the identity; ids are exchanged back by appearance after an encounter), the confirmation
    /// of tracks, and the step from equation 9's mean over states with different people to the next moment's S and V
    /// (person by person, as a measurement of a belief with covariance).
    #[must_use]
    pub fn published() -> Self {
        Self {
            likelihood: LikelihoodRule::Overlap { exponent: 1.0 },
            acceptance: Acceptance::Published,
            steps_per_person: 0,
            steps_for_s: f64::INFINITY,
            surprise: 1.0,
            informed_births: 0.0,
            companions_per_s: 0.0,
            rescues_per_s: 0.0,
            unseen_leaves_per_s: 0.0,
            sits_down_per_s: 0.0,
            settling_s: 0.0,
            lag_s: 0.0,
            motion: MotionOptions {
                velocity_memory_s: f64::INFINITY,
                unseen_velocity_memory_s: f64::INFINITY,
                lean_s: 0.0,
                ..MotionOptions::default()
            },
            ..Self::default()
        }
    }

    /// Checks every option.
    ///
    /// # Errors
    /// [`Error::Option`] naming the first option that makes no sense.
    pub fn validate(&self) -> Result<()> {
        let positive = [
            ("radius.mean_m", self.radius.mean_m),
            ("radius.sigma_m", self.radius.sigma_m),
            ("height.mean_m", self.height.mean_m),
            ("height.sigma_m", self.height.sigma_m),
            ("position_step_m", self.position_step_m),
            ("radius_step_m", self.radius_step_m),
            ("height_step_m", self.height_step_m),
            ("repulsion_per_m", self.repulsion_per_m),
            ("steps_for_s", self.steps_for_s),
            ("surprise", self.surprise),
            ("births_per_s", self.births_per_s),
            ("deaths_per_s", self.deaths_per_s),
            ("believed_at_nats", self.believed_at_nats),
            ("motion.acceleration_density", self.motion.acceleration_density),
            ("motion.velocity_memory_s", self.motion.velocity_memory_s),
            ("motion.unseen_velocity_memory_s", self.motion.unseen_velocity_memory_s),
            ("motion.initial_speed_sigma", self.motion.initial_speed_sigma),
            ("motion.gait_sigma_m", self.motion.gait_sigma_m),
        ];
        for (name, value) in positive {
            if value.is_nan() || value <= 0.0 {
                return Err(Error::option(name, format!("{value} is not positive")));
            }
        }
        if !(self.lag_s >= 0.0 && self.lag_s.is_finite()) {
            return Err(Error::option("lag_s", format!("{} is no time to wait for", self.lag_s)));
        }
        if !self.motion.lean_s.is_finite() {
            return Err(Error::option("motion.lean_s", "has to be a number"));
        }
        for (name, rate) in [
            ("companions_per_s", self.companions_per_s),
            ("rescues_per_s", self.rescues_per_s),
            ("unseen_leaves_per_s", self.unseen_leaves_per_s),
            ("sits_down_per_s", self.sits_down_per_s),
        ] {
            if !(rate >= 0.0 && rate.is_finite()) {
                return Err(Error::option(name, "has to be a number, 0 or more"));
            }
        }
        let weights = [self.moves.add, self.moves.delete, self.moves.position, self.moves.size];
        if !weights.iter().all(|w| *w > 0.0 && w.is_finite()) {
            return Err(Error::option("moves", "every move needs a positive weight"));
        }
        if !(0.0..=1.0).contains(&self.informed_births) {
            return Err(Error::option("informed_births", "has to lie between 0 and 1"));
        }
        if self.kept_steps == 0 {
            return Err(Error::option("kept_steps", "at least one step has to be kept for the mean"));
        }
        let most = if self.boxes.alone { Self::MOST_BY_BOXES } else { Simulation::MAX_BODIES };
        if self.max_people == 0 || self.max_people > most {
            return Err(Error::option(
                "max_people",
                format!("the sampler follows 1 to {most} people, not {}", self.max_people),
            ));
        }
        self.likelihood.defect().map_or(Ok(()), |defect| Err(Error::option("likelihood", defect)))
    }
}
