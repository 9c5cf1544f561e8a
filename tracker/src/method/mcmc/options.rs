//! Everything that can be set about the sampler, with the reason for each default.

use serde::{Deserialize, Serialize};

use crate::likelihood::{LikelihoodRule, Simulation};
use crate::silhouette::Body;
use crate::{Error, Result};

/// When a proposed state is taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Acceptance {
    /// As published: `min(1, L_new / L_old)`. Knows no prior but E and R, and leaves the proposal ratio out.
    Published,
    /// Green's reversible jump: the posterior ratio (likelihood, motion, size, birth and death) times the proposal ratio.
    ReversibleJump,
}

/// A normal distribution over a length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Mean, metres.
    pub mean_m: f64,
    /// Standard deviation, metres.
    pub sigma_m: f64,
}

/// How often each move is proposed; only the proportions matter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MoveWeights {
    /// ADD: a new person.
    pub add: f64,
    /// DELETE: one person less.
    pub delete: f64,
    /// UPDATE-P: another place.
    pub position: f64,
    /// UPDATE-S: another size.
    pub size: f64,
}

impl Default for MoveWeights {
    /// Most steps go to where people are; appearing and leaving are rare, and a data-driven ADD needs few attempts.
    fn default() -> Self {
        Self { add: 0.06, delete: 0.06, position: 0.66, size: 0.22 }
    }
}

/// How people walk.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionOptions {
    /// Spectral density of the acceleration, m²/s³: how suddenly velocity changes. 1.5 lets a walker turn a corner
    /// (1.2 m/s to the side) within half a second at two standard deviations.
    pub acceleration_density: f64,
    /// How long the velocity of somebody in sight is remembered, seconds. Infinite: constant velocity, as published
    /// (equation 1).
    pub velocity_memory_s: f64,
    /// The same for somebody out of sight, who walks on for about this long: they may as well have stopped there.
    pub unseen_velocity_memory_s: f64,
    /// Standard deviation of the velocity of somebody who has just appeared, m/s: people come in walking.
    pub initial_speed_sigma: f64,
    /// What a silhouette's place means beyond the sampler's own spread, metres: swinging arms and legs move it.
    pub gait_sigma_m: f64,
    /// How far ahead of where a person stands the silhouette of a walker is, seconds times velocity: a trunk that leans
    /// forward by five degrees, as walkers' do, brings the middle of the silhouette 3 cm ahead of the pelvis at 1.2 m/s.
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

/// How a detector's boxes are followed where nothing else is seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BoxOptions {
    /// Whether boxes are all that is ever seen. Then more people can be followed than masks can count.
    pub alone: bool,
    /// Steps of a moment that are thrown away at least, for each person and each place at which boxes ask for one.
    pub burn_in_per_person: u32,
    /// The same for steps that are kept.
    pub kept_per_person: u32,
    /// Who is born now stands this far from everybody, metres: boxes tell people apart who are as near as this.
    pub apart_m: f64,
    /// What multiplies `log R`: people a hand's breadth apart are rare, and one person followed twice is not.
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
    /// Seed of the generator; the same seed gives the same bytes.
    pub seed: u64,
    /// B: steps of a frame that are thrown away (published: 100).
    pub burn_in_steps: u32,
    /// N: steps of a frame whose mean is the estimate (published: 100).
    pub kept_steps: u32,
    /// With many people, both are at least this many for each of them: a chain that changes one person a step needs its
    /// steps for every one (published: 0).
    pub steps_per_person: u32,
    /// These steps are for frames that follow each other in this time, seconds; later ones get as many times more, for what
    /// may have happened meanwhile (published: infinite).
    pub steps_for_s: f64,
    /// How many times the steps a moment gets in which the predicted people leave foreground over (published: 1).
    pub surprise: f64,
    /// How often each move is proposed.
    pub moves: MoveWeights,
    /// How boxes are followed where there are no masks.
    pub boxes: BoxOptions,
    /// V(S).
    pub likelihood: LikelihoodRule,
    /// When a proposal is taken.
    pub acceptance: Acceptance,
    /// λ of R(S), 1/m.
    pub repulsion_per_m: f64,
    /// Radii of people's ellipsoids: arms and gait included, half of a shoulder width of 0.5 m.
    pub radius: Spread,
    /// Heights of people, shoes included.
    pub height: Spread,
    /// Standard deviation of a step of UPDATE-P, metres. A mixture of a third, one and three times this is used.
    pub position_step_m: f64,
    /// Standard deviation of a step of UPDATE-S in radius, metres.
    pub radius_step_m: f64,
    /// Standard deviation of a step of UPDATE-S in height, metres.
    pub height_step_m: f64,
    /// How people walk.
    pub motion: MotionOptions,
    /// How often people appear, per second over all zones together.
    pub births_per_s: f64,
    /// How often somebody turns out to be two people, per second and person in sight: who came in beside them, or hidden by
    /// them. They may appear outside zones (published: 0).
    pub companions_per_s: f64,
    /// How often a person is found in the middle of a room with zones, per second in which cameras show one persistently whom
    /// no track explains (published: 0).
    pub rescues_per_s: f64,
    /// What a new person has to explain beyond chance: this part of a typical silhouette in one camera. Shadows, swinging
    /// limbs and reflections leave pieces of foreground that nobody explains, and they are no people.
    pub birth_evidence: f64,
    /// How often a person in a zone leaves, per second.
    pub deaths_per_s: f64,
    /// How often a person whom no camera sees leaves the room unseen, per second (published: 0). Slow: people who are
    /// hidden usually come out again.
    pub unseen_leaves_per_s: f64,
    /// The part of ADD's proposals that goes where unexplained foreground is; the rest is uniform over the zones
    /// (published: 0).
    pub informed_births: f64,
    /// For this long from the first moment with a mask, and from the first after an outage of all cameras for two seconds or
    /// more, people may appear anywhere: they were inside already (published: 0).
    pub settling_s: f64,
    /// What a new person has to have earned (nats beyond chance) to be believed in: to get an id, to be reported, and no
    /// longer to vanish outside zones. One moment is worth at most 4, so this sets the number of moments it takes.
    pub believed_at_nats: f64,
    /// How long after a moment its people are told, seconds: what comes after it tells where they were, and who had just
    /// come in (published: 0).
    pub lag_s: f64,
    /// The most people at one time, up to [`Simulation::MAX_BODIES`], by boxes alone up to [`Self::MOST_BY_BOXES`]; whoever
    /// comes beyond that is not found.
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
            informed_births: 0.8,
            settling_s: 0.5,
            believed_at_nats: 8.0,
            lag_s: 0.4,
            max_people: 24,
        }
    }
}

impl McmcOptions {
    /// The sampler for a detector's boxes alone.
    ///
    /// Boxes show a person's middle, which keeps its velocity better than a silhouette does, and they need no distance between
    /// people; at two moments a second as at thirty, the velocity is remembered for some steps. Chosen on generated crowds of
    /// 10 and 15 people.
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
            lag_s: 0.5,
            max_people: Self::MOST_BY_BOXES,
            ..Self::default()
        }
    }

    /// The most people that are followed by boxes alone.
    pub const MOST_BY_BOXES: usize = 255;

    /// The sampler as published: overlap ratio, no prior, no proposal ratio, births uniform over the zones and nowhere else,
    /// UPDATE-P by normal steps alone, constant velocity. For comparison.
    ///
    /// What the paper leaves open stays as it is here: identities (a person deleted and added again in one moment is the
    /// same; names go by appearance after an encounter), whom to believe in, and how equation 9's mean over states of
    /// different people becomes the next moment's S and V (person by person, as a measurement of a belief with covariance).
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

    /// Checks every number.
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
