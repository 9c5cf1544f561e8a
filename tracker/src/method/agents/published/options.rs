//! Options of the published rule.

use serde::{Deserialize, Serialize};
use shell::options::check_numbers;

use crate::Result;

/// Options of the published rule. Names in brackets are the paper's; values that it leaves open were chosen by
/// simulation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PublishedOptions {
    /// Confidence lost in each frame in which a person is too close to another (k1). The paper may also mean once per
    /// crossing, which is too little, because the agent may switch to the other person in each frame of a crossing.
    pub crossing_penalty: f64,
    /// Rate of all other changes of confidence, 1/s (k): 0.01 per frame at 10 frames/s.
    pub rate_per_s: f64,
    /// Weight of a difference of place, 1/m (k21).
    pub distance_weight: f64,
    /// Weight of a difference of hue, 1/degree (k22): 100° count as 1 m.
    pub hue_weight: f64,
    /// Weight of the colour memory (k31).
    pub knowledge_weight: f64,
    /// Difference of place below which confidence rises, metres (`dist_thresh`).
    pub distance_limit_m: f64,
    /// Difference of hue below which confidence rises, degrees (`color_thresh`).
    pub hue_limit_deg: f64,
    /// Fraction of a target's memory from which a colour is frequent.
    pub frequent: f64,
    /// Confidence from which colours are added to the memory.
    pub memory_confidence: f64,
    /// Confidence at or below which an agent leaves its agency. Section 3.3 says 0, section 2.2 a threshold. With 0 an
    /// agent that switched to another person in a crossing of two frames stays, and no agent contradicts it where the
    /// others have left (layout *along*: all six kept in 95 % of the trials instead of 98 %).
    pub leaving_confidence: f64,
    /// Confidence of a lone agent in the mediator's list from which it asks to join.
    pub request_confidence: f64,
    /// Confidence of an agent that has joined an agency.
    pub joining_confidence: f64,
    /// Distance below which two stations' sightings are of one person when a request is answered, metres.
    pub grant_m: f64,
    /// Confidence of another station from which an agent is created for its target.
    pub creation_confidence: f64,
    /// Time without an agent for a target after which one is created, seconds.
    pub creation_s: f64,
    /// Time without a sighting after which an agent ends, seconds.
    pub lost_s: f64,
    /// Time after which the lone one of two agents on one person ends, seconds.
    pub double_s: f64,
    /// Time after which a lone agent that matches no known target gets a target of its own, seconds.
    pub alone_s: f64,
    /// Time constant of the position filter, seconds.
    pub filter_s: f64,
}

impl Default for PublishedOptions {
    fn default() -> Self {
        Self {
            crossing_penalty: 0.4,
            rate_per_s: 0.1,
            distance_weight: 1.0,
            hue_weight: 0.01,
            knowledge_weight: 1.0,
            distance_limit_m: 0.6,
            hue_limit_deg: 20.0,
            frequent: 0.04,
            memory_confidence: 0.8,
            leaving_confidence: 0.25,
            request_confidence: 0.8,
            joining_confidence: 1.0,
            grant_m: 0.6,
            creation_confidence: 0.5,
            creation_s: 0.5,
            lost_s: 1.0,
            double_s: 1.0,
            alone_s: 1.0,
            filter_s: 0.23,
        }
    }
}

impl PublishedOptions {
    /// Options for the published simulation, whose attribute from 0 to 1 is represented by a range of hues.
    ///
    /// * `hue_deg`: range of hue for a difference of attribute of 1, degrees;
    /// * `attribute_noise`: largest error of the attribute, which is also the threshold.
    #[must_use]
    pub fn simulation(hue_deg: f64, attribute_noise: f64) -> Self {
        Self {
            hue_weight: 360.0 / 100.0 / hue_deg,
            hue_limit_deg: attribute_noise * hue_deg,
            ..Self::default()
        }
    }

    /// Checks that all options are within their ranges.
    ///
    /// # Errors
    /// [`crate::Error::Option`] for the first that is not.
    pub fn validate(&self) -> Result<()> {
        let from_0 = [
            ("crossing_penalty", self.crossing_penalty),
            ("rate_per_s", self.rate_per_s),
            ("distance_weight", self.distance_weight),
            ("hue_weight", self.hue_weight),
            ("knowledge_weight", self.knowledge_weight),
            ("distance_limit_m", self.distance_limit_m),
            ("hue_limit_deg", self.hue_limit_deg),
            ("grant_m", self.grant_m),
            ("creation_s", self.creation_s),
            ("lost_s", self.lost_s),
            ("double_s", self.double_s),
            ("alone_s", self.alone_s),
            ("filter_s", self.filter_s),
        ];
        check_numbers(from_0, |value| value >= 0.0, "0 or more")?;
        let fractions = [
            ("frequent", self.frequent),
            ("memory_confidence", self.memory_confidence),
            ("leaving_confidence", self.leaving_confidence),
            ("request_confidence", self.request_confidence),
            ("joining_confidence", self.joining_confidence),
            ("creation_confidence", self.creation_confidence),
        ];
        Ok(check_numbers(fractions, |value| (0.0..=1.0).contains(&value), "0 to 1")?)
    }
}
