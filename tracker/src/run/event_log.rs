//! Events of a run, from the same lines as `tracks.jsonl`.

use super::output::{Output, ProcessedMoment};
use crate::Moment;
use crate::Result;
use crate::events::{Clock, EventFiles};
use crate::prepared_room::PreparedRoom;
use crate::tracks::jsonl::FrameLine;

/// Writer of the event files of a run.
pub struct EventLog {
    files: EventFiles,
    cameras: Vec<String>,
    clock: Option<Clock>,
}

impl EventLog {
    /// Writes these files, with the time of day if the clock is known.
    pub fn new(files: EventFiles, prepared: &PreparedRoom, clock: Option<Clock>) -> Self {
        Self { files, cameras: prepared.cameras.iter().map(|c| c.name.clone()).collect(), clock }
    }
}

impl Output for EventLog {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        let (set_aside, clock) = (followed.set_aside(), self.clock.as_ref());
        let line = FrameLine::new(frame, time_s, followed.people, &self.cameras, &set_aside, clock);
        self.files.step(&line)
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.files.finish()
    }
}
