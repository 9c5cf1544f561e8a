//! `agents.jsonl`: a line a packet, with what each agent of a station saw.

use std::path::Path;

use serde_json::{Value, json};

use super::jsonl::rounded;
use super::line_file::LineFile;
use crate::Result;
use crate::method::agents::{Packet, Report, TargetId};

/// The file, which grows packet by packet.
#[derive(Debug)]
pub struct AgentsFile(LineFile);

impl AgentsFile {
    /// The file in the folder `out`; made with its first line.
    pub fn new(out: &Path) -> Self {
        Self(LineFile::new(out.join("agents.jsonl")))
    }

    /// Appends a packet of the station of a camera:
    /// `{"time":1.5,"station":"cam0","life":"9f02","sequence":12,"blind":false,"agents":[{"agent":3,"target":2,"x":1.2,
    /// "y":0.4,"vx":0.1,"vy":0.0,"height":1.7,"confidence":0.97,"crowded":false}],"messages":0}`; the target of an agent
    /// that tracks alone is null.
    ///
    /// # Errors
    /// [`crate::Error::Io`] naming the file.
    pub fn write(&mut self, packet: &Packet, camera: &str) -> Result<()> {
        let line = json!({
            "time": (packet.time_s * 1e6).round() / 1e6,
            "station": camera,
            "life": format!("{:x}", packet.life),
            "sequence": packet.sequence,
            "blind": packet.is_blind,
            "agents": packet.reports.iter().map(agent).collect::<Vec<_>>(),
            "messages": packet.messages.len(),
        });
        self.0.append(&format!("{line}\n"))
    }
}

fn agent(report: &Report) -> Value {
    json!({
        "agent": report.agent.number,
        "target": Some(report.target.0).filter(|target| *target != TargetId::ALONE.0),
        "x": rounded(report.position.x),
        "y": rounded(report.position.y),
        "vx": rounded(report.velocity.x),
        "vy": rounded(report.velocity.y),
        "height": rounded(report.height_m),
        "confidence": rounded(report.confidence),
        "crowded": report.is_crowded,
    })
}
