//! Visits that an interrupted run left open, and the events that end them.

use std::collections::BTreeMap;
use std::path::Path;

use super::{Event, EventKind};
use crate::tracks::jsonl::rounded;
use crate::{Result, TrackId};

/// People who were in the room when a run was interrupted, from its `events.jsonl`.
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
    /// Reads the file; `None` without one. Lines that are no events are ignored.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub(super) fn read(path: &Path) -> Result<Option<Self>> {
        if !path.exists() {
            return Ok(None);
        }
        let mut visits = Self::default();
        for line in calib::files::read_text(path)?.lines() {
            if let Ok(event) = serde_json::from_str(line) {
                visits.add(&event);
            }
        }
        Ok(Some(visits))
    }

    fn add(&mut self, event: &Event) {
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

    /// The events that end everything at a time: nobody knows where the people went.
    pub(super) fn ended(&self, frame: u32, time_s: f64, clock: Option<&str>) -> Vec<Event> {
        let time = rounded(time_s);
        let mut events = Vec::new();
        for visit in self.people.values() {
            let end = Event {
                time: time.max(visit.last.time),
                frame: frame.max(visit.last.frame),
                seconds: None,
                direction: None,
                clock: clock.map(str::to_owned),
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

    /// Number of people.
    pub(super) fn len(&self) -> usize {
        self.people.len()
    }
}
