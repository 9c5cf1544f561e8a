//! Events of a run, from the same lines as `tracks.jsonl`; or their absence.

use std::path::{Path, PathBuf};

use scenes::room::Room;

use super::output::{Output, ProcessedMoment};
use crate::Moment;
use crate::Result;
use crate::events::{self, Clock, Event, EventFiles};
use crate::prepared_room::PreparedRoom;
use crate::tracks::frame_line;

/// Writer of the event files of a run.
pub struct EventLog {
    files: EventFiles,
    cameras: Vec<String>,
    clock: Option<Clock>,
    listener: Option<EventListener>,
}

/// Callback that receives events after they have been written.
pub type EventListener = Box<dyn FnMut(&[Event])>;

impl EventLog {
    /// Writes these files, with the time of day if the clock is known.
    pub fn new(files: EventFiles, prepared: &PreparedRoom, clock: Option<Clock>) -> Self {
        Self {
            files,
            cameras: prepared.cameras.iter().map(|c| c.name.clone()).collect(),
            clock,
            listener: None,
        }
    }

    /// The same log, which passes its events on.
    #[must_use]
    pub fn with_listener(self, listener: EventListener) -> Self {
        Self { listener: Some(listener), ..self }
    }

    fn tell(&mut self, events: &[Event]) {
        if let Some(listener) = self.listener.as_mut().filter(|_| !events.is_empty()) {
            listener(events);
        }
    }
}

impl Output for EventLog {
    fn put(&mut self, followed: &ProcessedMoment<'_>) -> Result<()> {
        let Moment { frame, time_s, .. } = followed.moment;
        let (set_aside, clock) = (followed.set_aside(), self.clock.as_ref());
        let line = frame_line(frame, time_s, followed.people, &self.cameras, &set_aside, clock);
        let events = self.files.step(&line)?;
        self.tell(&events);
        Ok(())
    }

    fn move_to(&mut self, out: &Path) -> Result<()> {
        self.files.move_to(out)
    }

    fn replace_room(&mut self, room: &Room) -> Result<()> {
        let events = self.files.replace_room(room)?;
        self.tell(&events);
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.files.finish()
    }
}

/// Remover of an earlier run's event files, for a run that writes none: with the first frame, when the earlier tracks are
/// replaced, too.
pub struct NoEvents {
    /// Folder of the run; `None` once the files are gone.
    out: Option<PathBuf>,
}

impl NoEvents {
    /// Remover for the folder of a run.
    pub fn new(out: PathBuf) -> Self {
        Self { out: Some(out) }
    }

    fn remove(&mut self) -> Result<()> {
        self.out.take().map_or(Ok(()), |out| events::remove(&out))
    }
}

impl Output for NoEvents {
    fn put(&mut self, _followed: &ProcessedMoment<'_>) -> Result<()> {
        self.remove()
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.remove()
    }
}
