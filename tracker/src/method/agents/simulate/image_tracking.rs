//! Simulated image tracking of one station (Nakazawa et al., section 4.2.1).

use std::collections::BTreeMap;

use nalgebra::{Matrix2, Point2, Vector2};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::super::{Colour, Looks, Restart, Sighting, Sightings};
use super::{CLOSE_M, World};

/// Time after which an untracked person, apart from others, gets a track, seconds.
const BIRTH_S: f64 = 1.0;
/// Maximum number of tracks on one person.
const MAX_TRACKS: usize = 2;
/// Hue of attribute 0, and difference of hue between attributes 0 and 1, degrees. With all noise attributes are between
/// -0.3 and 1.3, for which hue does not wrap.
const HUE_DEG: [f64; 2] = [60.0, 180.0];
/// Height of all people, metres.
const HEIGHT_M: f64 = 1.7;

/// Difference of hue for a difference of attributes, degrees.
pub fn hue_difference_deg(attribute: f64) -> f64 {
    HUE_DEG[1] * attribute
}

/// Behaviour of image tracks of people who are close.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Crossing {
    /// Each track follows a random person within 1 m, independently of the other tracks: as published. A restart may
    /// begin a second track on a person.
    Random,
    /// Each person has at most one track, and the tracks of two people who are close are swapped at random, as when
    /// regions of a mask are tracked.
    Swapped,
}

/// Simulated image tracking of one station.
#[derive(Debug, Clone)]
pub struct ImageTracking {
    station: usize,
    crossing: Crossing,
    rng: Pcg64Mcg,
    /// Person whom each track follows.
    tracks: BTreeMap<u32, usize>,
    next: u32,
    /// Number of frames for which each person was visible, apart from others and untracked.
    untracked: Vec<u32>,
    /// Measured places of the last frame, metres, and their people.
    seen: Vec<(Point2<f64>, usize)>,
}

impl ImageTracking {
    /// Creates the tracking of a station; at first a track follows each person in view, with the person's number.
    pub fn new(world: &World, station: usize, crossing: Crossing) -> Self {
        let in_view = |person: &usize| world.site.sees(station, world.places(0)[*person]);
        let tracks =
            (0..world.options.people).filter(in_view).map(|person| (person as u32, person)).collect();
        Self {
            station,
            crossing,
            rng: world.random(1 + station as u64),
            tracks,
            next: world.options.people as u32,
            untracked: vec![0; world.options.people],
            seen: Vec::new(),
        }
    }

    /// Sightings of the station in a frame; births are also proposed at the places of `restarts`.
    pub fn step(&mut self, world: &World, frame: usize, restarts: &[Restart]) -> Sightings {
        let places = world.places(frame);
        let visible: Vec<usize> =
            (0..places.len()).filter(|p| world.site.sees(self.station, places[*p])).collect();
        self.follow(places, &visible);
        self.start_at_restarts(places, &visible, restarts);
        let apart = |person: usize| visible.iter().all(|o| *o == person || !is_close(places, person, *o));
        self.start_on_untracked(world.options.rate_hz, &visible, apart);
        let measured: Vec<(usize, Sighting)> =
            visible.iter().map(|p| (*p, self.measure(world, places[*p], *p, !apart(*p)))).collect();
        let sighting = |(track, person): (&u32, &usize)| {
            let found = measured.binary_search_by_key(person, |(p, _)| *p).ok()?;
            Some(Sighting { track: *track, ..measured[found].1 })
        };
        let people: Vec<Sighting> = self.tracks.iter().filter_map(sighting).collect();
        self.seen = measured.iter().map(|(person, sighting)| (sighting.position, *person)).collect();
        Sightings { time_s: world.time_s(frame), people, is_usable: true }
    }

    /// Person of the measurement at a position in the last frame; `None` for another position.
    pub fn person_at(&self, position: Point2<f64>) -> Option<usize> {
        self.seen.iter().find(|(p, _)| *p == position).map(|(_, person)| *person)
    }

    /// Moves the tracks to visible people by the crossing behaviour, and ends tracks without a visible person.
    fn follow(&mut self, places: &[Point2<f64>], visible: &[usize]) {
        if self.crossing == Crossing::Random {
            let rng = &mut self.rng;
            self.tracks.retain(|_, person| {
                let near: Vec<usize> =
                    visible.iter().copied().filter(|p| is_close(places, *person, *p)).collect();
                if !near.is_empty() {
                    *person = near[rng.random_range(0..near.len())];
                }
                !near.is_empty()
            });
            return;
        }
        self.tracks.retain(|_, person| visible.binary_search(person).is_ok());
        let of_person = |tracks: &BTreeMap<u32, usize>, person: usize| {
            tracks.iter().find(|(_, p)| **p == person).map(|(track, _)| *track)
        };
        for (index, a) in visible.iter().enumerate() {
            for b in &visible[..index] {
                if is_close(places, *a, *b) && self.rng.random_bool(0.5) {
                    let pair = (of_person(&self.tracks, *a), of_person(&self.tracks, *b));
                    pair.0.map(|track| self.tracks.insert(track, *b));
                    pair.1.map(|track| self.tracks.insert(track, *a));
                }
            }
        }
    }

    /// Begins a track at each restart, on the nearest person within 1 m who may have another track.
    fn start_at_restarts(&mut self, places: &[Point2<f64>], visible: &[usize], restarts: &[Restart]) {
        let most = if self.crossing == Crossing::Random { MAX_TRACKS } else { 1 };
        for restart in restarts {
            let distance = |person: usize| (places[person] - restart.position).norm();
            let may_begin =
                |p: usize| distance(p) < CLOSE_M && self.tracks.values().filter(|o| **o == p).count() < most;
            let nearest = visible.iter().copied().filter(|p| may_begin(*p));
            if let Some(person) = nearest.min_by(|a, b| distance(*a).total_cmp(&distance(*b))) {
                self.begin(person);
            }
        }
    }

    /// Begins tracks on people who have been untracked for [`BIRTH_S`].
    fn start_on_untracked(&mut self, rate_hz: f64, visible: &[usize], apart: impl Fn(usize) -> bool) {
        let mut counts = vec![0; self.untracked.len()];
        for person in visible {
            if apart(*person) && !self.tracks.values().any(|p| p == person) {
                counts[*person] = self.untracked[*person] + 1;
                if f64::from(counts[*person]) > BIRTH_S * rate_hz {
                    counts[*person] = 0;
                    self.begin(*person);
                }
            }
        }
        self.untracked = counts;
    }

    fn begin(&mut self, person: usize) {
        self.tracks.insert(self.next, person);
        self.next += 1;
    }

    fn measure(&mut self, world: &World, place: Point2<f64>, person: usize, is_crowded: bool) -> Sighting {
        let noise = &world.options.noise;
        let factor = if is_crowded { noise.close_factor } else { 1.0 };
        let [along, across, colour] = [(); 3].map(|()| factor * self.rng.random_range(-1.0..1.0));
        let sight = (place - world.site.stations[self.station].position).normalize();
        let aside = Vector2::new(-sight.y, sight.x);
        // The variance of a uniform error within ± a is a² / 3.
        let variance = |limit: f64| (factor * limit).powi(2) / 3.0;
        let covariance: Matrix2<f64> = sight * sight.transpose() * variance(noise.along_m)
            + aside * aside.transpose() * variance(noise.across_m);
        let attribute = world.attributes[person] + colour * noise.attribute;
        let hue_deg = (HUE_DEG[0] + hue_difference_deg(attribute)) as f32;
        Sighting {
            track: 0,
            position: place + sight * along * noise.along_m + aside * across * noise.across_m,
            covariance,
            height_m: HEIGHT_M,
            looks: Some(Looks { colours: [Colour { hue_deg, saturation: 1.0, value: 0.6 }; 3] }),
            is_crowded,
        }
    }
}

fn is_close(places: &[Point2<f64>], a: usize, b: usize) -> bool {
    (places[a] - places[b]).norm() < CLOSE_M
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::sync::Arc;

    use super::*;
    use crate::method::agents::simulate::{Layout, Options, Site};

    fn world(options: &Options) -> World {
        World::new(options, &Arc::new(Site::new(options)), 5, 0)
    }

    #[test]
    fn errors_are_within_their_limits_along_and_across_the_sight_and_as_large_as_their_covariance() {
        let world = world(&Options::published(Layout::Once));
        let mut tracking = ImageTracking::new(&world, 2, Crossing::Swapped);
        let camera = world.site.stations[2].position;
        let (mut sum, mut count) = (0.0, 0.0);
        for frame in 0..world.frames() {
            for sighting in tracking.step(&world, frame, &[]).people {
                let person = tracking.person_at(sighting.position).unwrap();
                let place = world.places(frame)[person];
                let sight = (place - camera).normalize();
                let error = sighting.position - place;
                let factor = if sighting.is_crowded { 2.0 } else { 1.0 };
                assert!(error.dot(&sight).abs() <= 0.6 * factor + 1e-9);
                assert!(sight.perp(&error).abs() <= 0.3 * factor + 1e-9);
                let inverse = sighting.covariance.try_inverse().unwrap();
                sum += (error.transpose() * inverse * error).x;
                count += 1.0;
                let nearest =
                    (0..6).filter(|p| *p != person).map(|p| (world.places(frame)[p] - place).norm());
                assert_eq!(sighting.is_crowded, nearest.fold(f64::INFINITY, f64::min) < CLOSE_M);
            }
        }
        // The square of the Mahalanobis distance is 2 on average.
        assert!((sum / count - 2.0f64).abs() < 0.1, "{}", sum / count);
    }

    #[test]
    fn swapped_tracks_stay_one_a_person_and_random_ones_do_not() {
        let world = world(&Options::published(Layout::Once));
        let most = |crossing| {
            let mut tracking = ImageTracking::new(&world, 0, crossing);
            let double = |frame| {
                tracking.step(&world, frame, &[]);
                let followed: BTreeSet<usize> = tracking.tracks.values().copied().collect();
                tracking.tracks.len() - followed.len()
            };
            (0..world.frames()).map(double).max()
        };
        assert_eq!(most(Crossing::Swapped), Some(0));
        assert!(most(Crossing::Random) > Some(0));
    }

    #[test]
    fn an_untracked_person_gets_a_track_after_a_second_or_at_a_restart() {
        let world = world(&Options::published(Layout::Once));
        let restart = Restart { position: world.places(0)[3], height_m: 1.7 };
        for (restarts, first) in [(vec![], 10), (vec![restart], 0)] {
            let mut tracking = ImageTracking::new(&world, 0, Crossing::Swapped);
            tracking.tracks.remove(&3);
            let tracks: Vec<usize> =
                (0..15).map(|frame| tracking.step(&world, frame, &restarts).people.len()).collect();
            assert_eq!(tracks.iter().position(|count| *count == 6), Some(first), "{tracks:?}");
        }
    }

    #[test]
    fn no_person_is_seen_through_a_wall() {
        let world = world(&Options::hard());
        let mut tracking = ImageTracking::new(&world, 1, Crossing::Random);
        for frame in 0..world.frames() {
            for sighting in tracking.step(&world, frame, &[]).people {
                let person = tracking.person_at(sighting.position).unwrap();
                assert!(world.site.sees(1, world.places(frame)[person]));
            }
        }
    }
}
