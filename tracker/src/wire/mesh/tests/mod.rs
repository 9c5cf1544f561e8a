//! Tests of the state machine by itself, and of members of the mesh in one process.

mod listening;
mod network;

use nalgebra::{Matrix2, Point2, Vector2};

use super::super::Fingerprint;
use crate::method::agents::{AgentId, Packet, Report, StationId, TargetId};

const ROOM: Fingerprint = Fingerprint([7; Fingerprint::BYTES]);
const CAMERAS: [&str; 4] = ["cam0", "cam1", "cam 2/ä", "cam3"];

/// Packet of a station that sees one person.
fn packet(station: u8, life: u32, sequence: u32, time_s: f64) -> Packet {
    let report = Report {
        agent: AgentId { station: StationId(station), number: 1 },
        target: TargetId(1),
        position: Point2::new(1.0, 2.0),
        covariance: Matrix2::identity() * 0.01,
        velocity: Vector2::zeros(),
        height_m: 1.7,
        looks: None,
        confidence: 1.0,
        is_crowded: false,
    };
    let station = StationId(station);
    Packet {
        station,
        life,
        sequence,
        time_s,
        greatest: TargetId(1),
        reports: vec![report],
        ..Packet::default()
    }
}
