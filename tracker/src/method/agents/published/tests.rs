//! Stations under the published rule that measure the same people.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Matrix2, Point2, point, vector};

use super::super::simulate::{Crossing, Options, Site, World, run_trial};
use super::super::test_views::Views;
use super::super::{Colour, Looks, Packet, Rule, Sighting, Sightings, StationId, Step, TargetId};
use super::{Published, PublishedOptions};

const DT_S: f64 = 0.1;

fn stations(count: u8) -> Vec<Published> {
    let station =
        |id| Published::new(StationId(id), count, Arc::new(Views::OPEN), PublishedOptions::default());
    (0..count).map(station).collect()
}

/// Sighting of a person under an image track.
fn sighting(track: u32, position: Point2<f64>, hue_deg: f32, is_crowded: bool) -> Sighting {
    Sighting {
        track,
        position,
        covariance: Matrix2::identity() * 0.01,
        height_m: 1.7,
        looks: Some(Looks { colours: [Colour { hue_deg, saturation: 0.9, value: 0.5 }; 3] }),
        is_crowded,
    }
}

/// Places, metres, and hues, degrees, of two people who pass each other along x, 0.4 m apart, from 3 m before to 15 m
/// beyond.
fn passing(frame: u32) -> [(Point2<f64>, f32); 2] {
    let x = 0.12 * (f64::from(frame) - 25.0);
    [(point![x, 0.2], 0.0), (point![-x, -0.2], 220.0)]
}

/// Runs all stations for one frame with the packets of the frame before.
fn step(
    stations: &mut [Published],
    time_s: f64,
    seen: &[Vec<Sighting>],
    packets: &mut Vec<Packet>,
) -> Vec<Step> {
    let steps: Vec<Step> = stations
        .iter_mut()
        .zip(seen)
        .map(|(station, people)| {
            let sightings = Sightings { time_s, people: people.clone(), is_usable: true };
            // The station's own packet is among them, and is ignored.
            station.step(&sightings, packets)
        })
        .collect();
    *packets = steps.iter().map(|s| s.packet.clone()).collect();
    steps
}

/// Reported place of a target, metres.
fn place(packet: &Packet, target: u32) -> Option<Point2<f64>> {
    packet.reports.iter().find(|r| r.target == TargetId(target)).map(|r| r.position)
}

#[test]
fn a_swap_in_one_station_is_found_and_repaired() {
    let mut all = stations(3);
    for station in &mut all {
        station.introduce(0, TargetId(1));
        station.introduce(1, TargetId(2));
    }
    let mut packets = Vec::new();
    for frame in 0..150 {
        let people = passing(frame);
        let is_close = (people[0].0 - people[1].0).norm() < 1.0;
        let seen = (0..3).map(|station| {
            // The tracks of station 2 are swapped when the people have passed; the other stations see the people apart
            // from each other all the time.
            let is_swapped = station == 2 && frame > 25;
            let person = |track: usize| {
                let (position, hue_deg) = people[if is_swapped { 1 - track } else { track }];
                sighting(track as u32, position, hue_deg, is_close && station == 2)
            };
            vec![person(0), person(1)]
        });
        let seen: Vec<Vec<Sighting>> = seen.collect();
        step(&mut all, f64::from(frame) * DT_S, &seen, &mut packets);
        if frame == 45 {
            assert!(packets[2].reports.is_empty(), "both agents have left: {:?}", packets[2].reports);
        }
    }
    let people = passing(149);
    for packet in &packets {
        assert_eq!(place(packet, 1), Some(people[0].0), "{:?}", packet.station);
        assert_eq!(place(packet, 2), Some(people[1].0), "{:?}", packet.station);
    }
}

#[test]
fn a_newcomer_found_by_all_stations_at_once_gets_one_target() {
    let mut all = stations(3);
    let mut packets = Vec::new();
    for frame in 0..40 {
        let walker = sighting(5, point![0.1 * f64::from(frame), 1.0], 100.0, false);
        step(&mut all, f64::from(frame) * DT_S, &vec![vec![walker]; 3], &mut packets);
    }
    let targets: BTreeSet<TargetId> = packets.iter().flat_map(|p| &p.reports).map(|r| r.target).collect();
    assert_eq!(targets.len(), 1, "{packets:?}");
    assert!(packets.iter().all(|p| p.reports.len() == 1));
}

#[test]
fn a_person_seen_by_one_station_alone_is_reported_after_a_second() {
    let mut all = stations(2);
    let mut packets = Vec::new();
    for frame in 0..20 {
        let walker = sighting(5, point![0.1 * f64::from(frame), 1.0], 100.0, false);
        step(&mut all, f64::from(frame) * DT_S, &[vec![walker], Vec::new()], &mut packets);
        let is_reported = !packets[0].reports.is_empty();
        assert_eq!(is_reported, frame >= 10, "frame {frame}");
    }
    // The other station knows of the person, without an agent.
    let known = all[1].people();
    assert!(known.len() == 1 && known[0].agent.is_none() && known[0].target != TargetId::ALONE);
}

#[test]
fn a_station_finds_a_person_measured_by_another_and_takes_the_target() {
    let mut all = stations(2);
    let mut packets = Vec::new();
    let mut asked = 0;
    let mut found_at = None;
    for frame in 0..60 {
        let walker = sighting(5, point![0.05 * f64::from(frame), 1.0], 100.0, false);
        // Image tracking of station 1 finds the person three looks after it has been asked to.
        let found = if asked > 3 { vec![Sighting { track: 9, ..walker }] } else { Vec::new() };
        let steps = step(&mut all, f64::from(frame) * DT_S, &[vec![walker], found], &mut packets);
        for restart in &steps[1].restarts {
            assert!((restart.position - walker.position).norm() < 0.2);
            asked += 1;
        }
        if found_at.is_none() && packets[1].reports.len() == 1 {
            found_at = Some(packets[1].reports[0].target);
        }
    }
    assert_eq!(found_at, Some(packets[0].reports[0].target));
}

#[test]
fn an_agent_without_a_sighting_for_a_second_ends() {
    let mut all = stations(1);
    all[0].introduce(0, TargetId(1));
    let mut packets = Vec::new();
    for frame in 0..30 {
        let seen = if frame < 10 { vec![sighting(0, point![0.0, 0.0], 0.0, false)] } else { Vec::new() };
        step(&mut all, f64::from(frame) * DT_S, &[seen], &mut packets);
        assert_eq!(all[0].people().len(), usize::from(frame < 20), "frame {frame}");
    }
}

#[test]
fn a_camera_without_an_image_misses_no_person() {
    let mut all = stations(1);
    all[0].introduce(0, TargetId(1));
    let seen = |time_s, is_usable| Sightings {
        time_s,
        people: if is_usable { vec![sighting(0, point![0.0, 0.0], 0.0, false)] } else { Vec::new() },
        is_usable,
    };
    all[0].step(&seen(0.0, true), &[]);
    for frame in 1..50 {
        assert!(all[0].step(&seen(f64::from(frame) * DT_S, false), &[]).packet.is_blind);
    }
    assert_eq!(all[0].step(&seen(5.0, true), &[]).packet.reports.len(), 1);
}

#[test]
fn no_station_ever_has_two_agents_of_one_target() {
    let options = Options { seconds: 20.0, ..Options::hard() };
    let site = Arc::new(Site::new(&options));
    for trial in 0..3 {
        let world = World::new(&options, &site, 77, trial);
        let rules = (0..options.stations as u8).map(|id| {
            let rule_options = PublishedOptions::simulation(180.0, 0.15);
            Published::new(StationId(id), options.stations as u8, site.clone(), rule_options)
        });
        run_trial(&world, Crossing::Random, rules, |moment| {
            for station in 0..options.stations {
                let packet = moment.packet(station);
                let targets: BTreeSet<TargetId> = packet.reports.iter().map(|r| r.target).collect();
                assert_eq!(targets.len(), packet.reports.len(), "trial {trial}, frame {}", moment.frame);
            }
        });
    }
}

#[test]
fn invalid_packets_change_no_estimate() {
    let mut station = stations(2).remove(0);
    let walker = |frame: u32| Sightings {
        time_s: f64::from(frame) * DT_S,
        people: vec![sighting(0, point![0.0, 0.0], 0.0, false)],
        is_usable: true,
    };
    for frame in 0..30 {
        let time_s = f64::from(frame) * DT_S;
        let step = station.step(&walker(frame), &[]);
        let mut echo = step.packet.clone();
        (echo.station, echo.greatest, echo.time_s) = (StationId(1), TargetId(u32::MAX), time_s);
        for report in &mut echo.reports {
            report.position = point![f64::NAN, f64::INFINITY];
            report.velocity = vector![f64::NAN, 0.0];
        }
        station.step(&Sightings { time_s, people: Vec::new(), is_usable: false }, &[echo]);
    }
    let people = station.people();
    assert!(people.len() == 1 && people[0].position.coords.norm() < 0.1, "{people:?}");
    assert!(people[0].target.0 < 1000);
}
