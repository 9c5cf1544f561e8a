//! Interface of the rules that turn a station's sightings and received packets into agents.

use nalgebra::{Matrix2, Matrix4, Point2, Vector2, Vector4};

use super::{AgentId, Packet, Sightings, StationId, TargetId};

/// Rule by which one station's agents cooperate with those of other stations. Each station has its own instance.
pub trait Rule: Send {
    /// Updates the state with the packets received since the last moment, in order of arrival and with times on this
    /// station's clock, and then with the station's own sightings.
    fn step(&mut self, sightings: &Sightings, received: &[Packet]) -> Step;

    /// Estimates of all people after the last step, by ascending target, measured here or only by other stations.
    fn people(&self) -> Vec<Belief>;

    /// States of the people whom image tracks follow, as predictions for image tracking in the next frame; `None` for
    /// rules that do not guide image tracking.
    fn followed(&self) -> Option<Vec<Followed>> {
        None
    }
}

/// State of a person whom an image track follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// The image track.
    pub track: u32,
    /// Place on the floor, metres, and velocity, m/s: x, y, vx, vy.
    pub mean: Vector4<f64>,
    /// Covariance of the mean, in the squares of its units.
    pub covariance: Matrix4<f64>,
}

/// Output of one station at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Step {
    /// Packet to send to the other stations.
    pub packet: Packet,
    /// Places at which image tracking should propose a birth.
    pub restarts: Vec<Restart>,
    /// Image tracks to end, because they follow no person.
    pub ended: Vec<u32>,
}

/// Person whom image tracking has lost or does not follow yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Restart {
    /// Predicted place of the person, metres.
    pub position: Point2<f64>,
    /// Height of the person, metres.
    pub height_m: f64,
}

/// Estimate of one person by one station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief {
    /// Identifier of the person.
    pub target: TargetId,
    /// Agent of this station that measures the person now; `None` when the person is not measured here.
    pub agent: Option<AgentId>,
    /// Place on the floor, metres.
    pub position: Point2<f64>,
    /// Covariance of the place, m².
    pub covariance: Matrix2<f64>,
    /// Velocity, m/s.
    pub velocity: Vector2<f64>,
    /// Height, metres.
    pub height_m: f64,
    /// Probability that the person is present and carries the right id, 0 to 1.
    pub confidence: f64,
}

/// Visibility of people for each station.
pub trait FieldOfView: Send + Sync {
    /// Fraction, 0 to 1, of a person at this place that a station sees: limited by the image border and by occlusion by
    /// the room, not by other people.
    fn visible(&self, station: StationId, place: Point2<f64>, height_m: f64) -> f64;

    /// Whether a person at this place may be leaving the room; a person who is missed there has left.
    fn may_leave(&self, _place: Point2<f64>) -> bool {
        false
    }

    /// Whether the fields of view of two stations overlap.
    fn overlap(&self, a: StationId, b: StationId) -> bool;
}
