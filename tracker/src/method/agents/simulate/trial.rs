//! One trial of any rule: image tracking, rules and the packets between the stations.

use std::time::Instant;

use nalgebra::Point2;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::super::{Belief, Packet, Restart, Rule};
use super::{Crossing, ImageTracking, World};

/// Number of stations from which the stations of a trial run in parallel; with fewer, trials run in parallel.
const MANY_STATIONS: usize = 16;
/// First purpose of the generators of lost packets, one per station; image tracking uses smaller ones.
const LOSS_PURPOSE: u64 = 1 << 32;

/// State of a simulated station.
struct Station<R> {
    rule: R,
    tracking: ImageTracking,
    rng: Pcg64Mcg,
    restarts: Vec<Restart>,
    packet: Packet,
    /// Run time of the rule for each frame, seconds.
    taken_s: Vec<f64>,
}

/// State of all stations after a frame.
pub struct Moment<'a> {
    /// Stations and people of the trial.
    pub world: &'a World,
    /// Index of the frame, from 0.
    pub frame: usize,
    stations: Vec<(&'a dyn Rule, &'a ImageTracking, &'a Packet)>,
}

impl Moment<'_> {
    /// Latest packet of a station.
    pub fn packet(&self, station: usize) -> &Packet {
        self.stations[station].2
    }

    /// Estimates of all people by a station.
    pub fn people(&self, station: usize) -> Vec<Belief> {
        self.stations[station].0.people()
    }

    /// Person of a station's measurement at a position; `None` for another position.
    pub fn person_at(&self, station: usize, position: Point2<f64>) -> Option<usize> {
        self.stations[station].1.person_at(position)
    }
}

/// Runs a trial with a rule at each station. A packet reaches the others before their next frame or is lost. Returns
/// the median run time of the rule for one station and frame, seconds: other programs on the machine hardly change a
/// median.
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
        let mut received = Vec::new();
        for sender in world.site.heard_by(index) {
            // The draw does not depend on the packets, so that the same ones are lost under every rule.
            let is_lost = loss > 0.0 && self.rng.random_bool(loss);
            received.extend(sent.get(*sender).filter(|_| !is_lost).cloned());
        }
        let begin = Instant::now();
        let step = self.rule.step(&sightings, &received);
        self.taken_s.push(begin.elapsed().as_secs_f64());
        (self.packet, self.restarts) = (step.packet, step.restarts);
    }
}
