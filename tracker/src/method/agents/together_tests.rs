//! Two stations under the modern rule agree on one id per person; their packets pass in memory, one moment later.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Matrix2, Point2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::modern::{Modern, ModernOptions};
use super::test_views::Views;
use super::{Packet, Rule, Sighting, Sightings, StationId, TargetId};

/// Standard deviation of a sighting along each axis, metres.
const NOISE_M: f64 = 0.08;
const RATE_HZ: f64 = 12.0;

/// Two stations and their link.
struct Pair {
    rules: [Modern; 2],
    /// Packets on their way to each station.
    on_way: [Vec<Packet>; 2],
    is_cut: bool,
    at_s: f64,
    rng: Pcg64Mcg,
}

fn rule(station: u8) -> Modern {
    Modern::new(StationId(station), 2, Arc::new(Views::OPEN), ModernOptions::default())
}

impl Pair {
    fn new(seed: u64) -> Self {
        let rng = Pcg64Mcg::seed_from_u64(seed);
        Self { rules: [rule(0), rule(1)], on_way: Default::default(), is_cut: false, at_s: 100.0, rng }
    }

    /// Sightings of people by a station; each image track has the person's number.
    fn sightings(&mut self, people: &[(u32, Point2<f64>)]) -> Sightings {
        let mut noise = || NOISE_M * (0..12).map(|_| self.rng.random_range(-0.5..0.5)).sum::<f64>();
        let sighting = |(track, place): &(u32, Point2<f64>)| Sighting {
            track: *track,
            position: place + Vector2::new(noise(), noise()),
            covariance: Matrix2::identity() * NOISE_M * NOISE_M,
            height_m: 1.7,
            looks: None,
            is_crowded: false,
        };
        let people = people.iter().map(sighting).collect();
        Sightings { time_s: self.at_s, people, is_usable: true }
    }

    /// Runs both stations for a time; `seen` are the people whom each station sees. Returns the ids that each station
    /// reports at the end, and asserts that no station ever reports two people under one id.
    fn pass(&mut self, seconds: f64, seen: [&[(u32, Point2<f64>)]; 2]) -> [BTreeSet<TargetId>; 2] {
        let mut reported: [BTreeSet<TargetId>; 2] = Default::default();
        for _ in 0..(seconds * RATE_HZ) as usize {
            self.at_s += 1.0 / RATE_HZ;
            let mut sent = Vec::new();
            for station in 0..2 {
                let sightings = self.sightings(seen[station]);
                let received = std::mem::take(&mut self.on_way[station]);
                let packet = self.rules[station].step(&sightings, &received).packet;
                let named =
                    packet.reports.iter().map(|report| report.target).filter(|t| *t > TargetId::ALONE);
                let named: Vec<TargetId> = named.collect();
                reported[station] = named.iter().copied().collect();
                assert_eq!(reported[station].len(), named.len(), "two agents of one target: {packet:?}");
                sent.push(packet);
            }
            if !self.is_cut {
                self.on_way = [vec![sent[1].clone()], vec![sent[0].clone()]];
            }
        }
        reported
    }
}

const FIRST: Point2<f64> = Point2::new(1.0, 1.0);
const SECOND: Point2<f64> = Point2::new(4.0, 2.0);

#[test]
fn two_stations_that_name_one_person_at_once_agree() {
    for seed in 1000..1010 {
        let mut pair = Pair::new(seed);
        pair.pass(3.0, [&[], &[]]);
        // Both see two new people at the same moment, and both assign ids before they receive the other's packets.
        let people = [(1, FIRST), (2, SECOND)];
        let [first, second] = pair.pass(5.0, [&people, &people]);
        assert!(first.len() == 2 && first == second, "seed {seed}: {first:?} {second:?}");
        let later = pair.pass(2.0, [&people, &people]);
        assert_eq!(later, [first, second], "ids stay");
    }
}

#[test]
fn the_older_id_wins_when_a_cut_link_is_restored() {
    for seed in 1000..1010 {
        let mut pair = Pair::new(seed);
        pair.is_cut = true;
        // Without a link each station knows one of two people; the second station has restarted.
        let [first, _] = pair.pass(4.0, [&[(1, FIRST)], &[]]);
        pair.rules[1] = rule(1);
        let [still, second] = pair.pass(4.0, [&[(1, FIRST)], &[(7, SECOND)]]);
        assert!(first == still && first.len() == 1 && second.len() == 1);
        pair.is_cut = false;
        let [here, there] = pair.pass(6.0, [&[(1, FIRST), (2, SECOND)], &[(6, FIRST), (7, SECOND)]]);
        assert!(here == there && here.len() == 2, "seed {seed}: {here:?} {there:?}");
        assert!(here.is_superset(&first), "the one who was known longer keeps the id");
    }
}
