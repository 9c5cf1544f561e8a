//! Options of the modern rule, with the reason for each default.

use serde::{Deserialize, Serialize};

use crate::{Error, Result};

/// Options of the modern rule. [`Self::simulation`] fits the published simulation, the default fits cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ModernOptions {
    /// Standard deviation of a person's acceleration, m/s², constant over about 0.1 s.
    pub acceleration_m_s2: f64,
    /// Time for which the error of an image track's place stays about the same, seconds; 0: every frame's is new. The
    /// error of a silhouette's foot or far end lasts as long as the person's pose and background do.
    pub correlation_s: f64,
    /// The same for colours, which last as long as the light that falls on the person.
    pub look_correlation_s: f64,
    /// Standard deviation of the measured hue of a fully saturated colour, degrees. At half the saturation the hue
    /// counts half: the chroma plane is the space in which colours are compared, and there grey has no hue.
    pub hue_noise_deg: f64,
    /// Standard deviation of brightness, 0 to 1: wide, as shade changes it.
    pub value_noise: f64,
    /// Standard deviation of the height that one station measures, metres.
    pub height_noise_m: f64,
    /// Number of colours of a look whose errors are independent, 1 to 3. In the simulation the three colours are one.
    pub independent_colours: f64,
    /// Measurement errors of people who are close are larger by this factor; their covariance as reported has it already,
    /// their colours have not.
    pub crowded_factor: f64,
    /// Square of the Mahalanobis distance beyond which a measurement is not of a person.
    pub gate: f64,
    /// Difference of log-likelihood that settles who is who after a crossing, nats.
    pub margin_nats: f64,
    /// Time after which evidence counts e times less, seconds.
    pub memory_s: f64,
    /// Distance below which two people may be mistaken for each other, metres.
    pub meet_m: f64,
    /// Factor of the covariances in the probability of mistaking people who meet: they turn and slow down there more than
    /// elsewhere.
    pub confusion: f64,
    /// Time for which a sighting that nobody's track takes has to last until it becomes a new person, seconds.
    pub birth_s: f64,
    /// Time for which a station that has just started listens before it gives ids, seconds.
    pub listen_s: f64,
    /// Time after which a person whom some station should see and none measures is gone, seconds.
    pub death_s: f64,
    /// Time for which a person whom no station can see is carried, seconds.
    pub carry_s: f64,
    /// Time for which two stations have to measure one person under two ids until one gives way, seconds.
    pub naming_s: f64,
}

impl Default for ModernOptions {
    fn default() -> Self {
        Self {
            // People in rooms turn within a step; image tracking tells the lasting part of its errors in its covariance, and
            // only of people whom it believes in.
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

    /// Checks that the options make sense.
    ///
    /// # Errors
    /// [`Error::Option`] for the first that does not.
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
        for (name, value) in above_0 {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::option(name, format!("is {value}; give a number above 0")));
            }
        }
        let from_0 = [
            ("correlation_s", self.correlation_s),
            ("look_correlation_s", self.look_correlation_s),
            ("birth_s", self.birth_s),
            ("listen_s", self.listen_s),
            ("death_s", self.death_s),
            ("carry_s", self.carry_s),
            ("naming_s", self.naming_s),
        ];
        for (name, value) in from_0 {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(Error::option(name, format!("is {value}; give 0 or more seconds")));
            }
        }
        if !(1.0..=3.0).contains(&self.independent_colours) {
            let value = self.independent_colours;
            return Err(Error::option("independent_colours", format!("is {value}; give 1 to 3")));
        }
        if !(1.0..=10.0).contains(&self.crowded_factor) {
            let value = self.crowded_factor;
            return Err(Error::option("crowded_factor", format!("is {value}; give 1 to 10")));
        }
        Ok(())
    }
}
