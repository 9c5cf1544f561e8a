//! Evaluation of a trial: people kept, lost and confused at its end.
//!
//! The last second is evaluated. A person is *kept* when the track is right in 80 % of its frames, *lost* when there is
//! no track in more than half of them, and *confused* when the track follows another person in more than half of them.

use std::collections::BTreeMap;

use nalgebra::Point2;
use serde::Serialize;

use super::super::TargetId;
use super::{CLOSE_M, World, trial::Moment};

/// Fraction of the evaluated frames in which the track of a person who is kept must be right.
const KEPT: f64 = 0.8;
/// Duration of the evaluated end of a trial, seconds.
const JUDGED_S: f64 = 1.0;
/// Time in view from which a station is evaluated for a person, seconds.
const IN_VIEW_S: f64 = 1.0;

/// Evaluation of the people of a trial by one criterion.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Fates {
    /// Whether each person was kept.
    pub kept: Vec<bool>,
    /// Whether each person was lost.
    pub lost: Vec<bool>,
    /// Whether each person was confused with another.
    pub confused: Vec<bool>,
}

/// Numbers of evaluated frames of a person: all, those with the right track, and those without a track.
#[derive(Debug, Clone, Copy, Default)]
struct Count {
    frames: u32,
    right: u32,
    lost: u32,
}

impl Count {
    fn record(&mut self, is_right: bool, is_lost: bool) {
        self.frames += 1;
        self.right += u32::from(is_right);
        self.lost += u32::from(is_lost);
    }

    fn is_kept(self) -> bool {
        f64::from(self.right) >= KEPT * f64::from(self.frames)
    }

    fn is_lost(self) -> bool {
        2 * self.lost > self.frames
    }

    fn is_confused(self) -> bool {
        2 * (self.frames - self.right - self.lost) > self.frames
    }
}

impl Fates {
    fn of(counts: &[Count]) -> Self {
        Self {
            kept: counts.iter().map(|c| c.is_kept()).collect(),
            lost: counts.iter().map(|c| c.is_lost()).collect(),
            confused: counts.iter().map(|c| c.is_confused()).collect(),
        }
    }
}

/// Whether a place is within 1 m of a person and no other person is nearer.
pub(super) fn is_of(places: &[Point2<f64>], person: usize, place: Point2<f64>) -> bool {
    let distance = |p: &Point2<f64>| (p - place).norm_squared();
    let own = distance(&places[person]);
    own < CLOSE_M * CLOSE_M && places.iter().all(|p| distance(p) >= own)
}

/// Whether a frame belongs to the evaluated end of a trial.
pub(super) fn is_judged(world: &World, frame: usize) -> bool {
    frame + (JUDGED_S * world.options.rate_hz).round() as usize >= world.frames()
}

/// Evaluates the fused place of each person, frame by frame, for the centralised variant.
#[derive(Debug, Clone)]
pub(super) struct PlaceJudge(Vec<Count>);

impl PlaceJudge {
    pub(super) fn new(people: usize) -> Self {
        Self(vec![Count::default(); people])
    }

    pub(super) fn watch(
        &mut self,
        world: &World,
        frame: usize,
        place_of: impl Fn(usize) -> Option<Point2<f64>>,
    ) {
        if !is_judged(world, frame) {
            return;
        }
        for (person, count) in self.0.iter_mut().enumerate() {
            let place = place_of(person);
            count.record(place.is_some_and(|p| is_of(world.places(frame), person, p)), place.is_none());
        }
    }

    pub(super) fn fates(&self) -> Fates {
        Fates::of(&self.0)
    }
}

/// Evaluates the agents of all stations, frame by frame.
#[derive(Debug, Clone)]
pub struct Judge {
    votes: BTreeMap<(usize, TargetId), u32>,
    targets: Vec<Option<TargetId>>,
    leader: Vec<Count>,
    mean: Vec<Count>,
    /// Frames evaluated for each person at each station: `[person][station]`.
    each: Vec<Vec<Count>>,
    /// Number of frames for which each station has had each person in view: `[person][station]`.
    in_view: Vec<Vec<u32>>,
}

impl Judge {
    /// Creates the evaluation of a trial.
    pub fn new(world: &World) -> Self {
        let (people, stations) = (world.options.people, world.options.stations);
        Self {
            votes: BTreeMap::new(),
            targets: vec![None; people],
            leader: vec![Count::default(); people],
            mean: vec![Count::default(); people],
            each: vec![vec![Count::default(); stations]; people],
            in_view: vec![vec![0; stations]; people],
        }
    }

    /// Adds a frame.
    pub fn watch(&mut self, moment: &Moment<'_>) {
        let time_s = moment.world.time_s(moment.frame);
        let [begin_s, end_s] = moment.world.naming_s();
        if (begin_s..end_s).contains(&time_s) {
            self.vote(moment);
        } else if !self.votes.is_empty() && self.targets.iter().all(Option::is_none) {
            self.name();
        }
        self.look(moment);
        if is_judged(moment.world, moment.frame) {
            self.judge(moment);
        }
    }

    /// Target of a person; `None` before it is known.
    pub fn target(&self, person: usize) -> Option<TargetId> {
        self.targets[person]
    }

    /// Evaluation by the criterion that the most confident member of each agency measures the right person.
    pub fn leader(&self) -> Fates {
        Fates::of(&self.leader)
    }

    /// Evaluation by the criterion that the mean place of an agency's members is nearest to the right person and within
    /// 1 m.
    pub fn mean(&self) -> Fates {
        Fates::of(&self.mean)
    }

    /// Evaluation by the criterion that every station with a person in view for a second has the right place.
    pub fn each(&self) -> Fates {
        let all = |is: fn(Count) -> bool| {
            let judged = |counts: &Vec<Count>| counts.iter().filter(|c| c.frames > 0).all(|c| is(*c));
            self.each.iter().map(judged).collect::<Vec<bool>>()
        };
        let any_confused = |counts: &Vec<Count>| counts.iter().any(|c| c.is_confused());
        let is_judged = |counts: &Vec<Count>| counts.iter().any(|c| c.frames > 0);
        Fates {
            kept: all(Count::is_kept),
            lost: self.each.iter().zip(all(Count::is_lost)).map(|(c, lost)| lost && is_judged(c)).collect(),
            confused: self.each.iter().map(any_confused).collect(),
        }
    }

    fn vote(&mut self, moment: &Moment<'_>) {
        let places = moment.world.places(moment.frame);
        for station in 0..moment.world.options.stations {
            for belief in moment.people(station) {
                if let Some(person) = (0..places.len()).find(|p| is_of(places, *p, belief.position)) {
                    *self.votes.entry((person, belief.target)).or_default() += 1;
                }
            }
        }
    }

    /// Gives each person the target with the most votes.
    fn name(&mut self) {
        let mut votes: Vec<_> = self.votes.iter().map(|(pair, count)| (*count, *pair)).collect();
        votes.sort_by_key(|(count, pair)| (std::cmp::Reverse(*count), *pair));
        for (_, (person, target)) in votes {
            if self.targets[person].is_none() && !self.targets.contains(&Some(target)) {
                self.targets[person] = Some(target);
            }
        }
    }

    fn look(&mut self, moment: &Moment<'_>) {
        let places = moment.world.places(moment.frame);
        for (counts, place) in self.in_view.iter_mut().zip(places) {
            for (station, frames) in counts.iter_mut().enumerate() {
                *frames = if moment.world.site.sees(station, *place) { *frames + 1 } else { 0 };
            }
        }
    }

    fn judge(&mut self, moment: &Moment<'_>) {
        let places = moment.world.places(moment.frame);
        let stations = moment.world.options.stations;
        let known: Vec<_> = (0..stations).map(|station| moment.people(station)).collect();
        let enough = (IN_VIEW_S * moment.world.options.rate_hz) as u32;
        for (person, target) in self.targets.iter().enumerate() {
            for station in (0..stations).filter(|s| self.in_view[person][*s] > enough) {
                let belief = known[station].iter().find(|b| Some(b.target) == *target);
                let is_right = belief.is_some_and(|b| is_of(places, person, b.position));
                self.each[person][station].record(is_right, belief.is_none());
            }
            let members: Vec<_> = (0..stations)
                .flat_map(|s| moment.packet(s).reports.iter().map(move |report| (s, report)))
                .filter(|(_, report)| Some(report.target) == *target)
                .collect();
            let Some(mean) = mean(members.iter().map(|(_, report)| report.position)) else {
                self.leader[person].record(false, true);
                self.mean[person].record(false, true);
                continue;
            };
            self.mean[person].record(is_of(places, person, mean), false);
            // Ties go to the first member.
            let leader = members.iter().rev().max_by(|a, b| a.1.confidence.total_cmp(&b.1.confidence));
            let followed = leader.and_then(|(station, report)| moment.person_at(*station, report.position));
            self.leader[person].record(followed == Some(person), false);
        }
    }
}

/// Mean of places, metres; `None` without places.
pub(super) fn mean(places: impl Iterator<Item = Point2<f64>>) -> Option<Point2<f64>> {
    let (sum, count) = places.fold((Point2::origin(), 0.0), |(sum, n), p| (sum + p.coords, n + 1.0));
    (count > 0.0).then(|| sum / count)
}
