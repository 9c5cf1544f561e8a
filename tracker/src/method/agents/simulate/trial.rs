//! One trial of any rule: image tracking, rules and the packets between them.

use std::time::Instant;

use nalgebra::Point2;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::super::{Belief, Packet, Restart, Rule};
use super::{Crossing, ImageTracking, World};

/// So many stations or more share the processor's cores within a trial; fewer leave them to other trials.
const MANY_STATIONS: usize = 16;
/// Purposes of the generators of lost packets, one a station; image tracking has those below.
const LOSS_PURPOSE: u64 = 1 << 32;

/// A simulated station at work.
struct Station<R> {
    rule: R,
    tracking: ImageTracking,
    rng: Pcg64Mcg,
    restarts: Vec<Restart>,
    packet: Packet,
    /// Time that the rule took for each frame, seconds.
    taken_s: Vec<f64>,
}

/// State of all stations after a frame.
pub struct Moment<'a> {
    /// The trial's people.
    pub world: &'a World,
    /// The frame, from 0.
    pub frame: usize,
    stations: Vec<(&'a dyn Rule, &'a ImageTracking, &'a Packet)>,
}

impl Moment<'_> {
    /// What a station has just sent.
    pub fn packet(&self, station: usize) -> &Packet {
        self.stations[station].2
    }

    /// Whom a station knows of.
    pub fn people(&self, station: usize) -> Vec<Belief> {
        self.stations[station].0.people()
    }

    /// Person whose measurement by a station a position is, if it is one.
    pub fn person_at(&self, station: usize, position: Point2<f64>) -> Option<usize> {
        self.stations[station].1.person_at(position)
    }
}

/// Runs a trial with a rule at each station. A packet reaches the others before their next frame, or never. Returns the
/// median time that the rule took at a station for a frame, seconds: other programs on the machine hardly change it.
pub fn run_trial<R: Rule>(
    world: &World,
    crossing: Crossing,
    rules: impl IntoIterator<Item = R>,
    mut watch: impl FnMut(&Moment<'_>),
) -> f64 {
    let station = |(index, rule)| Station {
        rule,
        tracking: ImageTracking::new(world, index, crossing),
        rng: world.random(LOSS_PURPOSE + index as u64),
        restarts: Vec::new(),
        packet: Packet::default(),
        taken_s: Vec::with_capacity(world.frames()),
    };
    let mut stations: Vec<Station<R>> = rules.into_iter().enumerate().map(station).collect();
    let mut sent: Vec<Packet> = Vec::new();
    for frame in 0..world.frames() {
        if stations.len() >= MANY_STATIONS {
            stations.par_iter_mut().enumerate().for_each(|(i, station)| station.step(world, i, frame, &sent));
        } else {
            stations.iter_mut().enumerate().for_each(|(i, station)| station.step(world, i, frame, &sent));
        }
        sent.clear();
        sent.extend(stations.iter().map(|station| station.packet.clone()));
        let all = stations.iter().map(|s| (&s.rule as &dyn Rule, &s.tracking, &s.packet)).collect();
        watch(&Moment { world, frame, stations: all });
    }
    let mut taken_s: Vec<f64> = stations.into_iter().flat_map(|station| station.taken_s).collect();
    taken_s.sort_by(f64::total_cmp);
    taken_s.get(taken_s.len() / 2).copied().unwrap_or(0.0)
}

impl<R: Rule> Station<R> {
    fn step(&mut self, world: &World, index: usize, frame: usize, sent: &[Packet]) {
        let sightings = self.tracking.step(world, frame, &self.restarts);
        let loss = world.options.loss;
        let mut heard = Vec::new();
        for sender in world.site.heard_by(index) {
            // The draw comes first, so that the same packets are lost whatever is sent.
            let is_lost = loss > 0.0 && self.rng.random_bool(loss);
            heard.extend(sent.get(*sender).filter(|_| !is_lost).cloned());
        }
        let begin = Instant::now();
        let step = self.rule.step(&sightings, &heard);
        self.taken_s.push(begin.elapsed().as_secs_f64());
        (self.packet, self.restarts) = (step.packet, step.restarts);
    }
}
