use std::sync::Arc;

use nalgebra::{Matrix2, Point2, Vector2, point, vector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::super::test_views::Views;
use super::super::{
    AgentId, Belief, Colour, FieldOfView, Looks, Packet, Report, Rule, Sighting, Sightings, StationId, Step,
    TargetId,
};
use super::{Modern, ModernOptions};

const DT: f64 = 0.1;

/// Stations in one room; packets reach the other stations one frame later.
struct Room {
    rules: Vec<Modern>,
    views: Arc<Views>,
    sent: Vec<Packet>,
    frame: u32,
    rng: Pcg64Mcg,
}

impl Room {
    fn new(stations: u8, view: fn(u8, Point2<f64>) -> f64) -> Self {
        let views = Arc::new(Views(view));
        let rule = |s| Modern::new(StationId(s), stations, views.clone(), ModernOptions::simulation());
        Self {
            rules: (0..stations).map(rule).collect(),
            views: views.clone(),
            sent: Vec::new(),
            frame: 0,
            rng: Pcg64Mcg::seed_from_u64(5),
        }
    }

    fn time_s(&self) -> f64 {
        f64::from(self.frame) * DT
    }

    /// Sightings of people, each given by a place and a hue, in degrees, by a station; the track is the index.
    fn sightings(&mut self, station: u8, people: &[(Point2<f64>, f32)]) -> Sightings {
        let mut seen = Vec::new();
        for (track, (place, hue_deg)) in people.iter().enumerate() {
            if self.views.visible(StationId(station), *place, 1.7) < 0.5 {
                continue;
            }
            let mut error = |limit: f64| self.rng.random_range(-limit..limit);
            let position = place + vector![error(0.2), error(0.2)];
            let hue_deg = hue_deg + error(20.0) as f32;
            let is_crowded = people.iter().any(|(p, _)| p != place && (p - place).norm() < 1.0);
            seen.push(Sighting {
                track: track as u32,
                position,
                covariance: Matrix2::identity() * (0.04 / 3.0),
                height_m: 1.7,
                looks: Some(Looks { colours: [Colour { hue_deg, saturation: 1.0, value: 0.5 }; 3] }),
                is_crowded,
            });
        }
        Sightings { time_s: self.time_s(), people: seen, is_usable: true }
    }

    /// Runs one frame; `hears(a, b)`: station a receives the packets of station b.
    fn step(&mut self, people: &[(Point2<f64>, f32)], hears: impl Fn(usize, usize) -> bool) -> Vec<Step> {
        self.frame += 1;
        let sent = std::mem::take(&mut self.sent);
        let mut steps = Vec::new();
        for index in 0..self.rules.len() {
            let sightings = self.sightings(index as u8, people);
            let received: Vec<Packet> = sent
                .iter()
                .filter(|p| usize::from(p.station.0) != index && hears(index, usize::from(p.station.0)))
                .cloned()
                .collect();
            let step = self.rules[index].step(&sightings, &received);
            let beliefs = self.rules[index].people();
            assert!(beliefs.windows(2).all(|w| w[0].target < w[1].target), "two people with one id");
            steps.push(step);
        }
        self.sent.extend(steps.iter().map(|s| s.packet.clone()));
        steps
    }

    fn run(&mut self, seconds: f64, people: &[(Point2<f64>, f32)]) {
        for _ in 0..(seconds / DT).round() as usize {
            self.step(people, |_, _| true);
        }
    }

    /// Ids that a station gives to the people at these places.
    fn ids(&self, station: usize, people: &[(Point2<f64>, f32)]) -> Vec<Option<TargetId>> {
        people.iter().map(|(place, _)| nearest(&self.rules[station].people(), *place)).collect()
    }
}

fn nearest(beliefs: &[Belief], place: Point2<f64>) -> Option<TargetId> {
    let near = beliefs.iter().filter(|b| (b.position - place).norm() < 0.7);
    near.min_by(|a, b| (a.position - place).norm().total_cmp(&(b.position - place).norm())).map(|b| b.target)
}

/// Three people apart from each other.
fn three() -> Vec<(Point2<f64>, f32)> {
    vec![(point![0.0, 0.0], 60.0), (point![3.0, 0.0], 150.0), (point![0.0, 4.0], 240.0)]
}

/// Report by a hostile or faulty station.
fn report(target: u32, position: Point2<f64>) -> Report {
    Report {
        agent: AgentId { station: StationId(2), number: 1 },
        target: TargetId(target),
        position,
        covariance: Matrix2::identity() * 0.02,
        velocity: Vector2::zeros(),
        height_m: 1.7,
        looks: None,
        confidence: 1.0,
        is_crowded: false,
    }
}

#[test]
fn all_stations_give_a_person_one_id() {
    let mut room = Room::new(4, Views::OPEN.0);
    room.run(3.0, &three());
    let ids = room.ids(0, &three());
    assert!(ids.iter().all(Option::is_some) && ids[0] != ids[1] && ids[1] != ids[2] && ids[0] != ids[2]);
    for station in 0..4 {
        assert_eq!(room.ids(station, &three()), ids);
        assert_eq!(room.rules[station].people().len(), 3);
    }
}

#[test]
fn a_cut_network_heals_within_seconds() {
    let mut room = Room::new(4, Views::OPEN.0);
    for _ in 0..100 {
        room.step(&three(), |a, b| a / 2 == b / 2);
    }
    assert_ne!(room.ids(0, &three()), room.ids(2, &three()), "each half gave ids of its own");
    let older = room.ids(0, &three());
    room.run(4.0, &three());
    for station in 0..4 {
        assert_eq!(room.ids(station, &three()), older, "station {station}");
        assert_eq!(room.rules[station].people().len(), 3);
    }
}

#[test]
fn people_who_turn_where_they_meet_keep_their_ids() {
    let mut room = Room::new(3, Views::OPEN.0);
    // Two people walk towards each other, touch, and turn back.
    let at = |t: f64| {
        let away = (3.0 - t).abs() + 0.1;
        vec![(point![-away, 0.0], 60.0), (point![away, 0.0], 180.0)]
    };
    let mut before = Vec::new();
    for frame in 0..80 {
        let people = at(f64::from(frame) * DT);
        room.step(&people, |_, _| true);
        if frame == 20 {
            before = room.ids(0, &people);
        }
    }
    assert!(before.iter().all(Option::is_some));
    for station in 0..3 {
        assert_eq!(room.ids(station, &at(7.9)), before, "station {station}");
    }
}

#[test]
fn a_report_with_another_persons_id_changes_no_id() {
    let mut room = Room::new(3, |station, _| if station == 2 { 0.0 } else { 1.0 });
    room.run(3.0, &three());
    let ids = room.ids(0, &three());
    let taken = ids[0].unwrap().0;
    for frame in 0..100u32 {
        room.sent.retain(|p| p.station != StationId(2));
        // The id of the first person, at first at an empty place and later at that of the second person.
        let place = if frame < 50 { point![5.0, 5.0] } else { point![3.0, 0.0] };
        room.sent.push(Packet {
            station: StationId(2),
            life: 9,
            sequence: frame + 1,
            time_s: room.time_s(),
            greatest: TargetId(taken),
            reports: vec![report(taken, place)],
            ..Packet::default()
        });
        room.step(&three(), |_, _| true);
        for station in 0..2 {
            assert_eq!(room.ids(station, &three()), ids, "frame {frame}");
        }
    }
}

#[test]
fn reports_with_invalid_values_are_refused() {
    let mut room = Room::new(3, |station, _| if station == 2 { 0.0 } else { 1.0 });
    room.run(3.0, &three());
    let ids = room.ids(0, &three());
    let place = point![5.0, 5.0];
    let good = report(50, place);
    let bad = [
        Report { position: point![f64::NAN, 0.0], ..good },
        Report { position: point![1e9, 0.0], ..good },
        Report { velocity: vector![f64::INFINITY, 0.0], ..good },
        Report { velocity: vector![0.0, 100.0], ..good },
        Report { covariance: Matrix2::zeros(), ..good },
        Report { covariance: Matrix2::identity() * -1.0, ..good },
        Report { covariance: Matrix2::identity() * 1e12, ..good },
        Report { covariance: Matrix2::identity() * f64::NAN, ..good },
        Report { covariance: Matrix2::new(1.0, 9.0, 9.0, 1.0), ..good },
        Report { height_m: f64::NAN, ..good },
        Report { height_m: 30.0, ..good },
        Report { confidence: 2.0, ..good },
        Report { confidence: f64::NAN, ..good },
        Report { target: TargetId(u32::MAX), ..good },
    ];
    let mut packet = Packet { station: StationId(2), time_s: room.time_s(), ..Packet::default() };
    packet.life = 9;
    packet.sequence = 1;
    packet.greatest = TargetId(u32::MAX);
    packet.reports = bad.to_vec();
    let before = room.rules[0].refused();
    room.sent.retain(|p| p.station != StationId(2));
    room.sent.push(packet.clone());
    room.sent.push(packet.clone());
    room.sent.push(Packet { sequence: 2, time_s: f64::NAN, ..packet.clone() });
    room.sent.push(Packet { sequence: 3, time_s: room.time_s() - 60.0, ..packet.clone() });
    room.sent.push(Packet { station: StationId(200), sequence: 4, ..packet.clone() });
    room.sent.push(Packet { station: StationId(0), sequence: 4, ..packet });
    room.step(&three(), |_, _| true);
    // Each report once, a repeated packet, and three packets of invalid times or senders. The room does not
    // deliver a station's own packet.
    assert_eq!(room.rules[0].refused() - before, bad.len() as u64 + 4);
    room.run(1.0, &three());
    assert_eq!(room.ids(0, &three()), ids);
    assert_eq!(room.rules[0].people().len(), 3);
    let finite = |b: &Belief| b.position.coords.iter().chain(b.covariance.iter()).all(|n| n.is_finite());
    assert!(room.rules[0].people().iter().all(finite));
    // The next newcomer gets a small id: the invalid greatest one was ignored.
    let mut four = three();
    four.push((point![6.0, 6.0], 100.0));
    room.run(3.0, &four);
    assert!(room.ids(0, &four)[3].unwrap().0 < 100);
}

#[test]
fn a_person_missed_in_plain_view_is_removed() {
    let mut room = Room::new(2, Views::OPEN.0);
    room.run(3.0, &three());
    room.run(2.0, &three()[..2]);
    for rule in &room.rules {
        assert_eq!(rule.people().len(), 2);
    }
}

#[test]
fn an_occluded_person_is_kept_and_returns_with_the_same_id() {
    // No station sees beyond x = 2 m.
    let mut room = Room::new(2, |_, place| if place.x < 2.0 { 1.0 } else { 0.0 });
    let at = |x: f64| vec![(point![x, 0.0], 60.0), (point![-3.0, 2.0], 200.0)];
    for frame in 0..50 {
        room.step(&at(-2.0 + f64::from(frame) * DT), |_, _| true);
    }
    let id = room.rules[0].people()[0].target;
    room.run(20.0, &at(2.9));
    for rule in &room.rules {
        assert_eq!(rule.people().len(), 2, "carried");
    }
    for frame in 0..40 {
        room.step(&at(2.9 - f64::from(frame) * DT), |_, _| true);
    }
    for station in 0..2 {
        assert_eq!(room.ids(station, &at(-1.0))[0], Some(id), "station {station}");
        assert_eq!(room.rules[station].people().len(), 2);
    }
}

#[test]
fn a_camera_without_an_image_misses_no_person() {
    let mut room = Room::new(2, Views::OPEN.0);
    room.run(3.0, &three());
    for _ in 0..50 {
        room.frame += 1;
        let sent = std::mem::take(&mut room.sent);
        for index in 0..2 {
            let received: Vec<Packet> =
                sent.iter().filter(|p| usize::from(p.station.0) != index).cloned().collect();
            let dark = Sightings { time_s: room.time_s(), people: Vec::new(), is_usable: false };
            let step = room.rules[index].step(&dark, &received);
            assert!(step.packet.is_blind);
            room.sent.push(step.packet);
        }
    }
    assert!(room.rules.iter().all(|r| r.people().len() == 3));
}

#[test]
fn a_restarted_station_takes_the_ids_that_it_hears() {
    let mut room = Room::new(3, Views::OPEN.0);
    room.run(4.0, &three());
    let ids = room.ids(0, &three());
    room.rules[1] =
        Modern::new(StationId(1), 3, room.views.clone(), ModernOptions::simulation()).with_life(7);
    room.run(0.5, &three());
    assert_eq!(room.ids(1, &three()), ids);
    room.run(3.0, &three());
    for station in 0..3 {
        assert_eq!(room.ids(station, &three()), ids, "station {station}");
    }
}

#[test]
fn image_tracking_is_asked_for_people_measured_only_by_others() {
    let mut room = Room::new(2, Views::OPEN.0);
    room.run(3.0, &three());
    let mut asked = Vec::new();
    for _ in 0..20 {
        room.frame += 1;
        let sent = std::mem::take(&mut room.sent);
        let all = room.sightings(0, &three());
        let two = room.sightings(1, &three()[..2]);
        let steps = [(0, all), (1, two)].map(|(index, sightings)| {
            let received: Vec<Packet> =
                sent.iter().filter(|p| usize::from(p.station.0) != index).cloned().collect();
            room.rules[index].step(&sightings, &received)
        });
        room.sent.extend(steps.iter().map(|s| s.packet.clone()));
        assert!(steps[0].restarts.is_empty());
        asked.extend(steps[1].restarts.iter().map(|r| r.position));
    }
    assert!((2..=4).contains(&asked.len()), "once in half a second: {}", asked.len());
    assert!(asked.iter().all(|p| (p - three()[2].0).norm() < 0.5));
}

#[test]
fn the_number_of_tracked_people_is_bounded() {
    let mut room = Room::new(2, Views::OPEN.0);
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    for frame in 0..60u32 {
        room.sent.retain(|p| p.station != StationId(1));
        let mut anywhere = || rng.random_range(-50.0..50.0);
        let reports = (0..500).map(|i| report(1 + 500 * frame + i, point![anywhere(), anywhere()])).collect();
        room.sent.push(Packet {
            station: StationId(1),
            life: 3,
            sequence: frame + 1,
            time_s: room.time_s(),
            reports,
            ..Packet::default()
        });
        room.step(&three(), |a, _| a == 0);
        assert!(room.rules[0].people().len() <= 64);
    }
}
