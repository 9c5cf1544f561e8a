//! Packets that the stations of a distributed method exchange in a run: `agents/agents.jsonl`, and the paper's figures.

use std::path::{Path, PathBuf};

use super::{Output, ProcessedMoment};
use crate::Result;
use crate::method::agents::AgencyRecord;
use crate::prepared_room::PreparedRoom;
use crate::tracks::{AgentsFile, Persistence};
use crate::wire::packet;

/// Folder of the log in that of the run.
const FOLDER: &str = "agents";

/// Log of the packets of all stations: a file that grows during the run, and figures at its end, in the folder
/// `agents`.
#[derive(Debug)]
pub struct AgencyLog {
    folder: PathBuf,
    /// Names of the stations' cameras, by station number.
    names: Vec<String>,
    file: AgentsFile,
    record: AgencyRecord,
    bytes: usize,
    span_s: Option<[f64; 2]>,
}

impl AgencyLog {
    /// Log of a run that writes to the folder `out`.
    pub fn new(out: &Path, room: &PreparedRoom) -> Self {
        let folder = out.join(FOLDER);
        Self {
            file: AgentsFile::new(&folder),
            names: room.cameras.iter().map(|camera| camera.name.clone()).collect(),
            folder,
            record: AgencyRecord::default(),
            bytes: 0,
            span_s: None,
        }
    }
}

impl AgencyLog {
    /// The same log, whose file is kept in this way.
    #[must_use]
    pub fn kept(self, persistence: &Persistence) -> Self {
        Self { file: self.file.kept(persistence), ..self }
    }
}

impl Output for AgencyLog {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let time_s = followed.moment.time_s;
        self.span_s = Some([self.span_s.map_or(time_s, |[first, _]| first), time_s]);
        for packet in followed.packets {
            let name = self.names.get(usize::from(packet.station.0)).map_or("?", String::as_str);
            self.file.write(packet, name)?;
            self.record.extend(packet);
            // A packet that cannot be encoded would not be sent.
            self.bytes += packet::encode(packet, packet.time_s).map_or(0, |bytes| bytes.len());
        }
        Ok(())
    }

    fn move_to(&mut self, out: &Path) -> Result<()> {
        self.record.write(&self.folder, &self.names)?;
        self.folder = out.join(FOLDER);
        self.file.move_to(&self.folder);
        (self.record, self.bytes, self.span_s) = (AgencyRecord::default(), 0, None);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        if let Some([first_s, last_s]) = self.span_s.filter(|[first_s, last_s]| last_s > first_s)
            && self.names.len() > 1
        {
            let kb_s = 1e-3 * self.bytes as f64 / (last_s - first_s) / self.names.len() as f64;
            tracing::info!("each station would send {kb_s:.2} kB/s to each neighbour");
        }
        self.record.write(&self.folder, &self.names)
    }
}
