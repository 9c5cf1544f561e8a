//! People who walk through a synthetic room.

use nalgebra::{Point2, Point3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::floor::{CLEARANCE_M, FreeFloor};
use super::gait::BodyPose;
use super::path::{PLAN_STEP_S, PlannedPath, Stop, Trajectory, plan};
use super::person::{Body, BodyPart};
use super::room::SyntheticRoom;
use scenes::geometry::point_from_vec3;

/// Options of the people who walk through a room.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkerOptions {
    /// Seed of bodies and ways.
    pub seed: u64,
    /// Number of people.
    pub people: usize,
    /// Time until which the room is empty.
    pub first_s: f64,
    /// Mean time between the entries of two people.
    pub interval_s: f64,
    /// Number of stops of each person between the doors; the middle one is near the middle of the room, where ways
    /// cross.
    pub stops: usize,
    /// Longest stay at a place.
    pub longest_stay_s: f64,
    /// For each person in turn, the places they pass between the doors instead of random ones.
    pub ways: Vec<Vec<Point2<f64>>>,
}

impl Default for WalkerOptions {
    fn default() -> Self {
        Self {
            seed: 1,
            people: 3,
            first_s: 2.0,
            interval_s: 2.5,
            stops: 3,
            longest_stay_s: 1.5,
            ways: Vec::new(),
        }
    }
}

/// A person who walks through the room.
#[derive(Debug, Clone)]
pub struct Walker {
    /// Id, counted from 1.
    pub id: u32,
    /// Appearance of the person.
    pub body: Body,
    trajectory: Trajectory,
    /// Start and end of the time on a seat, seconds.
    seated_s: Option<(f64, f64)>,
}

impl Walker {
    /// A random person on a given way: from `first_s` on (to a quarter of a second) through the corners of the way, at
    /// a steady speed. Collisions are not avoided.
    pub fn along(id: u32, seed: u64, first_s: f64, speed_m_s: f64, way: &[Point2<f64>]) -> Self {
        let first_step = (first_s / PLAN_STEP_S).round() as usize;
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let trajectory = Trajectory::new(&(first_step, Self::places(speed_m_s, way)));
        Self { id, body: Body::random(&mut rng), trajectory, seated_s: None }
    }

    /// [`Self::along`] the way `to` a seat at its end, on which the person sits for `stay_s` seconds, and then along the
    /// way `from` it.
    pub fn with_seat(
        id: u32,
        seed: u64,
        first_s: f64,
        speed_m_s: f64,
        [to, from]: [&[Point2<f64>]; 2],
        stay_s: f64,
    ) -> Self {
        let mut walker = Self::along(id, seed, first_s, speed_m_s, to);
        let mut places = Self::places(speed_m_s, to);
        let first_step = (first_s / PLAN_STEP_S).round() as usize;
        let seated_from_s = PLAN_STEP_S * (first_step + places.len()) as f64;
        let seat = places.last().copied();
        let steps = (stay_s / PLAN_STEP_S).round() as usize;
        places.extend(seat.iter().cycle().take(if seat.is_some() { steps } else { 0 }));
        places.extend(Self::places(speed_m_s, from));
        walker.trajectory = Trajectory::new(&(first_step, places));
        walker.seated_s = Some((seated_from_s, seated_from_s + PLAN_STEP_S * steps as f64));
        walker
    }

    /// Places of a steady walk at each planning step.
    fn places(speed_m_s: f64, way: &[Point2<f64>]) -> Vec<Point2<f64>> {
        let step_m = speed_m_s * PLAN_STEP_S;
        let mut places: Vec<Point2<f64>> = way.first().copied().into_iter().collect();
        let mut left_m = step_m;
        for side in way.windows(2) {
            let length_m = (side[1] - side[0]).norm();
            while left_m <= length_m && length_m > 0.0 {
                places.push(side[0] + (side[1] - side[0]) * (left_m / length_m));
                left_m += step_m;
            }
            left_m -= length_m;
        }
        places
    }

    /// First and last moment of the person's presence, seconds, corridors included.
    pub fn span_s(&self) -> (f64, f64) {
        self.trajectory.span_s()
    }

    /// Place of the person: the middle of the pelvis, projected to the floor; `None` before they come and after they
    /// left.
    pub fn place(&self, time_s: f64) -> Option<Point2<f64>> {
        self.trajectory.at_time(time_s).map(|(place, ..)| place)
    }

    /// Middle of the head; `None` when the person is not there.
    pub fn head(&self, time_s: f64) -> Option<Point3<f64>> {
        Some(point_from_vec3(self.body.head(&self.pose(time_s)?)))
    }

    pub(super) fn pose(&self, time_s: f64) -> Option<BodyPose> {
        let (_, way_m, speed_m_s) = self.trajectory.at_time(time_s)?;
        let height_m = self.body.height_m as f32;
        let pose = BodyPose::walking(&self.trajectory, way_m as f32, speed_m_s as f32, height_m);
        Some(match self.seated_fraction(time_s) {
            share if share > 0.0 => pose.seated(share as f32, height_m),
            _ => pose,
        })
    }

    /// Fraction of the way from standing (0) to the seat (1); between while the person sits down or rises.
    fn seated_fraction(&self, time_s: f64) -> f64 {
        /// Time to sit down or to rise, seconds.
        const SITS_DOWN_S: f64 = 1.2;
        let Some((from_s, to_s)) = self.seated_s else { return 0.0 };
        let t = ((time_s - from_s).min(to_s - time_s) / SITS_DOWN_S).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }

    pub(super) fn parts(&self, time_s: f64) -> Option<Vec<BodyPart>> {
        Some(self.body.parts(&self.pose(time_s)?))
    }
}

impl SyntheticRoom {
    /// People for this room. A person without a collision-free way for a minute is left out.
    pub fn walkers(&self, options: &WalkerOptions) -> Vec<Walker> {
        /// Number of tries to enter, each a second after the last.
        const ATTEMPTS: usize = 60;
        let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
        let floor = FreeFloor::new(self.size(), &self.doors, &self.furniture, CLEARANCE_M);
        let mut plans: Vec<PlannedPath> = Vec::new();
        let mut walkers: Vec<Walker> = Vec::new();
        let mut enters_s = options.first_s;
        for person in 0..options.people {
            let body = Body::random(&mut rng);
            let speed = rng.random_range(0.95..1.35);
            let mut stops = self.stops(&floor, options, &mut rng);
            if let (Some(way), [first, .., last]) = (options.ways.get(person), &stops[..]) {
                let on_way = way.iter().map(|place| Stop { place: *place, stay_s: 0.0 });
                stops = std::iter::once(*first).chain(on_way).chain([*last]).collect();
            }
            for attempt in 0..ATTEMPTS {
                let step = ((enters_s + attempt as f64) / PLAN_STEP_S).round() as usize;
                if let Some(found) = plan(&floor, &plans, step, &stops, speed) {
                    let trajectory = Trajectory::new(&found);
                    let id = walkers.len() as u32 + 1;
                    walkers.push(Walker { id, body, trajectory, seated_s: None });
                    plans.push(found);
                    break;
                }
            }
            enters_s += options.interval_s * rng.random_range(0.6..1.4);
        }
        walkers
    }

    /// A way through the room: a door, places, a door.
    fn stops(&self, floor: &FreeFloor, options: &WalkerOptions, rng: &mut Pcg64Mcg) -> Vec<Stop> {
        let first = rng.random_range(0..self.doors.len());
        let last = rng.random_range(0..self.doors.len());
        let door = |i: usize| Stop { place: self.doors[i].outside(), stay_s: 0.0 };
        let inside: Vec<Point2<f64>> = floor
            .reachable(&self.doors[first].outside())
            .into_iter()
            .map(|cell| floor.center(cell))
            .filter(|p| self.is_inside(p))
            .collect();
        let middle = Point2::new(0.5 * self.size_m[0], 0.5 * self.size_m[1]);
        let central: Vec<Point2<f64>> =
            inside.iter().copied().filter(|p| (p - middle).norm() < 0.3 * self.size_m[1]).collect();
        let mut stops = vec![door(first)];
        for k in 0..options.stops {
            let choice = if k == options.stops / 2 && !central.is_empty() { &central } else { &inside };
            if choice.is_empty() {
                break;
            }
            let place = choice[rng.random_range(0..choice.len())];
            let stays = rng.random_bool(0.5);
            let stay_s = if stays { options.longest_stay_s * rng.random_range(0.0..1.0) } else { 0.0 };
            stops.push(Stop { place, stay_s });
        }
        stops.push(door(last));
        stops
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RoomOptions;

    #[test]
    fn a_given_way_is_walked_at_a_steady_speed() {
        let way = [(1.0, 1.0), (5.0, 1.0), (5.0, 3.0)].map(|(x, y)| Point2::new(x, y));
        let walker = Walker::along(4, 9, 2.0, 1.0, &way);
        assert_eq!((walker.id, walker.span_s()), (4, (2.0, 8.0)));
        for (time_s, x, y) in [(2.0, 1.0, 1.0), (4.0, 3.0, 1.0), (7.0, 5.0, 2.0), (8.0, 5.0, 3.0)] {
            let place = walker.place(time_s).unwrap();
            assert!((place - Point2::new(x, y)).norm() < 0.02, "{place} at {time_s} s");
        }
        assert!(walker.place(1.9).is_none() && walker.place(8.1).is_none());
    }

    #[test]
    fn people_come_through_doors_keep_off_furniture_and_each_other_and_leave() {
        for seed in 0..4 {
            let room =
                RoomOptions { seed, doors: 2 + seed as usize % 2, ..RoomOptions::default() }.build().unwrap();
            let walkers = room.walkers(&WalkerOptions { seed, people: 4, ..WalkerOptions::default() });
            assert_eq!(walkers.len(), 4, "everybody finds a way in room {seed}");
            for walker in &walkers {
                let (start, end) = walker.span_s();
                assert!(!room.is_inside(&walker.place(start).unwrap()));
                assert!(!room.is_inside(&walker.place(end).unwrap()));
                let mut was_inside = false;
                let mut entered_in_zone = true;
                for i in 0..((end - start) / 0.05) as usize {
                    let p = walker.place(start + i as f64 * 0.05).unwrap();
                    if room.is_inside(&p) {
                        assert!(room.is_free(&p), "room {seed}: somebody stands in furniture at {p}");
                        if !was_inside {
                            entered_in_zone &= room.room.zones.iter().any(|z| z.polygon.distance_m(&p) < 0.1);
                        }
                    }
                    was_inside = room.is_inside(&p);
                }
                assert!(entered_in_zone);
            }
            let last = walkers.iter().map(|w| w.span_s().1).fold(0.0, f64::max);
            let mut together = 0;
            for i in 0..(last / 0.05) as usize {
                let places: Vec<_> = walkers.iter().filter_map(|w| w.place(i as f64 * 0.05)).collect();
                together += usize::from(places.len() > 1);
                for (k, a) in places.iter().enumerate() {
                    assert!(places[..k].iter().all(|b| (a - b).norm() > 0.5), "room {seed}");
                }
            }
            assert!(together > 60, "room {seed}: people meet in {together} samples only");
        }
    }
}
