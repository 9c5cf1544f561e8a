//! Options of the modern rule, with the reason for each default.

use serde::{Deserialize, Serialize};
use shell::options::check_numbers;

use crate::Result;

/// Options of the modern rule. [`Self::simulation`] is for the published simulation, the default for cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ModernOptions {
    /// Standard deviation of a person's acceleration, m/s², constant over about 0.1 s.
    pub acceleration_m_s2: f64,
    /// Correlation time of the errors of an image track's place, seconds; 0: errors are independent from frame to
    /// frame. The error of a silhouette's foot or far end lasts as long as the person's pose and background do.
    pub correlation_s: f64,
    /// Correlation time of the errors of colours, seconds: they last as long as the light that falls on the person.
    pub look_correlation_s: f64,
    /// Standard deviation of the measured hue of a fully saturated colour, degrees. At half the saturation the hue
    /// counts half: the chroma plane is the space in which colours are compared, and there grey has no hue.
    pub hue_noise_deg: f64,
    /// Standard deviation of the measured brightness, 0 to 1: large, as shade changes it.
    pub value_noise: f64,
    /// Standard deviation of the height that one station measures, metres.
    pub height_noise_m: f64,
    /// Number of colours of a look with independent errors, 1 to 3. In the simulation the three colours are equal.
    pub independent_colours: f64,
    /// Factor of the errors of colours of people who are close. The reported covariance of the place already has it.
    pub crowded_factor: f64,
    /// Gate: squared Mahalanobis distance from which a measurement is not associated with a person.
    pub gate: f64,
    /// Difference of log-likelihood that decides identities after a crossing, nats.
    pub margin_nats: f64,
    /// Time constant at which the weight of evidence decays, seconds.
    pub memory_s: f64,
    /// Distance below which two people may be swapped, metres.
    pub meet_m: f64,
    /// Factor of the covariances in the probability of a swap at a meeting: people turn and slow down there more than
    /// elsewhere.
    pub confusion: f64,
    /// Duration of an unassociated image track after which it becomes a new person, seconds.
    pub birth_s: f64,
    /// Time for which a station that has just started only receives before it assigns ids, seconds.
    pub listen_s: f64,
    /// Time after which a person whom a station should measure and none does is removed, seconds.
    pub death_s: f64,
    /// Time after which a person who is occluded from all stations is removed, seconds.
    pub carry_s: f64,
    /// Time for which two stations use two ids for one person until one id gives way, seconds.
    pub naming_s: f64,
}

impl Default for ModernOptions {
    fn default() -> Self {
        Self {
            // People in rooms turn within a step. Image tracking includes lasting errors in its covariance, and
            // reports only people that it has confirmed.
            acceleration_m_s2: 2.5,
            birth_s: 0.1,
            look_correlation_s: 1.0,
            hue_noise_deg: 20.0,
            value_noise: 0.25,
            height_noise_m: 0.1,
            independent_colours: 2.0,
            ..Self::simulation()
        }
    }
}

impl ModernOptions {
    /// Options for the published simulation: errors independent from frame to frame; the attribute, ± 0.15, is the hue of
    /// three equal colours of saturation 1, on 180 degrees.
    pub fn simulation() -> Self {
        Self {
            acceleration_m_s2: 1.5,
            correlation_s: 0.0,
            look_correlation_s: 0.0,
            hue_noise_deg: 0.15 * 180.0 / 3f64.sqrt(),
            value_noise: 0.25,
            height_noise_m: 0.1,
            independent_colours: 1.0,
            crowded_factor: 2.0,
            gate: 16.0,
            margin_nats: 8.0,
            memory_s: 6.0,
            meet_m: 1.0,
            confusion: 2.0,
            birth_s: 1.0,
            listen_s: 1.0,
            death_s: 1.2,
            carry_s: 120.0,
            naming_s: 1.0,
        }
    }

    /// Checks that all options are within their ranges.
    ///
    /// # Errors
    /// [`crate::Error::Option`] for the first that is not.
    pub fn validate(&self) -> Result<()> {
        let above_0 = [
            ("acceleration_m_s2", self.acceleration_m_s2),
            ("hue_noise_deg", self.hue_noise_deg),
            ("value_noise", self.value_noise),
            ("height_noise_m", self.height_noise_m),
            ("gate", self.gate),
            ("margin_nats", self.margin_nats),
            ("memory_s", self.memory_s),
            ("meet_m", self.meet_m),
            ("confusion", self.confusion),
        ];
        check_numbers(above_0, |value| value > 0.0, "a number above 0")?;
        let from_0 = [
            ("correlation_s", self.correlation_s),
            ("look_correlation_s", self.look_correlation_s),
            ("birth_s", self.birth_s),
            ("listen_s", self.listen_s),
            ("death_s", self.death_s),
            ("carry_s", self.carry_s),
            ("naming_s", self.naming_s),
        ];
        check_numbers(from_0, |value| value >= 0.0, "0 or more seconds")?;
        let colours = [("independent_colours", self.independent_colours)];
        check_numbers(colours, |value| (1.0..=3.0).contains(&value), "1 to 3")?;
        let crowded = [("crowded_factor", self.crowded_factor)];
        Ok(check_numbers(crowded, |value| (1.0..=10.0).contains(&value), "1 to 10")?)
    }
}
