//! `people.jsonl` and `events.jsonl` of a site, in a folder a day.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::Serialize;

use super::site_ids::Named;
use super::{Day, PersonKey, RoomJournal, SiteIds, SitePerson};
use crate::events::Event;
use crate::source::utc_s;
use crate::tracks::{LineFile, Persistence};
use crate::{Error, Result};

const PEOPLE: &str = "people.jsonl";
const EVENTS: &str = "events.jsonl";

/// Site-wide ids, and the files that hold them.
///
/// `people.jsonl` has a line for each person of a room whose id in the site is decided: the latest line of a room's person
/// holds. `events.jsonl` has the events of all rooms, each with `room` and `site_id`.
#[derive(Debug)]
pub struct SiteFiles {
    ids: SiteIds,
    journal: RoomJournal,
    rooms: Vec<String>,
    people: LineFile,
    events: LineFile,
    day: Day,
    /// Events of people whose id is still to be decided.
    held: Vec<(PersonKey, Event)>,
}

/// A line of the site's `events.jsonl`.
#[derive(Debug, Serialize)]
struct SiteEvent<'a> {
    room: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    site_id: Option<u32>,
    #[serde(flatten)]
    event: &'a Event,
}

impl SiteFiles {
    /// Files in the folder `out`. `begin` makes the ids, from the number that it is given on.
    ///
    /// # Errors
    /// A folder that cannot be written, or whose state cannot be used.
    pub fn open(out: &Path, rooms: Vec<String>, begin: impl FnOnce(u32) -> SiteIds) -> Result<Self> {
        let day = Day::today();
        let journal = RoomJournal::open(out, day)?;
        let persistence = Persistence::lasting();
        let folder = day.folder(out);
        let file = |name: &str| LineFile::new(folder.join(name)).kept(&persistence);
        let (people, events) = (file(PEOPLE), file(EVENTS));
        let ids = begin(journal.next_id());
        Ok(Self { ids, journal, rooms, people, events, day, held: Vec::new() })
    }

    /// Replaces the rooms' names and the doors: everybody is forgotten, and gets a new id where they appear next.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn replace(&mut self, rooms: Vec<String>, begin: impl FnOnce(u32) -> SiteIds) -> Result<()> {
        self.flush(true)?;
        self.rooms = rooms;
        self.ids = begin(self.journal.next_id());
        Ok(())
    }

    /// Takes an event of a room, which happened at `time_s`, seconds since 1970.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn take(&mut self, room: usize, event: Event, time_s: f64) -> Result<()> {
        let named = self.ids.take(room, &event, time_s, utc_s(SystemTime::now()));
        self.write_people(&named)?;
        let id = event.id.unwrap_or(crate::TrackId(0));
        self.held.push((PersonKey { room, id }, event));
        self.flush(false)
    }

    /// Everybody of a room is gone, for the program that followed them has ended.
    pub fn lose_room(&mut self, room: usize) {
        self.ids.lose_room(room, utc_s(SystemTime::now()));
    }

    /// Takes the present height of a person, metres.
    pub fn see(&mut self, person: PersonKey, height_m: f64) {
        self.ids.see(person, height_m);
    }

    /// Decides what can be decided by now, and begins the folder of a new day. Call it about once a second.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn advance(&mut self) -> Result<()> {
        let day = Day::today();
        if day > self.day {
            self.day = day;
            let folder: PathBuf = day.folder(self.journal.out());
            self.people.move_to(folder.join(PEOPLE));
            self.events.move_to(folder.join(EVENTS));
        }
        let named = self.ids.advance(utc_s(SystemTime::now()));
        self.write_people(&named)?;
        self.flush(false)
    }

    /// Writes what is left.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(mut self) -> Result<()> {
        self.flush(true)?;
        self.journal.close()
    }

    fn write_people(&mut self, named: &[Named]) -> Result<()> {
        for Named { person, site_id, appeared_s } in named {
            self.journal.use_id(*site_id)?;
            let row = SitePerson {
                t: (appeared_s * 1e3).round() / 1e3,
                site_id: *site_id,
                room: self.rooms.get(person.room).map_or("", String::as_str),
                id: person.id,
            };
            let text = json(&row, self.people.path())?;
            self.people.append(&text)?;
        }
        Ok(())
    }

    /// Writes the held events whose people have ids, or all; those of one person stay in their order.
    fn flush(&mut self, all: bool) -> Result<()> {
        let mut lines = String::new();
        let mut held = Vec::new();
        for (person, event) in std::mem::take(&mut self.held) {
            if self.ids.is_pending(person) && !all {
                held.push((person, event));
                continue;
            }
            let room = self.rooms.get(person.room).map_or("", String::as_str);
            let row = SiteEvent { room, site_id: self.ids.of(person), event: &event };
            lines += &json(&row, self.events.path())?;
        }
        self.held = held;
        if lines.is_empty() { Ok(()) } else { self.events.append(&lines) }
    }
}

fn json(row: &impl Serialize, path: &Path) -> Result<String> {
    let text = serde_json::to_string(row)
        .map_err(|e| Error::content(path, "a row", format!("cannot be written ({e})")))?;
    Ok(text + "\n")
}
