//! Visits that an interrupted run left open, and the events that end them.

use std::collections::BTreeMap;
use std::path::Path;

use calib::files::write_atomic;
use mot::jsonl::{self, FrameLine, rounded};

use super::event::EVENTS;
use super::{Event, EventKind};
use crate::tracks::{LineFile, Persistence, last_line};
use crate::{Result, TrackId};

/// File of the events that had begun what was open at the folder's first line, where files go on from folder to folder.
const OPEN: &str = "open_stays.jsonl";

/// People who are in the room, with the events that have begun their stays.
#[derive(Debug, Clone, Default)]
pub(super) struct OpenVisits {
    people: BTreeMap<TrackId, OpenVisit>,
}

#[derive(Debug, Clone)]
struct OpenVisit {
    appeared: Event,
    /// Zones and regions in which the person is, with the event of entering.
    inside: BTreeMap<String, Event>,
    last: Event,
}

impl OpenVisits {
    /// Visits that the run in a folder left open. Lines that are no events are ignored.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let mut visits = Self::default();
        for path in [OPEN, EVENTS].map(|name| folder.join(name)).into_iter().filter(|path| path.exists()) {
            for line in calib::files::read_text(&path)?.lines() {
                if let Ok(event) = serde_json::from_str(line) {
                    visits.add(&event);
                }
            }
        }
        Ok(visits)
    }

    /// Writes what is open at the beginning of a folder's files, so that a run that is interrupted there can be ended.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        if self.people.is_empty() {
            return Ok(());
        }
        let path = folder.join(OPEN);
        let lines = self.begun().iter().map(|event| event.text(&path)).collect::<Result<String>>()?;
        std::fs::create_dir_all(folder).map_err(crate::Error::io(folder))?;
        Ok(write_atomic(&path, lines.as_bytes())?)
    }

    /// Ends in a folder's events what the run in it left open, with its last line.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub(super) fn end_in(folder: &Path, persistence: &Persistence) -> Result<()> {
        let open = Self::read(folder)?;
        if open.people.is_empty() {
            return Ok(());
        }
        let path = folder.join(EVENTS);
        let ended = open.ended(last_row(folder)?.as_ref());
        let lines = ended.iter().map(|event| event.text(&path)).collect::<Result<String>>()?;
        LineFile::new(path).kept(persistence).append(&lines)
    }

    /// Takes the next event of the run.
    pub(super) fn add(&mut self, event: &Event) {
        let Some(id) = event.id else { return };
        let taken_back = event.taken_back();
        let (event, is_revoked) = taken_back.as_ref().map_or((event, false), |event| (event, true));
        // An entering that did not happen leaves the state as a leaving does, and the other way round.
        let kind = match (event.kind, is_revoked) {
            (EventKind::Appear, true) | (EventKind::Disappear, false) => EventKind::Disappear,
            (EventKind::Appear, false) | (EventKind::Disappear, true) => EventKind::Appear,
            (EventKind::Enter, true) | (EventKind::Leave, false) => EventKind::Leave,
            (EventKind::Enter, false) | (EventKind::Leave, true) => EventKind::Enter,
            (kind, _) => kind,
        };
        let place = event.place.clone().unwrap_or_default();
        match kind {
            EventKind::Appear => {
                let (appeared, last) = (event.clone(), event.clone());
                self.people.insert(id, OpenVisit { appeared, inside: BTreeMap::new(), last });
            }
            EventKind::Disappear => {
                self.people.remove(&id);
            }
            EventKind::Enter | EventKind::Leave | EventKind::Dwell | EventKind::Cross => {
                let Some(visit) = self.people.get_mut(&id) else { return };
                visit.last = event.clone();
                if kind == EventKind::Leave {
                    visit.inside.remove(&place);
                } else if kind == EventKind::Enter {
                    visit.inside.insert(place, event.clone());
                }
            }
            EventKind::Camera | EventKind::Revoke => {}
        }
    }

    /// The events that have begun what is open.
    pub(super) fn begun(&self) -> Vec<Event> {
        let visits = self.people.values();
        visits
            .flat_map(|visit| std::iter::once(&visit.appeared).chain(visit.inside.values()))
            .cloned()
            .collect()
    }

    /// The events that end everything with the last line of a run: nobody knows where the people went.
    pub(super) fn ended(&self, last: Option<&FrameLine>) -> Vec<Event> {
        let (frame, time) = last.map_or((0, 0.0), |last| (last.frame, rounded(last.time)));
        let mut events = Vec::new();
        for visit in self.people.values() {
            let end = Event {
                time: time.max(visit.last.time),
                frame: frame.max(visit.last.frame),
                seconds: None,
                direction: None,
                clock: last.and_then(|last| last.clock.clone()).or_else(|| visit.last.clock.clone()),
                ..visit.last.clone()
            };
            for (place, entered) in &visit.inside {
                events.push(Event {
                    kind: EventKind::Leave,
                    place: Some(place.clone()),
                    seconds: Some(rounded((end.time - entered.time).max(0.0))),
                    ..end.clone()
                });
            }
            events.push(Event { kind: EventKind::Disappear, place: None, ..end });
        }
        events
    }

    /// Number of people in the room.
    pub(super) fn len(&self) -> usize {
        self.people.len()
    }
}

/// Last line of the tracks in a folder.
///
/// # Errors
/// A file that cannot be read.
pub(super) fn last_row(folder: &Path) -> Result<Option<FrameLine>> {
    Ok(last_line(&folder.join(jsonl::NAME))?.and_then(|line| serde_json::from_str(&line).ok()))
}
