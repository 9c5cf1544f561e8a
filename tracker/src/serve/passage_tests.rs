//! Six people who walk between two rooms, 200 times.

use mot::jsonl::FrameLine;
use nalgebra::Point2;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use scenes::polygon::Polygon;
use scenes::room::{Room, Zone, ZoneKind};

use super::*;
use crate::PersonEstimate;
use crate::TrackId;
use crate::events::{EventOptions, Events};
use crate::tracks::person_line;

/// Frames a second.
const RATE_HZ: f64 = 5.0;
const PASSAGES: usize = 200;

/// A person's stay in a room: the room's id, from the door at `from_s` to the door at `to_s`.
struct Visit {
    person: usize,
    room: usize,
    id: u32,
    from_s: f64,
    to_s: f64,
}

/// Visits of six people, who stay for 10 to 60 s and walk from door to door in 1.5 ± 0.4 s.
fn visits(rng: &mut Pcg64Mcg) -> Vec<Visit> {
    let passage = Normal::new(1.5_f64, 0.4).unwrap();
    let mut visits = Vec::new();
    for person in 0..6 {
        let (mut at_s, mut room) = (rng.random_range(0.0..30.0), person % 2);
        for _ in 0..=PASSAGES / 6 {
            let to_s = at_s + rng.random_range(10.0..60.0);
            visits.push(Visit { person, room, id: 0, from_s: at_s, to_s });
            at_s = to_s + passage.sample(rng).clamp(0.3, 3.5);
            room = 1 - room;
        }
    }
    visits.sort_by(|a, b| a.from_s.total_cmp(&b.from_s));
    for (visit, id) in visits.iter_mut().zip(1..) {
        visit.id = id;
    }
    visits
}

/// Share of the passages after which the site's id is the one of before.
fn kept(seed: u64, with_heights: bool) -> f64 {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let visits = visits(&mut rng);
    let heights: Vec<f64> = (0..6).map(|_| Normal::new(1.72, 0.09).unwrap().sample(&mut rng)).collect();
    let noise = Normal::new(0.0, 0.03).unwrap();
    let polygon = Polygon::rectangle(Point2::new(-0.5, -1.0), Point2::new(0.5, 1.0));
    let zone = Zone { name: "door".into(), polygon, kind: ZoneKind::Both };
    let room = Room { zones: vec![zone], ..Room::default() };
    let side = |room| DoorSide { room, zone: "door".into() };
    let options = DoorOptions { plausible_s: [0.0, 4.0] };
    let mut site = SiteIds::new(vec![Door { sides: [side(0), side(1)], options }], 1);
    let mut detectors = [(); 2].map(|()| Events::new(&room, EventOptions::default()));
    let mut ids: std::collections::BTreeMap<PersonKey, u32> = std::collections::BTreeMap::new();
    let end_s = visits.iter().map(|visit| visit.to_s).fold(0.0, f64::max) + 30.0;
    for frame in 1..=(end_s * RATE_HZ) as u32 {
        let time = f64::from(frame) / RATE_HZ;
        for (number, detector) in detectors.iter_mut().enumerate() {
            let mut people = Vec::new();
            for visit in visits.iter().filter(|v| v.room == number && (v.from_s..=v.to_s).contains(&time)) {
                // From the door into the room at 1.2 m/s, and back in time.
                let x = (1.2 * (time - visit.from_s).min(visit.to_s - time)).min(4.0);
                let mut person =
                    PersonEstimate::standing(visit.id, x + noise.sample(&mut rng), noise.sample(&mut rng));
                person.sigma_m = [0.03; 2];
                person.height_m = heights[visit.person] + noise.sample(&mut rng);
                let key = PersonKey { room: number, id: TrackId(visit.id) };
                if with_heights {
                    site.see(key, person.height_m);
                }
                people.push(person_line(&person, &[]));
            }
            people.sort_by_key(|person| person.id);
            let line = FrameLine {
                frame,
                time,
                people,
                count: vec![],
                set_aside: vec![],
                states: vec![],
                clock: None,
            };
            for event in detector.step(&line) {
                let named = site.take(number, &event, event.time, time);
                ids.extend(named.into_iter().map(|n| (n.person, n.site_id)));
            }
        }
        ids.extend(site.advance(time).into_iter().map(|n| (n.person, n.site_id)));
    }
    let id = |visit: &Visit| ids.get(&PersonKey { room: visit.room, id: TrackId(visit.id) });
    let (mut passages, mut kept) = (0, 0);
    for person in 0..6 {
        let own: Vec<&Visit> = visits.iter().filter(|visit| visit.person == person).collect();
        for pair in own.windows(2) {
            passages += 1;
            kept += usize::from(id(pair[0]).is_some() && id(pair[0]) == id(pair[1]));
        }
    }
    assert!(passages >= PASSAGES - 6, "{passages}");
    kept as f64 / f64::from(passages as u32)
}

#[test]
fn of_200_passages_of_6_people_95_in_100_keep_the_id() {
    let seeds = 1001..1009;
    let shares: Vec<[f64; 2]> = seeds.map(|seed| [false, true].map(|heights| kept(seed, heights))).collect();
    let mean = |i: usize| shares.iter().map(|share| share[i]).sum::<f64>() / shares.len() as f64;
    println!("kept: by time {:.4}, by time and height {:.4}; {shares:?}", mean(0), mean(1));
    assert!(mean(1) >= 0.95, "{shares:?}");
}
