//! `agents.jsonl`: a line a packet, with the reports of a station's agents.

use std::path::Path;

use mot::jsonl::rounded;
use serde::Serialize;

use super::Persistence;
use super::line_file::LineFile;
use crate::method::agents::{Packet, Report, TargetId};
use crate::{Error, Result};

/// Name of the file.
const NAME: &str = "agents.jsonl";

/// Writer of the file, which grows packet by packet.
#[derive(Debug)]
pub struct AgentsFile(LineFile);

impl AgentsFile {
    /// File in the folder `out`; it is created with its first line.
    pub fn new(out: &Path) -> Self {
        Self(LineFile::new(out.join(NAME)))
    }

    /// The same file, kept in this way.
    #[must_use]
    pub fn kept(self, persistence: &Persistence) -> Self {
        Self(self.0.kept(persistence))
    }

    /// Goes on in another folder.
    pub fn move_to(&mut self, out: &Path) {
        self.0.move_to(out.join(NAME));
    }

    /// Appends a packet of the station of a camera:
    /// `{"time":1.5,"station":"cam0","life":"9f02","sequence":12,"blind":false,"agents":[{"agent":3,"target":2,"x":1.2,
    /// "y":0.4,"vx":0.1,"vy":0.0,"height":1.7,"confidence":0.97,"crowded":false}],"messages":0}`; the target of an
    /// agent that tracks alone is null.
    ///
    /// # Errors
    /// [`Error::File`] with the file.
    pub fn write(&mut self, packet: &Packet, camera: &str) -> Result<()> {
        let line = PacketLine {
            time: (packet.time_s * 1e6).round() / 1e6,
            station: camera,
            life: format!("{:x}", packet.life),
            sequence: packet.sequence,
            blind: packet.is_blind,
            agents: packet.reports.iter().map(AgentLine::from).collect(),
            messages: packet.messages.len(),
        };
        let text = serde_json::to_string(&line)
            .map_err(|e| Error::content(self.0.path(), camera, format!("cannot be written ({e})")))?;
        self.0.append(&(text + "\n"))
    }
}

#[derive(Serialize)]
struct PacketLine<'a> {
    time: f64,
    station: &'a str,
    life: String,
    sequence: u32,
    blind: bool,
    agents: Vec<AgentLine>,
    messages: usize,
}

#[derive(Serialize)]
struct AgentLine {
    agent: u32,
    target: Option<u32>,
    x: f64,
    y: f64,
    vx: f64,
    vy: f64,
    height: f64,
    confidence: f64,
    crowded: bool,
}

impl From<&Report> for AgentLine {
    fn from(report: &Report) -> Self {
        Self {
            agent: report.agent.number,
            target: Some(report.target.0).filter(|target| *target != TargetId::ALONE.0),
            x: rounded(report.position.x),
            y: rounded(report.position.y),
            vx: rounded(report.velocity.x),
            vy: rounded(report.velocity.y),
            height: rounded(report.height_m),
            confidence: rounded(report.confidence),
            crowded: report.is_crowded,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Point2, Vector2};

    use super::*;
    use crate::method::agents::{AgentId, StationId};

    #[test]
    fn a_packet_is_one_line_and_an_agent_alone_has_no_target() {
        let folder = tempfile::tempdir().unwrap();
        let report = |number: u32, target: u32| Report {
            agent: AgentId { station: StationId(1), number },
            target: TargetId(target),
            position: Point2::new(1.0 / 3.0, -2.0),
            covariance: Matrix2::identity(),
            velocity: Vector2::new(0.5, 0.0),
            height_m: 1.7,
            looks: None,
            confidence: 0.75,
            is_crowded: false,
        };
        let reports = vec![report(1, 4), report(2, 0)];
        let packet = Packet {
            station: StationId(1),
            life: 255,
            sequence: 3,
            time_s: 1.5,
            reports,
            ..Packet::default()
        };
        let mut file = AgentsFile::new(folder.path());
        file.write(&packet, "cam1").unwrap();
        file.write(&Packet { is_blind: true, ..Packet::default() }, "cam0").unwrap();
        let text = std::fs::read_to_string(folder.path().join("agents.jsonl")).unwrap();
        let rest = r#""x":0.3333,"y":-2.0,"vx":0.5,"vy":0.0,"height":1.7,"confidence":0.75,"crowded":false}"#;
        let expected = format!(
            "{}{{\"agent\":1,\"target\":4,{rest},{{\"agent\":2,\"target\":null,{rest}],\"messages\":0}}\n{}\n",
            r#"{"time":1.5,"station":"cam1","life":"ff","sequence":3,"blind":false,"agents":["#,
            r#"{"time":0.0,"station":"cam0","life":"0","sequence":0,"blind":true,"agents":[],"messages":0}"#,
        );
        assert_eq!(text, expected);
    }
}
