//! People of one trial: their trajectories and attributes.

use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Point2, Vector2, point, vector};
use rand::seq::{IndexedRandom, SliceRandom};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::site::{HALF_WIDTH_M, HALL_RADIUS_M, is_crossed};
use super::{Layout, Options, Site, Wall, layout};

/// Distance below which two people may be swapped, metres: the paper's radius of tracking.
pub const CLOSE_M: f64 = 1.0;
/// Attributes of the six people as published; an option sets the difference between persons 3 and 4.
const ATTRIBUTES: [f64; 6] = [0.05, 0.30, 0.95, 0.52, 0.62, 0.80];
/// Largest random shift and delay of each of the six people in a trial, metres and seconds.
const JITTER: f64 = 0.15;
/// Time for which people stand apart before they walk in the layouts of any number of people, seconds: the stations
/// have to initialise their tracks, while those of the paper know all people at the start.
const STANDING_S: f64 = 4.0;
/// Time before the end of a trial in a hall in which no person starts to walk, seconds: as in the layouts of six,
/// meetings are over by then.
const LAST_WALK_S: f64 = 10.0;
/// Lengths of the walks in a hall, metres.
const WALK_M: Range<f64> = 3.0..8.0;
/// Durations of the rests between walks, seconds.
const REST_S: Range<f64> = 0.5..2.0;

/// Stations, walls and people of one trial.
#[derive(Debug, Clone)]
pub struct World {
    /// Options of the simulation.
    pub options: Options,
    /// Stations and walls.
    pub site: Arc<Site>,
    /// Attribute of each person, 0 to 1.
    pub attributes: Vec<f64>,
    /// Places, metres: `[frame][person]`.
    paths: Vec<Vec<Point2<f64>>>,
    /// Seed and number of the trial.
    key: [u64; 2],
}

impl World {
    /// Creates the people of trial number `trial`.
    pub fn new(options: &Options, site: &Arc<Site>, seed: u64, trial: u64) -> Self {
        let mut world = Self {
            options: options.clone(),
            site: Arc::clone(site),
            attributes: Vec::new(),
            paths: Vec::new(),
            key: [seed, trial],
        };
        let mut rng = world.random(0);
        world.attributes = attributes(options, &mut rng);
        world.paths = match layout::place(options.layout) {
            Some(place) => jittered(place, options, &mut rng),
            None if options.layout == Layout::Corridor => along_corridor(options, site.radius_m, &mut rng),
            None => in_hall(options, &site.walls, &mut rng),
        };
        world
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.paths.len()
    }

    /// Time of a frame since the start of the trial, seconds.
    pub fn time_s(&self, frame: usize) -> f64 {
        frame as f64 / self.options.rate_hz
    }

    /// Places of all people at a frame, metres.
    pub fn places(&self, frame: usize) -> &[Point2<f64>] {
        &self.paths[frame]
    }

    /// First and last time at which all people are apart and known to all stations, seconds.
    pub(super) fn naming_s(&self) -> [f64; 2] {
        match layout::place(self.options.layout) {
            Some(_) => [1.0, 2.5],
            None => [STANDING_S - 1.5, STANDING_S],
        }
    }

    /// Random generator of this trial for one purpose.
    pub(super) fn random(&self, purpose: u64) -> Pcg64Mcg {
        let mut mixed = 0u64;
        for part in [self.key[0], self.key[1], purpose] {
            // The finaliser of SplitMix64 (Steele, Lea & Flood 2014): neighbouring keys give unrelated seeds.
            let mut z = (mixed ^ part).wrapping_add(0x9E37_79B9_7F4A_7C15);
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            mixed = z ^ (z >> 31);
        }
        Pcg64Mcg::seed_from_u64(mixed)
    }
}

/// Attributes of all people, with differences of `attribute_gap` if so many fit between 0 and 1.
fn attributes(options: &Options, rng: &mut impl Rng) -> Vec<f64> {
    if layout::place(options.layout).is_some() {
        let mut attributes = ATTRIBUTES.to_vec();
        let middle = 0.5 * (attributes[3] + attributes[4]);
        attributes[3] = middle - 0.5 * options.attribute_gap;
        attributes[4] = middle + 0.5 * options.attribute_gap;
        return attributes;
    }
    let count = options.people;
    let gap = options.attribute_gap.min(1.0 / count as f64);
    let first = 0.5 * (1.0 - gap * (count - 1) as f64);
    let mut attributes: Vec<f64> = (0..count).map(|i| first + gap * i as f64).collect();
    attributes.shuffle(rng);
    attributes
}

/// Trajectories of six people with a random shift and delay each, metres: `[frame][person]`.
fn jittered(
    place: fn(usize, f64) -> Point2<f64>,
    options: &Options,
    rng: &mut impl Rng,
) -> Vec<Vec<Point2<f64>>> {
    let mut jitter = || rng.random_range(-JITTER..JITTER);
    let shifts: Vec<(Vector2<f64>, f64)> =
        (0..ATTRIBUTES.len()).map(|_| (vector![jitter(), jitter()], jitter())).collect();
    (0..options.frames())
        .map(|frame| {
            let t = frame as f64 / options.rate_hz;
            let shifted = |(person, (shift, delay_s)): (usize, &(Vector2<f64>, f64))| {
                place(person, (t + delay_s).max(0.0)) + shift
            };
            shifts.iter().enumerate().map(shifted).collect()
        })
        .collect()
}

/// Trajectories along a corridor: straight from one place to the next, each person at a constant speed.
fn along_corridor(options: &Options, radius_m: f64, rng: &mut impl Rng) -> Vec<Vec<Point2<f64>>> {
    let on_ring = |angle: f64, rng: &mut dyn Rng| {
        let radius = radius_m + rng.random_range(-HALF_WIDTH_M..HALF_WIDTH_M);
        point![radius * angle.cos(), radius * angle.sin()]
    };
    let anywhere = |rng: &mut dyn Rng| on_ring(rng.random_range(0.0..TAU), rng);
    let mut walkers: Vec<Walker> = apart_from_each_other(options.people, rng, anywhere)
        .into_iter()
        .map(|place| Walker { place, goal: place, speed: walking_speed(rng) })
        .collect();
    let mut senses: Vec<f64> =
        walkers.iter().map(|_| if rng.random_bool(0.5) { 1.0 } else { -1.0 }).collect();
    frame_by_frame(options, |_| {
        for (walker, sense) in walkers.iter_mut().zip(&mut senses) {
            if walker.place == walker.goal {
                if rng.random_bool(0.1) {
                    *sense = -*sense;
                }
                let on = *sense * rng.random_range(3.0..8.0) / radius_m;
                walker.goal = on_ring(walker.place.y.atan2(walker.place.x) + on, rng);
            }
            walker.walk(1.0 / options.rate_hz);
        }
        walkers.iter().map(|walker| walker.place).collect()
    })
}

/// Trajectories in a hall: from one spot to another that is free, with a rest at each; the last rest lasts until the
/// end. Spots are apart from each other, and no walk crosses a wall.
fn in_hall(options: &Options, walls: &[Wall], rng: &mut impl Rng) -> Vec<Vec<Point2<f64>>> {
    let count = options.people;
    let anywhere = |rng: &mut dyn Rng| {
        let (angle, radius) = (rng.random_range(0.0..TAU), rng.random_range(0.0..1.0f64).sqrt());
        point![angle.cos(), angle.sin()] * (radius * 0.8 * HALL_RADIUS_M)
    };
    let spots = apart_from_each_other(count + count / 2, rng, anywhere);
    let mut taken: Vec<usize> = (0..count).collect();
    let mut walkers: Vec<Walker> = spots[..count]
        .iter()
        .map(|place| Walker { place: *place, goal: *place, speed: walking_speed(rng) })
        .collect();
    let mut rest_until_s = vec![STANDING_S; count];
    frame_by_frame(options, |time_s| {
        for person in 0..count {
            let walker = &mut walkers[person];
            let is_resting = walker.place == walker.goal;
            if is_resting && time_s >= rest_until_s[person] && time_s < options.seconds - LAST_WALK_S {
                let is_free = |spot: &usize| {
                    let distance = (spots[*spot] - walker.place).norm();
                    !taken.contains(spot)
                        && WALK_M.contains(&distance)
                        && !walls.iter().any(|wall| is_crossed(wall, walker.place, spots[*spot]))
                };
                let free: Vec<usize> = (0..spots.len()).filter(is_free).collect();
                if let Some(spot) = free.choose(rng) {
                    (taken[person], walker.goal) = (*spot, spots[*spot]);
                }
            }
            if walker.place != walker.goal {
                walker.walk(1.0 / options.rate_hz);
                rest_until_s[person] = time_s + rng.random_range(REST_S);
            }
        }
        walkers.iter().map(|walker| walker.place).collect()
    })
}

/// Places at each frame, metres; people stand still for the first [`STANDING_S`].
fn frame_by_frame(options: &Options, mut walk: impl FnMut(f64) -> Vec<Point2<f64>>) -> Vec<Vec<Point2<f64>>> {
    let mut paths: Vec<Vec<Point2<f64>>> = Vec::with_capacity(options.frames());
    for frame in 0..options.frames() {
        let time_s = frame as f64 / options.rate_hz;
        let places = match paths.last() {
            Some(last) if time_s < STANDING_S => last.clone(),
            _ => walk(time_s),
        };
        paths.push(places);
    }
    paths
}

/// Random places at least 1.5 m apart; a place for which many tries fail is nearer to others.
fn apart_from_each_other(
    count: usize,
    rng: &mut impl Rng,
    mut anywhere: impl FnMut(&mut dyn Rng) -> Point2<f64>,
) -> Vec<Point2<f64>> {
    const TRIES: usize = 1000;
    let mut places: Vec<Point2<f64>> = Vec::new();
    for _ in 0..count {
        let mut place = anywhere(rng);
        for _ in 0..TRIES {
            if places.iter().all(|other| (other - place).norm() > 1.5 * CLOSE_M) {
                break;
            }
            place = anywhere(rng);
        }
        places.push(place);
    }
    places
}

fn walking_speed(rng: &mut impl Rng) -> f64 {
    layout::SPEED * rng.random_range(0.8..1.2)
}

/// Person who walks from one place to the next.
struct Walker {
    place: Point2<f64>,
    goal: Point2<f64>,
    speed: f64,
}

impl Walker {
    /// Moves the person towards the goal for a time, and stops there.
    fn walk(&mut self, seconds: f64) {
        let way = self.goal - self.place;
        let length = self.speed * seconds;
        self.place = if way.norm() <= length { self.goal } else { self.place + way.normalize() * length };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn world(options: &Options, seed: u64, trial: u64) -> World {
        World::new(options, &Arc::new(Site::new(options)), seed, trial)
    }

    #[test]
    fn a_trial_is_reproducible_and_differs_from_the_others() {
        let options = Options::hard();
        let (a, b) = (world(&options, 1, 2), world(&options, 1, 2));
        assert_eq!((a.paths, a.attributes), (b.paths.clone(), b.attributes));
        assert_ne!(b.paths, world(&options, 1, 3).paths);
        assert_ne!(b.paths, world(&options, 2, 2).paths);
    }

    #[test]
    fn no_person_walks_through_walls_or_out_of_the_corridor() {
        let hall = world(&Options::hard(), 1, 0);
        for (before, after) in hall.paths.iter().zip(&hall.paths[1..]) {
            for (a, b) in before.iter().zip(after) {
                assert!(!hall.site.walls.iter().any(|wall| is_crossed(wall, *a, *b)));
            }
        }
        let corridor = world(&Options::corridor(10, 20), 1, 0);
        let off = |p: &Point2<f64>| (p.coords.norm() - corridor.site.radius_m).abs();
        assert!(corridor.paths.iter().flatten().all(|p| off(p) < HALF_WIDTH_M + 1.0));
    }

    #[test]
    fn attributes_differ_by_the_requested_gap() {
        let mut attributes = world(&Options::hard(), 1, 0).attributes;
        attributes.sort_by(f64::total_cmp);
        assert!(attributes.windows(2).all(|w| (w[1] - w[0] - 0.03).abs() < 1e-9));
        let six = world(&Options::published(Layout::Once), 1, 0).attributes;
        assert!((six[4] - six[3] - 0.1).abs() < 1e-9);
    }
}
