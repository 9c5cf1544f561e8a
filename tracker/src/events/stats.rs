//! The day of a run, from its event files: in words, and as CSV.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use super::event::EVENTS;
use super::files::{COUNTS, GROUPS};
use super::tally::csv_field;
use super::words::{count, duration};

use super::{CameraState, Clock, Direction, Event, EventKind};
use crate::{Error, Result, TrackId};

/// Name of the whole room among the counts.
const WHOLE_ROOM: &str = "room";

/// Statistics of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct DayStats {
    /// Begin and end of the counts, seconds.
    pub span_s: (f64, f64),
    /// Time of day, if the run knows it.
    pub clock: Option<Clock>,
    /// Appearances and disappearances.
    pub room: PlaceStats,
    /// Zones, regions and lines, in the order of `counts.csv`.
    pub places: Vec<(String, PlaceStats)>,
    /// Number of people in each group.
    pub groups: Vec<usize>,
    /// Faults of cameras: name, state, begin, end; `None` if it lasted.
    pub faults: Vec<(String, CameraState, f64, Option<f64>)>,
}

/// Statistics of one place.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlaceStats {
    /// Times at which somebody came in, ascending, seconds.
    pub entries_s: Vec<f64>,
    /// Times at which somebody went out, ascending.
    pub exits_s: Vec<f64>,
    /// Duration of each finished stay, its person and its end; ascending by duration.
    pub stays: Vec<Stay>,
    /// Number of stays that were longer than the region's `dwell_s`.
    pub dwelt: usize,
    /// Whether people cross it: a line.
    pub is_line: bool,
}

/// A finished stay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stay {
    /// Duration, seconds.
    pub seconds: f64,
    /// The person's track.
    pub id: Option<TrackId>,
    /// Time of the end, seconds.
    pub until_s: f64,
}

impl PlaceStats {
    /// Mean duration of a stay, seconds; `None` without stays.
    pub fn mean_s(&self) -> Option<f64> {
        (!self.stays.is_empty())
            .then(|| self.stays.iter().map(|stay| stay.seconds).sum::<f64>() / self.stays.len() as f64)
    }

    /// Median duration of a stay, seconds.
    pub fn median_s(&self) -> Option<f64> {
        self.stays.get(self.stays.len() / 2).map(|stay| stay.seconds)
    }

    /// People still inside at the end.
    fn left_over(&self) -> i64 {
        self.entries_s.len() as i64 - self.exits_s.len() as i64
    }

    /// Largest number of people inside, and the first time of it.
    pub(crate) fn most(&self) -> Option<(usize, f64)> {
        let (mut most, mut exits) = (None, self.exits_s.iter().peekable());
        let mut inside = 0_usize;
        for entry_s in &self.entries_s {
            while exits.next_if(|exit_s| *exit_s <= entry_s).is_some() {
                inside = inside.saturating_sub(1);
            }
            inside += 1;
            if most.is_none_or(|(number, _)| inside > number) {
                most = Some((inside, *entry_s));
            }
        }
        most
    }
}

impl DayStats {
    /// Statistics of a run's folder.
    ///
    /// # Errors
    /// Missing or malformed event files, with the mend.
    pub fn read(out: &Path) -> Result<Self> {
        let events = events(&out.join(EVENTS))?;
        let (names, span_s) = counts(&out.join(COUNTS))?;
        let mut stats = Self {
            span_s,
            clock: events.iter().find_map(|event| Clock::of_moment(event.clock.as_deref()?, event.time)),
            room: PlaceStats::default(),
            places: names.into_iter().map(|name| (name, PlaceStats::default())).collect(),
            groups: groups(&out.join(GROUPS))?,
            faults: Vec::new(),
        };
        for event in &events {
            stats.add(event);
        }
        for place in std::iter::once(&mut stats.room).chain(stats.places.iter_mut().map(|(_, p)| p)) {
            place.entries_s.sort_by(f64::total_cmp);
            place.exits_s.sort_by(f64::total_cmp);
            place.stays.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
        }
        Ok(stats)
    }

    fn add(&mut self, event: &Event) {
        let name = event.place.clone().unwrap_or_default();
        if event.kind == EventKind::Camera {
            self.add_camera(event, name);
            return;
        }
        if matches!(event.kind, EventKind::Appear | EventKind::Disappear) {
            let is_entry = event.kind == EventKind::Appear;
            (if is_entry { &mut self.room.entries_s } else { &mut self.room.exits_s }).push(event.time);
            return;
        }
        let index = self.places.iter().position(|(other, _)| *other == name).unwrap_or_else(|| {
            self.places.push((name, PlaceStats::default()));
            self.places.len() - 1
        });
        let place = &mut self.places[index].1;
        match event.kind {
            EventKind::Enter => place.entries_s.push(event.time),
            EventKind::Leave => {
                place.exits_s.push(event.time);
                let seconds = event.seconds.unwrap_or(0.0);
                place.stays.push(Stay { seconds, id: event.id, until_s: event.time });
            }
            EventKind::Cross => {
                place.is_line = true;
                let is_inward = event.direction == Some(Direction::In);
                (if is_inward { &mut place.entries_s } else { &mut place.exits_s }).push(event.time);
            }
            EventKind::Dwell => place.dwelt += 1,
            EventKind::Appear | EventKind::Disappear | EventKind::Camera | EventKind::Revoke => {}
        }
    }

    fn add_camera(&mut self, event: &Event, name: String) {
        if let Some(open) = self.faults.iter_mut().rfind(|fault| fault.0 == name && fault.3.is_none()) {
            open.3 = Some(event.time);
        }
        if let Some(state) = event.state.filter(|state| *state != CameraState::Back) {
            self.faults.push((name, state, event.time, None));
        }
    }

    /// The day in words.
    pub fn text(&self) -> String {
        let mut lines = vec![format!(
            "{} to {} ({})",
            self.time(self.span_s.0),
            self.time(self.span_s.1),
            duration(self.span_s.1 - self.span_s.0)
        )];
        let (came, went) = (self.room.entries_s.len(), self.room.exits_s.len());
        let mut people = match count(came, "person", "people") {
            _ if came + went == 0 => "People: nobody came".to_owned(),
            came => format!("People: {came} came and {went} went"),
        };
        if self.room.left_over() > 0 {
            let _ = write!(people, "; {} still there at the end", self.room.left_over());
        }
        if let Some((most, at_s)) = self.room.most() {
            let _ = write!(people, "; at most {most} at once, first at {}", self.time(at_s));
        }
        lines.push(people + ".");
        if let Some((from_s, to_s, number)) = self.busiest(&self.room.entries_s) {
            let span = format!("{} to {}", self.time(from_s), self.time(to_s));
            lines.push(format!("Busiest: {span}, when {number} came."));
        }
        for (name, place) in &self.places {
            lines.push(if place.is_line { self.line_text(name, place) } else { self.area_text(name, place) });
        }
        lines.push(self.groups_text());
        for (camera, state, from_s, to_s) in &self.faults {
            let state = format!("{state:?}").to_lowercase();
            let until = to_s.map_or("the end".to_owned(), |to_s| self.time(to_s));
            lines.push(format!("Camera {camera}: {state} from {} to {until}.", self.time(*from_s)));
        }
        lines.join("\n") + "\n"
    }

    fn area_text(&self, name: &str, place: &PlaceStats) -> String {
        let (Some(mean_s), Some(longest)) = (place.mean_s(), place.stays.last()) else {
            return match place.left_over() {
                0 => format!("{name}: nobody."),
                n => format!("{name}: {n} there at the end."),
            };
        };
        let stays = count(place.stays.len(), "stay", "stays");
        let who = longest.id.map_or(String::new(), |id| format!("person {id}, "));
        let from = self.time(longest.until_s - longest.seconds);
        let mut text = format!(
            "{name}: {stays}, {} on average; the longest {} ({who}from {from})",
            duration(mean_s),
            duration(longest.seconds)
        );
        if place.dwelt > 0 {
            let _ = write!(text, "; {} longer than its dwell_s", count(place.dwelt, "was", "were"));
        }
        if place.left_over() > 0 {
            let _ = write!(text, "; {} there at the end", place.left_over());
        }
        text + "."
    }

    fn line_text(&self, name: &str, place: &PlaceStats) -> String {
        let (entered, left) = (place.entries_s.len(), place.exits_s.len());
        let mut text = format!("{name}: {entered} in, {left} out, balance {}", place.left_over());
        if let Some((from_s, to_s, number)) = self.busiest(&place.entries_s) {
            let _ = write!(text, "; most in from {} to {} ({number})", self.time(from_s), self.time(to_s));
        }
        text + "."
    }

    fn groups_text(&self) -> String {
        let mut sizes: BTreeMap<usize, usize> = BTreeMap::new();
        for size in &self.groups {
            *sizes.entry(*size).or_default() += 1;
        }
        if sizes.is_empty() {
            return "Groups: nobody walked together.".into();
        }
        let each: Vec<String> = sizes
            .iter()
            .map(|(size, number)| match size {
                2 => count(*number, "pair", "pairs"),
                size => format!("{} of {size}", count(*number, "group", "groups")),
            })
            .collect();
        format!("Groups: {} walked together.", each.join(", "))
    }

    /// The interval in which most of these times lie: an hour, or less in shorter runs; `None` where the run is as short
    /// as one interval.
    fn busiest(&self, times_s: &[f64]) -> Option<(f64, f64, usize)> {
        /// Least number of intervals in a run.
        const INTERVALS: f64 = 4.0;
        let span_s = self.span_s.1 - self.span_s.0;
        let width_s = [3600.0, 900.0, 300.0, 60.0].into_iter().find(|width| span_s >= INTERVALS * width)?;
        // Intervals begin at whole hours of the day, if it is known.
        let first_s = self.clock.map_or(self.span_s.0, |clock| -clock.seconds_of_day(0.0));
        let mut numbers: BTreeMap<i64, usize> = BTreeMap::new();
        for time_s in times_s {
            *numbers.entry(((time_s - first_s) / width_s).floor() as i64).or_default() += 1;
        }
        // The first of the largest.
        let (index, number) = numbers.into_iter().rev().max_by_key(|(_, number)| *number)?;
        let from_s = first_s + index as f64 * width_s;
        Some((from_s, from_s + width_s, number))
    }

    /// A time of the run for people: time of day, or time since its beginning.
    fn time(&self, time_s: f64) -> String {
        let seconds = match &self.clock {
            Some(clock) => clock.seconds_of_day(time_s),
            None => time_s.max(0.0),
        };
        let whole = seconds as u64;
        format!("{:02}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
    }

    /// The day as CSV: a row for the whole room, each zone, region and line.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "where,in,out,at_end,most_inside,stays,mean_s,median_s,longest_s,dwelt,busiest_from,busiest_in\n",
        );
        let room = (WHOLE_ROOM.to_owned(), self.room.clone());
        for (name, place) in std::iter::once(&room).chain(&self.places) {
            let seconds = |value: Option<f64>| value.map_or(String::new(), |s| format!("{s:.2}"));
            let busiest = self.busiest(&place.entries_s);
            // The balance of a line is no number of people.
            let most = place.most().filter(|_| !place.is_line).map_or(String::new(), |m| m.0.to_string());
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{},{},{},{most},{},{},{},{},{},{},{}",
                csv_field(name),
                place.entries_s.len(),
                place.exits_s.len(),
                place.left_over(),
                place.stays.len(),
                seconds(place.mean_s()),
                seconds(place.median_s()),
                seconds(place.stays.last().map(|stay| stay.seconds)),
                place.dwelt,
                busiest.map_or(String::new(), |(from_s, ..)| self.time(from_s)),
                busiest.map_or(String::new(), |(.., number)| number.to_string()),
            );
        }
        text
    }
}

/// Events of a file without those that were taken back.
fn events(path: &Path) -> Result<Vec<Event>> {
    let mut events: Vec<Event> = Vec::new();
    for (index, line) in text_of(path)?.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let place = || format!("line {}", index + 1);
        let event: Event = serde_json::from_str(line).map_err(|e| {
            Error::content(path, place(), format!("is no event as `tracker` writes it ({e})"))
        })?;
        match event.taken_back() {
            Some(taken_back) => {
                if let Some(i) = events.iter().rposition(|other| *other == taken_back) {
                    events.remove(i);
                }
            }
            None => events.push(event),
        }
    }
    Ok(events)
}

/// Names of the places in a `counts.csv`, the whole room left out, and the begin and end of the counts.
fn counts(path: &Path) -> Result<(Vec<String>, (f64, f64))> {
    let mut names: Vec<String> = Vec::new();
    let mut times_s: Vec<f64> = Vec::new();
    for (index, line) in text_of(path)?.lines().enumerate().skip(1) {
        let fail =
            || Error::content(path, format!("line {}", index + 1), "is no row of time,where,inside,in,out");
        let (time, rest) = line.split_once(',').ok_or_else(fail)?;
        let time_s: f64 = time.parse().map_err(|_| fail())?;
        // The last three columns are numbers; the name may hold commas.
        let name = rest.rsplitn(4, ',').nth(3).ok_or_else(fail)?;
        let name = match name.strip_prefix('"').and_then(|name| name.strip_suffix('"')) {
            Some(quoted) => quoted.replace("\"\"", "\""),
            None => name.to_owned(),
        };
        if times_s.last().is_none_or(|last| *last < time_s) {
            times_s.push(time_s);
        }
        if name != WHOLE_ROOM && times_s.len() == 1 {
            names.push(name);
        }
    }
    let last_s = times_s.last().copied().unwrap_or(0.0);
    // Rows stand at the ends of their intervals, of which the last may be a shorter one.
    let first_s = if times_s.len() > 2 { 2.0 * times_s[0] - times_s[1] } else { 0.0 };
    Ok((names, (first_s.min(last_s), last_s)))
}

/// Sizes of the groups in a `groups.csv`; none where there is no such file.
fn groups(path: &Path) -> Result<Vec<usize>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let size = |(index, line): (usize, &str)| {
        let people = line.split(',').nth(2).and_then(|people| people.parse().ok());
        people.ok_or_else(|| {
            Error::content(path, format!("line {}", index + 1), "is no row of first,last,people,ids")
        })
    };
    text_of(path)?.lines().enumerate().skip(1).map(size).collect()
}

fn text_of(path: &Path) -> Result<String> {
    if !path.exists() {
        let problem = "there is no such file; make it with `tracker events OUT --room DIR`";
        return Err(Error::content(path, "whole file", problem));
    }
    Ok(calib::files::read_text(path)?)
}
