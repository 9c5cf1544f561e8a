//! Messages between stations (Nakazawa et al., figure 4).

use nalgebra::{Matrix2, Point2, Vector2};

use super::Looks;

/// A station: the number of its camera in the room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct StationId(pub u8);

/// Identifier of a seeing agent, unique in the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct AgentId {
    /// Station on which the agent runs.
    pub station: StationId,
    /// Number within the station; not reused while the station runs.
    pub number: u32,
}

/// Identifier of a tracked person, the same at every station. 0 is no person's: the agent tracks alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct TargetId(pub u32);

impl TargetId {
    /// No target: the agent tracks alone.
    pub const ALONE: Self = Self(0);
}

/// Message of a station to the others at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Packet {
    /// Sender.
    pub station: StationId,
    /// Number drawn when the sender started; distinguishes packets from before and after a restart.
    pub life: u32,
    /// Sequence number; it grows with every packet of a life.
    pub sequence: u32,
    /// Capture time of the moment, seconds on the sender's clock.
    pub time_s: f64,
    /// Greatest target id that the sender knows of, so that a restarted station does not reuse an id.
    pub greatest: TargetId,
    /// Whether the sender's camera has no usable image; then missing reports are not missed detections.
    pub is_blind: bool,
    /// Measurements of the sender's agents; at most one report of each target id above 0.
    pub reports: Vec<Report>,
    /// Messages of its mediator.
    pub messages: Vec<MediatorMessage>,
}

/// Measurement by one agent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// The agent.
    pub agent: AgentId,
    /// Target of the agent's agency, or [`TargetId::ALONE`].
    pub target: TargetId,
    /// Measured place on the floor, metres.
    pub position: Point2<f64>,
    /// Covariance of the measurement, m²; largest along the line of sight.
    pub covariance: Matrix2<f64>,
    /// Velocity, m/s, by the agent's own filter.
    pub velocity: Vector2<f64>,
    /// Height of the person, metres.
    pub height_m: f64,
    /// Measured colours; `None` when too little of the person is visible.
    pub looks: Option<Looks>,
    /// Probability that the measured person is the target, 0 to 1.
    pub confidence: f64,
    /// Whether the measurement may be of another person, who is near on the floor or in the image.
    pub is_crowded: bool,
}

/// Request or answer of a station's mediator to the others' mediators (Nakazawa et al., figure 6).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MediatorMessage {
    /// Request that a lone agent may join the agency of `candidate` (step b).
    Request {
        /// The lone agent.
        agent: AgentId,
        /// Target whose agency the agent asks to join.
        candidate: TargetId,
        /// Measured place of the agent's person, metres.
        position: Point2<f64>,
        /// Measured colours of the agent's person.
        looks: Option<Looks>,
    },
    /// Answer to a request (step d).
    Answer {
        /// Agent of the request.
        agent: AgentId,
        /// Target of the request.
        candidate: TargetId,
        /// Whether the agent may join.
        is_granted: bool,
    },
}
