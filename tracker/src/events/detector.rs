//! The detector: tracks, in the order of time, to events.

use std::collections::{BTreeMap, VecDeque};

use mot::jsonl::{FrameLine, PersonLine, rounded};
use nalgebra::{Point2, Vector2};
use scenes::room::{Line, Room};

use super::border::Area;
use super::cameras::Cameras;
use super::doors::{Doors, UnseenPart, UnseenWay};
use super::fix::Fix;
use super::gap::path_between;
use super::passing::{Crossed, Crossings, Decision, Stay};
use super::{Clock, Direction, Event, EventKind, EventOptions};
use crate::TrackId;

/// Time beyond [`EventOptions::lost_s`] for which the numbers of frames are kept, seconds: longer than an unseen way.
const FRAMES_S: f64 = 3.0;

/// Detector of a run's events: a pure state machine over the lines of `tracks.jsonl`.
///
/// Its memory grows with the number of people who were there within [`EventOptions::found_s`], not with the run.
#[derive(Debug, Clone)]
pub struct Events {
    options: EventOptions,
    doors: Doors,
    areas: Vec<Area>,
    lines: Vec<Line>,
    people: BTreeMap<TrackId, Visit>,
    cameras: Cameras,
    clock: Option<Clock>,
    /// Times of the first and the last line, seconds.
    first_s: Option<f64>,
    now_s: f64,
    /// Times and numbers of the latest frames, as far back as a gap of a track or an unseen way reaches.
    frames: VecDeque<(f64, u32)>,
}

/// A person between their appearance and their disappearance.
#[derive(Debug, Clone)]
struct Visit {
    first: Fix,
    /// Zone through which the person came.
    came_through: Option<String>,
    last: Fix,
    /// Velocity at the last fix, metres a second.
    velocity: Vector2<f64>,
    stays: Vec<Stay>,
    crossings: Vec<Crossings>,
    /// Events before the track was believed; `None` from then on.
    withheld: Option<Vec<Event>>,
    /// Events of the disappearance, while it may be taken back.
    ending: Option<Vec<Event>>,
}

impl Events {
    /// Detector for a room's zones, regions and lines.
    pub fn new(room: &Room, options: EventOptions) -> Self {
        Self {
            options,
            doors: Doors::new(&room.zones),
            areas: Area::of_room(room),
            lines: room.lines.clone(),
            people: BTreeMap::new(),
            cameras: Cameras::default(),
            clock: None,
            first_s: None,
            now_s: 0.0,
            frames: VecDeque::new(),
        }
    }

    /// Takes the next line of `tracks.jsonl`; returns the events that are decided now. Their times lie in the past: they
    /// are ordered by when they were decided.
    pub fn step(&mut self, line: &FrameLine) -> Vec<Event> {
        if self.clock.is_none() {
            self.clock = line.clock.as_deref().and_then(|clock| Clock::of_moment(clock, line.time));
        }
        self.now_s = line.time;
        self.first_s.get_or_insert(line.time);
        self.frames.push_back((line.time, line.frame));
        while self
            .frames
            .front()
            .is_some_and(|(time_s, _)| *time_s < line.time - self.options.lost_s - FRAMES_S)
        {
            self.frames.pop_front();
        }
        let mut events = Vec::new();
        for changed in self.cameras.step(line, self.options.camera_s) {
            events.push(Event {
                place: Some(changed.camera),
                state: Some(changed.state),
                ..self.event(EventKind::Camera, changed.frame, changed.time_s)
            });
        }
        for person in &line.people {
            events.extend(self.see(line, person));
        }
        events.extend(self.miss(line.time, self.options.lost_s));
        self.people.retain(|_, visit| line.time - visit.last.time_s <= self.options.found_s);
        events
    }

    /// Events of the end of the run: those who are missing by then have disappeared. People who are still there have
    /// not left; what they were about to do is decided by what has been seen.
    pub fn finish(&mut self) -> Vec<Event> {
        let mut events = self.miss(self.now_s, f64::MIN_POSITIVE);
        for (id, visit) in std::mem::take(&mut self.people) {
            if visit.withheld.is_some() || visit.ending.is_some() {
                continue;
            }
            for (crossings, line) in visit.crossings.iter().zip(&self.lines) {
                events
                    .extend(crossings.end_of_run().map(|crossed| self.cross_event(id, &line.name, crossed)));
            }
            for (stay, area) in visit.stays.iter().zip(&self.areas) {
                let decisions = stay.end_of_run().into_iter();
                events.extend(decisions.map(|decision| self.stay_event(id, &area.name, decision)));
            }
        }
        events
    }

    /// Goes on in a changed room: nobody is lost. Stays in areas that the room still has, by their names, go on; those in
    /// others end, and the events of that are returned.
    pub fn replace_room(&mut self, room: &Room) -> Vec<Event> {
        let (areas, lines) = (Area::of_room(room), room.lines.clone());
        let (old_areas, old_lines) =
            (std::mem::replace(&mut self.areas, areas), std::mem::replace(&mut self.lines, lines));
        self.doors = Doors::new(&room.zones);
        let mut people = std::mem::take(&mut self.people);
        let mut events = Vec::new();
        for (id, visit) in &mut people {
            let mut stays: BTreeMap<&str, Stay> = old_areas
                .iter()
                .map(|area| area.name.as_str())
                .zip(std::mem::take(&mut visit.stays))
                .collect();
            let mut crossings: BTreeMap<&str, Crossings> = old_lines
                .iter()
                .map(|line| line.name.as_str())
                .zip(std::mem::take(&mut visit.crossings))
                .collect();
            let taken = |area: &Area| stays.remove(area.name.as_str()).unwrap_or_else(Stay::new);
            visit.stays = self.areas.iter().map(taken).collect();
            let taken = |line: &Line| crossings.remove(line.name.as_str()).unwrap_or_default();
            visit.crossings = self.lines.iter().map(taken).collect();
            if visit.ending.is_some() {
                continue;
            }
            for (name, stay) in stays {
                let left = stay.end().into_iter().map(|decision| self.stay_event(*id, name, decision));
                match &mut visit.withheld {
                    Some(withheld) => withheld.extend(left),
                    None => events.extend(left),
                }
            }
        }
        self.people = people;
        events
    }

    /// Takes a person of a line.
    fn see(&mut self, line: &FrameLine, person: &PersonLine) -> Vec<Event> {
        let fix = Fix {
            frame: line.frame,
            time_s: line.time,
            place: Point2::new(person.x, person.y),
            sigma_m: Vector2::from(person.sigma),
        };
        let velocity = Vector2::new(person.vx, person.vy);
        let mut events = Vec::new();
        let mut visit = match self.people.remove(&person.id) {
            Some(mut visit) => match visit.ending.take() {
                // Somebody who went through a door and comes back visits again.
                Some(ending) if self.doors.is_exit(&visit.last, &self.options) => {
                    let left_s = ending.iter().map(|event| event.time).fold(visit.last.time_s, f64::max);
                    self.new_visit(person.id, &fix, &velocity, left_s)
                }
                Some(ending) => {
                    events.extend(ending.into_iter().rev().map(Event::revocation));
                    visit
                }
                None => visit,
            },
            None => self.new_visit(person.id, &fix, &velocity, f64::NEG_INFINITY),
        };
        let with_frame = |between: Fix| {
            let frame = self.frame_at(between.time_s).unwrap_or(between.frame);
            Fix { frame, ..between }
        };
        let gap: Vec<Fix> =
            path_between((&visit.last, &visit.velocity), (&fix, &velocity), self.options.lost_s)
                .map(with_frame)
                .collect();
        let mut decided = if self.has_gap_since(visit.last.time_s) {
            self.pass_gap(person.id, &mut visit, &gap, &fix)
        } else {
            self.walk(&mut visit, &gap);
            Vec::new()
        };
        decided.extend(self.pass(person.id, &mut visit, [fix]));
        (visit.last, visit.velocity) = (fix, velocity);
        if let Some(withheld) = &mut visit.withheld {
            withheld.extend(decided);
            let is_old_enough = fix.time_s - visit.first.time_s >= self.options.seen_s;
            if is_old_enough && person.confidence >= self.options.least_confidence {
                events.push(self.visit_event(
                    EventKind::Appear,
                    person.id,
                    &visit.first,
                    visit.came_through.clone(),
                ));
                events.extend(visit.withheld.take().into_iter().flatten());
            }
        } else {
            events.extend(decided);
        }
        self.people.insert(person.id, visit);
        events
    }

    /// Disappearance of those who have been missing for `lost_s`.
    fn miss(&mut self, now_s: f64, lost_s: f64) -> Vec<Event> {
        let mut people = std::mem::take(&mut self.people);
        let mut events = Vec::new();
        for (id, visit) in &mut people {
            if now_s - visit.last.time_s < lost_s || visit.withheld.is_some() || visit.ending.is_some() {
                continue;
            }
            let way = self.unseen_way(UnseenPart::Departure, &visit.last, &visit.velocity, f64::NEG_INFINITY);
            let mut unseen = visit.clone();
            let mut ending = match &way {
                Some(way) => self.pass(*id, &mut unseen, way.path.iter().copied()),
                None => Vec::new(),
            };
            for (crossings, line) in unseen.crossings.iter_mut().zip(&self.lines) {
                let beyond = way.as_ref().and_then(|way| crossings.step(line, &way.beyond, &self.options));
                let crossed = beyond.or_else(|| crossings.end());
                ending.extend(crossed.map(|crossed| self.cross_event(*id, &line.name, crossed)));
            }
            for (stay, area) in unseen.stays.iter().zip(&self.areas) {
                let through = way.as_ref().filter(|way| way.zone == area.name);
                let decisions = match through.and_then(|way| way.path.last()) {
                    Some(end) => stay.end_through(end),
                    None => stay.end(),
                };
                ending.extend(decisions.into_iter().map(|d| self.stay_event(*id, &area.name, d)));
            }
            let left_through = way.map(|way| way.zone);
            ending.push(self.visit_event(EventKind::Disappear, *id, &visit.last, left_through));
            events.extend(ending.iter().cloned());
            visit.ending = Some(ending);
        }
        self.people = people;
        events
    }

    /// Whether at least one line of the run lies between a person's last fix and this line: a gap of the track, not a low rate.
    fn has_gap_since(&self, seen_s: f64) -> bool {
        self.frames.iter().nth_back(1).is_some_and(|(before_s, _)| *before_s > seen_s)
    }

    /// The last frame that is not after a time, among the latest.
    fn frame_at(&self, time_s: f64) -> Option<u32> {
        let later = self.frames.partition_point(|(frame_s, _)| *frame_s <= time_s);
        later.checked_sub(1).map(|before| self.frames[before].1)
    }

    /// Takes positions between two frames of a low rate, by time: they date what is decided later, and decide nothing.
    fn walk(&self, visit: &mut Visit, path: &[Fix]) {
        for fix in path {
            for (stay, area) in visit.stays.iter_mut().zip(&self.areas) {
                stay.walk(area, fix, &self.options);
            }
            for (crossings, line) in visit.crossings.iter_mut().zip(&self.lines) {
                crossings.walk(line, fix, &self.options);
            }
        }
    }

    /// Takes the positions of a track's gap, by time, that ends with a fix; the events that are decided by them. They date crossings
    /// of lines, but decide none.
    fn pass_gap(&self, id: TrackId, visit: &mut Visit, gap: &[Fix], end: &Fix) -> Vec<Event> {
        let mut events = Vec::new();
        for (stay, area) in visit.stays.iter_mut().zip(&self.areas) {
            let decisions = stay.pass_gap(area, gap, end, &self.options);
            events.extend(decisions.into_iter().map(|d| self.stay_event(id, &area.name, d)));
        }
        for (crossings, line) in visit.crossings.iter_mut().zip(&self.lines) {
            for fix in gap {
                crossings.walk(line, fix, &self.options);
            }
        }
        events
    }

    /// Takes positions of a person's path, by time; the events that are decided now.
    fn pass(&self, id: TrackId, visit: &mut Visit, path: impl IntoIterator<Item = Fix>) -> Vec<Event> {
        let mut events = Vec::new();
        for fix in path {
            for (stay, area) in visit.stays.iter_mut().zip(&self.areas) {
                let decisions = stay.step(area, &fix, &self.options);
                events.extend(decisions.into_iter().map(|d| self.stay_event(id, &area.name, d)));
            }
            for (crossings, line) in visit.crossings.iter_mut().zip(&self.lines) {
                let crossed = crossings.step(line, &fix, &self.options);
                events.extend(crossed.map(|c| self.cross_event(id, &line.name, c)));
            }
        }
        events
    }

    /// Visit that begins at a fix, or on an unseen way to it, not before `from_s`.
    fn new_visit(&self, id: TrackId, fix: &Fix, velocity: &Vector2<f64>, from_s: f64) -> Visit {
        let way = self.unseen_way(UnseenPart::Arrival, fix, velocity, from_s);
        let mut visit = Visit {
            first: *fix,
            came_through: way.as_ref().map(|way| way.zone.clone()),
            last: *fix,
            velocity: *velocity,
            stays: (0..self.areas.len()).map(|_| Stay::new()).collect(),
            crossings: vec![Crossings::default(); self.lines.len()],
            withheld: None,
            ending: None,
        };
        let mut withheld = Vec::new();
        if let Some((way, began)) = way.as_ref().and_then(|way| Some((way, *way.path.first()?))) {
            for (stay, area) in
                visit.stays.iter_mut().zip(&self.areas).filter(|(_, area)| area.name == way.zone)
            {
                *stay = Stay::through(area, began);
            }
            visit.crossings.fill(Crossings::from(way.beyond));
            withheld = self.pass(id, &mut visit, way.path.iter().copied());
        }
        visit.withheld = Some(withheld);
        visit
    }

    /// Unseen way of a person within the run, and not before `from_s`, with the frames of its times.
    fn unseen_way(
        &self,
        part: UnseenPart,
        fix: &Fix,
        velocity: &Vector2<f64>,
        from_s: f64,
    ) -> Option<UnseenWay> {
        let from_s = self.first_s.map_or(from_s, |first_s| from_s.max(first_s));
        let mut way = self.doors.unseen_way(part, fix, velocity, (from_s, self.now_s))?;
        for fix in way.path.iter_mut().chain([&mut way.beyond]) {
            fix.frame = self.frame_at(fix.time_s).unwrap_or(fix.frame);
        }
        Some(way)
    }

    /// Event of a track's beginning or end at a fix; it is at the zone there, or the one that the person came or left through.
    fn visit_event(&self, kind: EventKind, id: TrackId, fix: &Fix, through: Option<String>) -> Event {
        let zone = self.doors.at(fix, &self.options).map(|zone| zone.name.clone());
        Event { place: zone.or(through), ..self.person_event(kind, id, fix) }
    }

    fn stay_event(&self, id: TrackId, area: &str, decision: Decision) -> Event {
        let (kind, fix, since) = match decision {
            Decision::Entered(fix) => (EventKind::Enter, fix, None),
            Decision::Dwelt(since, fix) => (EventKind::Dwell, fix, Some(since)),
            Decision::Left(since, fix) => (EventKind::Leave, fix, Some(since)),
        };
        let seconds = since.map(|since| rounded((fix.time_s - since.time_s).max(0.0)));
        Event { place: Some(area.to_owned()), seconds, ..self.person_event(kind, id, &fix) }
    }

    fn cross_event(&self, id: TrackId, line: &str, crossed: Crossed) -> Event {
        let direction = if crossed.is_inward { Direction::In } else { Direction::Out };
        let event = self.person_event(EventKind::Cross, id, &crossed.fix);
        Event { place: Some(line.to_owned()), direction: Some(direction), ..event }
    }

    fn person_event(&self, kind: EventKind, id: TrackId, fix: &Fix) -> Event {
        let (x, y) = (Some(rounded(fix.place.x)), Some(rounded(fix.place.y)));
        Event { id: Some(id), x, y, ..self.event(kind, fix.frame, fix.time_s) }
    }

    fn event(&self, kind: EventKind, frame: u32, time_s: f64) -> Event {
        let time = rounded(time_s);
        Event {
            time,
            frame,
            kind,
            revoked: None,
            place: None,
            id: None,
            x: None,
            y: None,
            seconds: None,
            direction: None,
            state: None,
            clock: self.clock.map(|clock| clock.at(time)),
        }
    }
}
