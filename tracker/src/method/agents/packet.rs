//! What stations tell each other (seed 000, figure 4).

use nalgebra::{Matrix2, Point2, Vector2};

use super::Looks;

/// A station: the number of its camera in the room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct StationId(pub u8);

/// A seeing agent: unique in the system.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct AgentId {
    /// Station that it runs on.
    pub station: StationId,
    /// Number within the station, never given again while the station runs.
    pub number: u32,
}

/// A person who is followed: the same number at every station. 0 is nobody's: the agent tracks alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default)]
pub struct TargetId(pub u32);

impl TargetId {
    /// No target: the agent tracks alone.
    pub const ALONE: Self = Self(0);
}

/// Everything that a station tells the others at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Packet {
    /// Sender.
    pub station: StationId,
    /// Number drawn when the sender started: packets of another life of the station are told apart by it.
    pub life: u32,
    /// Grows with every packet of a life.
    pub sequence: u32,
    /// Capture time of the moment, seconds on the sender's clock.
    pub time_s: f64,
    /// The greatest target id that the sender knows of: a station that comes back gives none that was given before.
    pub greatest: TargetId,
    /// Whether its camera shows nothing usable now: that it reports nobody says nothing then.
    pub is_blind: bool,
    /// What its agents see now, at most one report of each target id above 0.
    pub reports: Vec<Report>,
    /// Messages of its mediator.
    pub messages: Vec<MediatorMessage>,
}

/// What one agent sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// The agent.
    pub agent: AgentId,
    /// Its agency's target, or [`TargetId::ALONE`].
    pub target: TargetId,
    /// Measured place on the floor, metres.
    pub position: Point2<f64>,
    /// Covariance of the measurement, m²: long along the line of sight.
    pub covariance: Matrix2<f64>,
    /// Velocity, m/s, by the agent's own filter.
    pub velocity: Vector2<f64>,
    /// Height of the person, metres.
    pub height_m: f64,
    /// Colours seen now; `None` where too little is seen of the person.
    pub looks: Option<Looks>,
    /// How likely it is that the agent sees its target, 0 to 1.
    pub confidence: f64,
    /// Whether other people are so near, on the floor or in the image, that the measurement may be of one of them.
    pub is_crowded: bool,
}

/// What a station's mediator asks of the others' mediators, and answers (seed 000, figure 6).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MediatorMessage {
    /// May this lone agent join the agency of `candidate`? (b)
    Request {
        /// The lone agent.
        agent: AgentId,
        /// The target that it may see.
        candidate: TargetId,
        /// Where it sees somebody, metres.
        position: Point2<f64>,
        /// Colours of whom it sees.
        looks: Option<Looks>,
    },
    /// Answer to a request. (d)
    Answer {
        /// The agent that asked.
        agent: AgentId,
        /// The target that it asked for.
        candidate: TargetId,
        /// Whether it may join.
        is_granted: bool,
    },
}
