//! Counts of people by place, and `counts.csv`.

use std::fmt::Write;

use scenes::room::Room;

use super::{Direction, Event, EventKind};

/// Name of the whole room among the counts.
const WHOLE_ROOM: &str = "room";
/// Largest number of intervals that are written without anything in them: a leap of the clock must not fill a disk.
const MOST_EMPTY: f64 = 100_000.0;

/// People who came in and went out of one place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlaceCount {
    /// Number of people who came in: appeared in the room, entered the zone or region, crossed the line inward.
    pub entered: i64,
    /// Number of people who went out.
    pub left: i64,
}

impl PlaceCount {
    /// Number of people inside; of a line, the balance of both directions.
    pub fn inside(&self) -> i64 {
        self.entered - self.left
    }
}

/// Counts of the whole room and of every zone, region and line, from events.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tally {
    /// The room, zones, regions, lines, in the order of the file; zones of one name are one place.
    places: Vec<(String, PlaceCount)>,
}

impl Tally {
    /// Counts of a room in which nobody has been yet.
    pub fn new(room: &Room) -> Self {
        let zones = room.zones.iter().map(|zone| &zone.name);
        let names =
            zones.chain(room.regions.iter().map(|r| &r.name)).chain(room.lines.iter().map(|l| &l.name));
        let mut places = vec![(WHOLE_ROOM.to_owned(), PlaceCount::default())];
        for name in names {
            if !places.iter().skip(1).any(|(other, _)| other == name) {
                places.push((name.clone(), PlaceCount::default()));
            }
        }
        Self { places }
    }

    /// The same counts for the places of another room, by their names.
    pub(crate) fn of_places(&self, room: &Room) -> Self {
        let mut other = Self::new(room);
        let (whole, places) = other.places.split_at_mut(1);
        let known = |name: &str| self.places.iter().skip(1).find(|(own, _)| own == name);
        for ((_, count), (_, own)) in whole.iter_mut().zip(&self.places) {
            *count = *own;
        }
        for (name, count) in places {
            *count = known(name).map_or_else(PlaceCount::default, |(_, own)| *own);
        }
        other
    }

    /// Counts an event; one that is taken back is subtracted.
    pub fn add(&mut self, event: &Event) {
        let taken_back = event.taken_back();
        let (event, one) = taken_back.as_ref().map_or((event, 1), |event| (event, -1));
        let (is_room, is_inward) = match (event.kind, event.direction) {
            (EventKind::Appear, _) => (true, true),
            (EventKind::Disappear, _) => (true, false),
            (EventKind::Enter, _) | (EventKind::Cross, Some(Direction::In)) => (false, true),
            (EventKind::Leave, _) | (EventKind::Cross, Some(Direction::Out)) => (false, false),
            _ => return,
        };
        let place = if is_room {
            self.places.first_mut()
        } else {
            self.places.iter_mut().skip(1).find(|(name, _)| Some(name) == event.place.as_ref())
        };
        if let Some((_, count)) = place {
            *(if is_inward { &mut count.entered } else { &mut count.left }) += one;
        }
    }

    /// Counts by place: the whole room under the name `room`, then zones, regions and lines.
    pub fn places(&self) -> impl Iterator<Item = (&str, PlaceCount)> {
        self.places.iter().map(|(name, count)| (name.as_str(), *count))
    }
}

/// Rows of `counts.csv`, interval by interval.
///
/// An event is dated back to when it happened, and may be taken back. So an interval's rows are made `settle_s` after
/// its end; what is decided even later is counted in the next interval.
#[derive(Debug, Clone)]
pub(super) struct CountRows {
    every_s: f64,
    settle_s: f64,
    /// End of the current interval, seconds; `None` before the first line.
    end_s: Option<f64>,
    waiting: Vec<Event>,
    before: Tally,
    now: Tally,
}

impl CountRows {
    pub(super) const HEADER: &str = "time,where,inside,in,out\n";

    pub(super) fn new(room: &Room, every_s: f64, settle_s: f64) -> Self {
        let tally = Tally::new(room);
        Self { every_s, settle_s, end_s: None, waiting: Vec::new(), before: tally.clone(), now: tally }
    }

    /// Takes the events that are decided at a time; rows of the intervals that are settled.
    pub(super) fn step(&mut self, time_s: f64, events: &[Event]) -> String {
        self.waiting.extend_from_slice(events);
        let mut rows = String::new();
        let mut end_s = *self.end_s.get_or_insert(time_s + self.every_s);
        if time_s - end_s > MOST_EMPTY * self.every_s {
            // The clock leapt ahead: all waiting events are older than the new interval.
            end_s = time_s - self.settle_s;
        }
        while time_s >= end_s + self.settle_s {
            rows += &self.rows(end_s, |event| event.time <= end_s);
            end_s += self.every_s;
        }
        self.end_s = Some(end_s);
        rows
    }

    /// Rows of the rest: whole intervals, and the begun one until `last_s`.
    pub(super) fn finish(&mut self, last_s: f64, events: &[Event]) -> String {
        let mut rows = self.step(last_s, events);
        while let Some(end_s) = self.end_s.filter(|end_s| *end_s < last_s) {
            rows += &self.rows(end_s, |event| event.time <= end_s);
            self.end_s = Some(end_s + self.every_s);
        }
        if self.end_s.is_some() {
            rows += &self.rows(last_s, |_| true);
        }
        rows
    }

    /// Counts events that happened before the first interval.
    pub(super) fn begin_with(&mut self, events: &[Event]) {
        for event in events {
            self.now.add(event);
        }
        self.before = self.now.clone();
    }

    /// Takes events that are decided between two lines.
    pub(super) fn wait(&mut self, events: &[Event]) {
        self.waiting.extend_from_slice(events);
    }

    /// Ends the interval; the next line begins one.
    pub(super) fn pause(&mut self) {
        self.end_s = None;
    }

    /// Goes on with the places of a changed room.
    pub(super) fn replace_room(&mut self, room: &Room) {
        (self.before, self.now) = (self.before.of_places(room), self.now.of_places(room));
    }

    fn rows(&mut self, end_s: f64, is_due: impl Fn(&Event) -> bool) -> String {
        let (due, waiting) = std::mem::take(&mut self.waiting).into_iter().partition(is_due);
        self.waiting = waiting;
        let due: Vec<Event> = due;
        for event in &due {
            self.now.add(event);
        }
        let mut rows = String::new();
        for ((name, now), (_, before)) in self.now.places().zip(self.before.places()) {
            let (entered, left) = (now.entered - before.entered, now.left - before.left);
            let time = (end_s * 1e4).round() / 1e4;
            // Writing to a string cannot fail.
            let _ = writeln!(rows, "{time},{},{},{entered},{left}", csv_field(name), now.inside());
        }
        self.before = self.now.clone();
        rows
    }
}

/// A text as a field of a CSV file (RFC 4180).
pub(super) fn csv_field(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
