//! Everything that can be set about the filters, with the reason for each default.

use serde::{Deserialize, Serialize};

use super::integration::{Integration, RayTest};
use crate::{Error, Result};

/// The model of a head: a spheroid around the vertical (figure 10).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadModel {
    /// Horizontal semi-axis, metres: between half of a head's breadth (7.5 cm) and half of its length (10 cm).
    pub radius_m: f64,
    /// Vertical semi-axis, metres: half of the way from chin to crown, hair included.
    pub half_height_m: f64,
    /// How far the contour points go down on either side of the top, degrees (figure 11: the upper part alone, because
    /// below the cheeks is a neck).
    pub arc_deg: f64,
}

impl Default for HeadModel {
    fn default() -> Self {
        Self { radius_m: 0.09, half_height_m: 0.12, arc_deg: 110.0 }
    }
}

/// How much a strong edge counts more than a weak one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeStrength {
    /// As published: in proportion, so that a black head before a white wall counts twenty times a blond one.
    Linear,
    /// `|E| / (|E| + half_at)`: an edge is an edge. Grey levels a pixel.
    Saturating {
        /// The slope that counts half.
        half_at: f64,
    },
}

/// What becomes of a camera's picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeOptions {
    /// How much a strong edge counts.
    pub strength: EdgeStrength,
    /// Whether edges that the empty scene has as well are left out, where the empty scene is known.
    pub moving_only: bool,
    /// As published: an edge counts only where the head is the darker side. Otherwise a camera's contour may be darker or
    /// brighter than what is around it.
    pub dark_heads_only: bool,
}

impl Default for EdgeOptions {
    fn default() -> Self {
        Self {
            strength: EdgeStrength::Saturating { half_at: 8.0 },
            moving_only: true,
            dark_heads_only: false,
        }
    }
}

/// How heads move from moment to moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionOptions {
    /// Standard deviation of a step to the sides whatever the time it takes, metres.
    pub step_m: f64,
    /// And for each second of it, m/s.
    pub speed_m_s: f64,
    /// The same along the vertical, m/s; walking bobs by 2 cm twice a second.
    pub vertical_speed_m_s: f64,
    /// How long a velocity is remembered, seconds; 0: a random walk, as published.
    pub memory_s: f64,
}

impl Default for MotionOptions {
    fn default() -> Self {
        Self { step_m: 0.02, speed_m_s: 0.5, vertical_speed_m_s: 0.12, memory_s: 1.0 }
    }
}

/// When somebody is believed to have come, and to have gone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LifeOptions {
    /// A camera sees a head where the weight (0 to 1) of its contour is at least this.
    pub seen_at: f64,
    /// The support (see [`super::weight::Support`]) that a new head needs.
    pub born_at: f64,
    /// Somebody new is reported after having been seen for so long, seconds (published: 0).
    pub believed_after_s: f64,
    /// How fast trust in somebody follows what is seen of them, seconds.
    pub trusted_in_s: f64,
    /// The trust (the support, averaged over that time) below which they are given up.
    pub lost_at: f64,
    /// Somebody who is not seen on an exit zone has left after so long, seconds.
    pub unseen_at_exit_s: f64,
    /// Lowest place of a head's middle, metres above the floor.
    pub lowest_m: f64,
    /// Lowest place where one is found: people come in upright.
    pub lowest_born_m: f64,
    /// Highest place.
    pub highest_m: f64,
    /// The most people at one time.
    pub max_people: usize,
}

impl Default for LifeOptions {
    fn default() -> Self {
        Self {
            seen_at: 0.25,
            born_at: 0.3,
            believed_after_s: 0.8,
            trusted_in_s: 1.0,
            lost_at: 0.25,
            unseen_at_exit_s: 0.4,
            lowest_m: 1.2,
            lowest_born_m: 1.4,
            highest_m: 1.95,
            max_people: 24,
        }
    }
}

/// The options of [`super::Condensation`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CondensationOptions {
    /// Seed of all generators; the same seed gives the same bytes.
    pub seed: u64,
    /// N: hypotheses a person.
    pub hypotheses: usize,
    /// How often the hypotheses of a moment are weighed and half of them drawn again around the best, closer each time
    /// (published: once).
    pub layers: usize,
    /// The power of the integrated weight that hypotheses are drawn by (published: 1). A sum over pairs falls off slowly
    /// from its peak; its mean would lie where the prediction is.
    pub sharpness: f64,
    /// How the cameras' weights become one.
    pub integration: Integration,
    /// β: the cosine beyond which two rays to the head are one line.
    pub beta: f64,
    /// Which rays are one line.
    pub rays: RayTest,
    /// Whether hypotheses of two people are told apart with the covariances taken as equal, as published, or by the
    /// densities themselves.
    pub equal_covariances: bool,
    /// The spheroid.
    pub head: HeadModel,
    /// What becomes of pictures.
    pub edges: EdgeOptions,
    /// How heads move.
    pub motion: MotionOptions,
    /// Coming and going.
    pub life: LifeOptions,
}

impl Default for CondensationOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            hypotheses: 150,
            layers: 3,
            sharpness: 2.0,
            integration: Integration::PairsAngle,
            // 20°: the depth of a head along such rays is three times as uncertain as across them.
            beta: 0.94,
            rays: RayTest::Line,
            equal_covariances: false,
            head: HeadModel::default(),
            edges: EdgeOptions::default(),
            motion: MotionOptions::default(),
            life: LifeOptions::default(),
        }
    }
}

impl CondensationOptions {
    /// The filter as published, in every choice: a random walk, one layer, all edges in proportion to their strength.
    #[must_use]
    pub fn published() -> Self {
        Self {
            layers: 1,
            sharpness: 1.0,
            rays: RayTest::Published,
            equal_covariances: true,
            edges: EdgeOptions { strength: EdgeStrength::Linear, moving_only: false, dark_heads_only: true },
            motion: MotionOptions { memory_s: 0.0, speed_m_s: 1.0, ..MotionOptions::default() },
            life: LifeOptions {
                // Much lower, and edges of a textured wall become people; much higher, and nobody comes in.
                born_at: 0.2,
                // In proportion to the default's.
                seen_at: 0.165,
                lost_at: 0.165,
                believed_after_s: 0.0,
                ..LifeOptions::default()
            },
            ..Self::default()
        }
    }

    /// Checks every number.
    ///
    /// # Errors
    /// [`Error::Option`] naming the first option that makes no sense.
    pub fn validate(&self) -> Result<()> {
        let (head, motion, life) = (&self.head, &self.motion, &self.life);
        let positive = [
            ("head.radius_m", head.radius_m),
            ("head.half_height_m", head.half_height_m),
            ("head.arc_deg", head.arc_deg),
            ("sharpness", self.sharpness),
            ("motion.step_m", motion.step_m),
            ("life.seen_at", life.seen_at),
            ("life.born_at", life.born_at),
            ("life.lowest_m", life.lowest_m),
            ("life.trusted_in_s", life.trusted_in_s),
            ("life.lost_at", life.lost_at),
        ];
        let not_negative = [
            ("motion.speed_m_s", motion.speed_m_s),
            ("motion.vertical_speed_m_s", motion.vertical_speed_m_s),
            ("motion.memory_s", motion.memory_s),
            ("life.believed_after_s", life.believed_after_s),
            ("life.unseen_at_exit_s", life.unseen_at_exit_s),
        ];
        let half_at = match self.edges.strength {
            EdgeStrength::Linear => 1.0,
            EdgeStrength::Saturating { half_at } => half_at,
        };
        for (name, value) in positive.into_iter().chain([("edges.strength.half_at", half_at)]) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::option(name, format!("{value} is not a positive number")));
            }
        }
        for (name, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::option(name, format!("{value} is not a number from 0 on")));
            }
        }
        if head.arc_deg > 180.0 {
            return Err(Error::option("head.arc_deg", "has to lie between 0 and 180"));
        }
        if !(self.beta > 0.0 && self.beta <= 1.0) {
            return Err(Error::option("beta", format!("{} is no cosine between 0 and 1", self.beta)));
        }
        if !(life.highest_m > life.lowest_born_m
            && life.lowest_born_m >= life.lowest_m
            && life.highest_m.is_finite())
        {
            return Err(Error::option("life", "needs lowest_m <= lowest_born_m < highest_m"));
        }
        for (name, count) in
            [("hypotheses", self.hypotheses), ("layers", self.layers), ("--most-people", life.max_people)]
        {
            if count == 0 {
                return Err(Error::option(name, "has to be at least 1"));
            }
        }
        Ok(())
    }
}
