//! How a station's sightings and what it hears become agents.

use nalgebra::{Matrix2, Matrix4, Point2, Vector2, Vector4};

use super::{AgentId, Packet, Sightings, StationId, TargetId};

/// The rule by which one station's agents work together with those of others. One value a station.
pub trait Rule: Send {
    /// Takes in the packets heard since the last moment, in order of arrival, their times already on this station's
    /// clock; and then what the station itself sees now.
    fn step(&mut self, sightings: &Sightings, heard: &[Packet]) -> Step;

    /// Everybody whom this station knows of after the last step, by ascending target: whom it sees, and whom it only
    /// hears of.
    fn people(&self) -> Vec<Belief>;

    /// The station's own states of those whom its image tracks follow, by which image tracking looks for them in the next
    /// frame; `None` for rules under which image tracks go their own way.
    fn followed(&self) -> Option<Vec<Followed>> {
        None
    }
}

/// A station's state of somebody whom an image track follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Followed {
    /// The image track.
    pub track: u32,
    /// Place on the floor, metres, and velocity, m/s: x, y, vx, vy.
    pub mean: Vector4<f64>,
    /// Covariance of the mean.
    pub covariance: Matrix4<f64>,
}

/// What follows from one moment at one station.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Step {
    /// What is to be sent.
    pub packet: Packet,
    /// Places at which image tracking is to look again.
    pub restarts: Vec<Restart>,
    /// Image tracks that follow nobody.
    pub ended: Vec<u32>,
}

/// Somebody whom image tracking has lost, or does not know of yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Restart {
    /// Where the person should be now by what others see, metres.
    pub position: Point2<f64>,
    /// Height of the person, metres.
    pub height_m: f64,
}

/// A station's knowledge of one person.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Belief {
    /// The person.
    pub target: TargetId,
    /// Agent of this station that sees the person now, if one does.
    pub agent: Option<AgentId>,
    /// Place on the floor, metres.
    pub position: Point2<f64>,
    /// Covariance of the place, m².
    pub covariance: Matrix2<f64>,
    /// Velocity, m/s.
    pub velocity: Vector2<f64>,
    /// Height, metres.
    pub height_m: f64,
    /// How sure the station is that this person is there and is this one, 0 to 1.
    pub confidence: f64,
}

/// Which station should see whom.
pub trait FieldOfView: Send + Sync {
    /// Fraction of a person at this place that a station sees, 0 to 1: cut by its image and by what the room hides, not
    /// by other people.
    fn visible(&self, station: StationId, place: Point2<f64>, height_m: f64) -> f64;

    /// Whether somebody at this place may be on the way out of the room: who is no longer seen there has left.
    fn may_leave(&self, _place: Point2<f64>) -> bool {
        false
    }

    /// Whether the fields of view of two stations overlap.
    fn overlap(&self, a: StationId, b: StationId) -> bool;
}
