//! Options of the head tracker, with the reason for each default.

use serde::{Deserialize, Serialize};
use shell::options::check_ranges;
use shell::ranges::{HYPOTHESES, LAYERS, PEOPLE};

use super::integration::{Integration, RayTest};
use crate::{Error, Result};

/// Model of a head: a spheroid around the vertical (figure 10).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadModel {
    /// Horizontal semi-axis, metres: between half of a head's breadth (7.5 cm) and half of its length (10 cm). Default
    /// 0.09.
    pub radius_m: f64,
    /// Vertical semi-axis, metres: half of the distance from chin to crown, hair included. Default 0.12.
    pub half_height_m: f64,
    /// Extent of the contour on either side of the top, degrees (figure 11: the upper part alone, because the neck is
    /// below the cheeks). Default 110.
    pub arc_deg: f64,
}

impl Default for HeadModel {
    fn default() -> Self {
        Self { radius_m: 0.09, half_height_m: 0.12, arc_deg: 110.0 }
    }
}

/// Effect of an edge's strength.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EdgeStrength {
    /// The published effect, in proportion: a black head before a white wall counts twenty times as much as a blond
    /// one.
    Linear,
    /// `|E| / (|E| + half_at)`: all clear edges count nearly alike. Grey levels a pixel.
    Saturating {
        /// Slope that counts half, grey levels a pixel.
        half_at: f64,
    },
}

/// Options of the edge images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EdgeOptions {
    /// Effect of an edge's strength. Default saturating, half at 8.
    pub strength: EdgeStrength,
    /// Whether edges of the empty scene are removed, where it is known. Default true.
    pub moving_only: bool,
    /// Whether an edge counts only where the head is the darker side, as published. Otherwise a camera's contour may be
    /// darker or brighter than its surroundings. Default false.
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

/// Options of the motion model of heads.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HeadMotionOptions {
    /// Standard deviation of a horizontal step, independent of its duration, metres. Default 0.02.
    pub step_m: f64,
    /// Standard deviation of a horizontal step for each second of its duration, m/s. Default 0.5.
    pub speed_m_s: f64,
    /// Standard deviation of a vertical step for each second, m/s; walking bobs by 2 cm twice a second. Default 0.12.
    pub vertical_speed_m_s: f64,
    /// Time constant of the velocity, seconds; 0 for a random walk, as published. Default 1.
    pub memory_s: f64,
}

impl Default for HeadMotionOptions {
    fn default() -> Self {
        Self { step_m: 0.02, speed_m_s: 0.5, vertical_speed_m_s: 0.12, memory_s: 1.0 }
    }
}

/// Options of track initiation and deletion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LifeOptions {
    /// Least weight (0 to 1) of the contour of a seen head in one camera. Default 0.25.
    pub seen_at: f64,
    /// Least support ([`super::weight::HeadSupport`]) of a new head. Default 0.3.
    pub born_at: f64,
    /// Time for which a new person must be seen before they are reported, seconds (published: 0). Default 0.8.
    pub believed_after_s: f64,
    /// Time constant with which a track's trust follows its support, seconds. Default 1.
    pub trusted_in_s: f64,
    /// Trust (the support, averaged over that time) below which a track is lost. Default 0.25.
    pub lost_at: f64,
    /// Time after which a person who is not seen on an exit zone has left, seconds. Default 0.4.
    pub unseen_at_exit_s: f64,
    /// Least height of a head's centre above the floor, metres. Default 1.2.
    pub lowest_m: f64,
    /// Least height of a new head's centre, metres: people enter upright. Default 1.4.
    pub lowest_born_m: f64,
    /// Largest height of a head's centre, metres. Default 1.95.
    pub highest_m: f64,
    /// Largest number of people at one time. Default 24.
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

/// Options of [`super::Condensation`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CondensationOptions {
    /// Seed of all generators; the same seed gives the same bytes.
    pub seed: u64,
    /// N: number of hypotheses a person. Default 150.
    pub hypotheses: usize,
    /// Number of times that the hypotheses of a moment are weighed; after each but the last, half as many are resampled
    /// with a smaller spread (published: 1). Default 3.
    pub layers: usize,
    /// Power of the integrated weight for resampling (published: 1). A sum over pairs decreases slowly around its peak;
    /// without the power the mean would stay near the prediction. Default 2.
    pub sharpness: f64,
    /// Integration of the cameras' weights. Default `pairs-angle`.
    pub integration: Integration,
    /// β: cosine beyond which two rays to the head are collinear. Default 0.94.
    pub beta: f64,
    /// Test of collinear rays. Default `line`.
    pub rays: RayTest,
    /// Whether hypotheses of two people are separated with equal covariances, as published, or by their densities.
    /// Default false.
    pub equal_covariances: bool,
    /// Model of a head.
    pub head: HeadModel,
    /// Edge images.
    pub edges: EdgeOptions,
    /// Motion model.
    pub motion: HeadMotionOptions,
    /// Track initiation and deletion.
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
            motion: HeadMotionOptions::default(),
            life: LifeOptions::default(),
        }
    }
}

impl CondensationOptions {
    /// Options of the published filter in every respect: a random walk, one layer, edges in proportion to their
    /// strength.
    #[must_use]
    pub fn published() -> Self {
        Self {
            layers: 1,
            sharpness: 1.0,
            rays: RayTest::Published,
            equal_covariances: true,
            edges: EdgeOptions { strength: EdgeStrength::Linear, moving_only: false, dark_heads_only: true },
            motion: HeadMotionOptions { memory_s: 0.0, speed_m_s: 1.0, ..HeadMotionOptions::default() },
            life: LifeOptions {
                // Much lower, and edges of a textured wall become people; much higher, and no track begins.
                born_at: 0.2,
                // In proportion to the default.
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
    /// [`Error::Option`] with the first invalid option.
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
        Ok(check_ranges([
            ("hypotheses", self.hypotheses as f64, HYPOTHESES),
            ("layers", self.layers as f64, LAYERS),
            ("life.max_people", life.max_people as f64, PEOPLE),
        ])?)
    }
}
