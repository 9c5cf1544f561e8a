use std::collections::BTreeSet;

use nalgebra::{Matrix2, Vector2};
use rand::RngExt;

use super::super::motion::{Measurement, Motion};
use super::super::options::Spread;
use super::super::smoother::FixedLagSmoother;
use super::super::trace::Trace;
use super::super::traits::{LearntTraits, ShownTraits};
use super::window::Sums;
use super::*;

const STEP_S: f64 = 0.25;
/// Standard deviation of the heights that one moment shows, metres, and that of its places.
const HEIGHT_SIGMA_M: f64 = 0.04;
const PLACE_SIGMA_M: f64 = 0.05;
/// Moment at which people meet.
const MEET: usize = 24;

/// A track at one moment: key, place and the height of the person whom it follows, metres. Its first name is its key.
type Followed = (Key, Vector2<f64>, f64);

/// Held moments, and the encounters in them.
struct Held {
    smoother: FixedLagSmoother,
    motions: BTreeMap<Key, Motion>,
    encounters: Encounters,
    /// Name of each track now.
    names: BTreeMap<Key, TrackId>,
    moments: usize,
    /// Log odds by time and place that a lost person comes back.
    returns_nats: f64,
    /// Appearance vectors of the people with these heights, and their noise.
    vectors: Vec<(f64, [f32; 4])>,
    rng: Pcg64Mcg,
}

impl Held {
    fn new(returns_nats: f64) -> Self {
        Self {
            smoother: FixedLagSmoother::default(),
            motions: BTreeMap::new(),
            encounters: Encounters::new(&McmcOptions { seed: 1, ..McmcOptions::of_boxes() }),
            names: BTreeMap::new(),
            moments: 0,
            returns_nats,
            vectors: Vec::new(),
            rng: Pcg64Mcg::seed_from_u64(5),
        }
    }

    /// Adds a moment with these tracks, and weighs the encounters. Whether a name changed.
    fn add(&mut self, tracks: &[Followed]) -> bool {
        let options = McmcOptions::of_boxes();
        let covariance = Matrix2::identity() * PLACE_SIGMA_M.powi(2);
        let mut traces: Vec<Trace> = Vec::new();
        for (key, place, height_m) in tracks {
            let measured = Measurement { place: *place, covariance };
            let motion = match self.motions.get(key) {
                Some(before) => before.continued(STEP_S, true, Some(&measured), &options.motion),
                None => Motion::appeared(*place, &covariance, &options.motion),
            };
            self.motions.insert(*key, motion.clone());
            let mut vector = MeanVector::default();
            if let Some((_, exact)) = self.vectors.iter().find(|(of_m, _)| of_m.total_cmp(height_m).is_eq()) {
                vector.add_box(&exact.map(|value| value + self.rng.random_range(-0.3..0.3)));
            }
            let height = Some(Spread { mean_m: *height_m, sigma_m: HEIGHT_SIGMA_M });
            traces.push(Trace {
                key: *key,
                id: Some(*self.names.entry(*key).or_insert(TrackId(*key as u32))),
                motion,
                radius_m: 0.25,
                height_m: 1.7,
                confidence: 1.0,
                visible: vec![1.0],
                shown: ShownTraits { height, vector, ..ShownTraits::default() },
                learnt: LearntTraits::default(),
            });
        }
        let now_s = self.moments as f64 * STEP_S;
        self.smoother.push((self.moments as u32, now_s), REMEMBERED_S, traces, true);
        self.moments += 1;
        let (encounters, moments) = (&mut self.encounters, &mut self.smoother.moments);
        encounters.observe_names(moments);
        let renamed = encounters.decide(moments, &options, &|_, _| self.returns_nats);
        if let Some(renamed) = &renamed {
            self.names = renamed.names.clone();
        }
        renamed.is_some()
    }

    /// Name and shown height of each track in a held moment.
    fn shown(&self, moment: usize) -> Vec<(u32, f64)> {
        let at =
            self.smoother.moments.iter().find(|held| (held.time_s - moment as f64 * STEP_S).abs() < 1e-9);
        let people = at.iter().flat_map(|held| &held.people);
        people.map(|trace| (trace.id.unwrap().0, trace.shown.height.unwrap().mean_m)).collect()
    }
}

/// People who walk to one place from all sides, stand together for a second, and walk back; from then on each track has the person
/// of the next one.
fn meeting(moment: usize, heights_m: &[f64]) -> Vec<Followed> {
    let away_m = 0.05 + ((moment as f64 - MEET as f64).abs() - 2.0).max(0.0) * 0.1;
    let count = heights_m.len();
    let place = |person: usize| {
        let angle = std::f64::consts::TAU * person as f64 / count as f64;
        Vector2::new(3.0, 2.0) + away_m * Vector2::new(angle.cos(), angle.sin())
    };
    let person = |track: usize| if moment < MEET { track } else { (track + 1) % count };
    (0..count).map(|track| (track as Key, place(person(track)), heights_m[person(track)])).collect()
}

/// First moment after the meeting at which a name changes, with what is held a second later.
fn decision(heights_m: &[f64]) -> Option<(usize, Held)> {
    decision_by_vectors(heights_m, &[])
}

/// The same where people also show these vectors.
fn decision_by_vectors(heights_m: &[f64], vectors: &[[f32; 4]]) -> Option<(usize, Held)> {
    let mut held = Held::new(0.0);
    held.vectors = heights_m.iter().copied().zip(vectors.iter().copied()).collect();
    let decided = (0..MEET + 40).find(|moment| held.add(&meeting(*moment, heights_m)))?;
    for moment in decided + 1..decided + 5 {
        held.add(&meeting(moment, heights_m));
    }
    Some((decided - MEET, held))
}

/// The names follow the heights, but for a second around the meeting.
fn assert_names_follow(held: &Held, heights_m: &[f64]) {
    for moment in (0..held.moments).filter(|moment| moment.abs_diff(MEET) > 4) {
        for (name, height_m) in held.shown(moment) {
            assert!(
                (height_m - heights_m[name as usize]).abs() < 1e-9,
                "moment {moment}: {name} has {height_m} m"
            );
        }
    }
}

#[test]
fn people_who_stood_together_get_their_names_back_when_their_sizes_are_clear() {
    let heights_m = [1.78, 1.68];
    let (after, held) = decision(&heights_m).unwrap();
    assert!((4..36).contains(&after), "{after} moments");
    assert_names_follow(&held, &heights_m);
}

#[test]
fn three_names_that_went_round_in_a_circle_are_given_back() {
    let heights_m = [1.80, 1.70, 1.60];
    let (_, held) = decision(&heights_m).unwrap();
    assert_names_follow(&held, &heights_m);
}

#[test]
fn people_of_equal_sizes_keep_their_names() {
    assert!(decision(&[1.7, 1.7]).is_none());
}

#[test]
fn people_of_equal_sizes_get_their_names_back_by_their_appearance() {
    // A millimetre tells nobody apart.
    let heights_m = [1.700, 1.701, 1.702];
    let common = [1.0, 0.0, 0.0, 0.0];
    let different = [[1.0, 0.6, 0.0, 0.0], [1.0, 0.0, 0.6, 0.0], [1.0, 0.0, 0.0, 0.6]];
    let (_, held) = decision_by_vectors(&heights_m, &different).unwrap();
    assert_names_follow(&held, &heights_m);
    assert!(decision_by_vectors(&heights_m, &[common; 3]).is_none(), "all look the same");
}

#[test]
fn clear_sizes_are_decided_no_later() {
    let [clear, less] = [[1.82, 1.60], [1.74, 1.68]].map(|heights_m| decision(&heights_m).map(|of| of.0));
    assert!(
        clear.is_some_and(|clear| less.is_none_or(|less| clear <= less)),
        "{clear:?} and {less:?} moments"
    );
}

/// Somebody whose track ended in the middle of the room, and one who appears there after a gap, among others who stand elsewhere:
/// the second one's name in the end.
fn found_again(heights_m: [f64; 2], others_m: &[f64], gap: usize, returns_nats: f64) -> u32 {
    let mut held = Held::new(returns_nats);
    let other =
        |(i, height_m): (usize, &f64)| (9 + i as Key, Vector2::new(20.0 + 4.0 * i as f64, 8.0), *height_m);
    let others: Vec<Followed> = others_m.iter().enumerate().map(other).collect();
    for moment in 0..50 + gap {
        let place = Vector2::new(1.0 + 0.1 * moment as f64, 2.0);
        let person = match moment {
            0..30 => Some((1, place, heights_m[0])),
            _ if moment < 30 + gap => None,
            _ => Some((2, place, heights_m[1])),
        };
        held.add(&others.iter().copied().chain(person).collect::<Vec<_>>());
    }
    held.names[&2].0
}

#[test]
fn a_new_track_with_the_size_of_a_lost_person_gets_the_old_name() {
    let others_m = [1.7];
    assert_eq!(found_again([1.8, 1.8], &others_m, 4, 0.0), 1);
    assert_eq!(found_again([1.8, 1.65], &others_m, 4, 0.0), 2, "another person");
    assert_eq!(found_again([1.8, 1.8], &others_m, 4, -20.0), 2, "too far away");
    assert_eq!(found_again([1.8, 1.8], &others_m, 90, 0.0), 2, "longer ago than encounters are remembered");
}

#[test]
fn an_equal_size_is_weaker_evidence_where_boxes_make_everybody_equally_tall() {
    let different_m = [1.58, 1.63, 1.69, 1.74, 1.79, 1.86, 1.9, 1.66];
    assert_eq!(found_again([1.8, 1.8], &different_m, 4, -0.5), 1);
    assert_eq!(found_again([1.8, 1.8], &[1.8; 8], 4, -0.5), 2);
}

#[test]
fn the_population_is_that_of_the_tracks_in_the_held_moments() {
    let prior = McmcOptions::of_boxes();
    let heights_m = [1.46, 1.52, 1.58, 1.60, 1.64, 1.70, 1.76];
    let mut held = Held::new(0.0);
    for _ in 0..30 {
        let people = heights_m.iter().enumerate();
        held.add(
            &people.map(|(i, of_m)| (i as Key, Vector2::new(4.0 * i as f64, 8.0), *of_m)).collect::<Vec<_>>(),
        );
    }
    let found = held.encounters.population;
    // 1.609 ± 0.095 m between the seven; the prior, 1.72 ± 0.10 m, counts as one more.
    assert!((found.height.mean_m - 1.623).abs() < 0.003, "{found:?}");
    assert!((found.height.sigma_m - 0.096).abs() < 0.003, "{found:?}");
    assert_eq!(found.radius, prior.radius, "no widths were shown");
}

/// Six people of random heights who cross a small floor; tracks exchange their people at random, end, and begin.
#[test]
fn nobody_ever_has_the_name_of_another() {
    for seed in 0..4 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let heights_m: Vec<f64> = (0..6).map(|_| rng.random_range(1.55..1.9)).collect();
        let mut keys: Vec<Key> = (0..6).collect();
        let mut held = Held::new(0.0);
        let mut renamed = 0;
        for moment in 0..120 {
            if moment % 7 == 3 {
                let (a, b) = (rng.random_range(0..6), rng.random_range(0..6));
                keys.swap(a, b);
            }
            if moment % 31 == 30 {
                let lost = rng.random_range(0..6);
                keys[lost] = 6 + moment as Key;
            }
            let place = |person: usize| {
                let angle = moment as f64 * (0.1 + 0.03 * person as f64);
                Vector2::new(2.0 + 0.5 * angle.sin(), 2.0 + 0.5 * (1.3 * angle).cos())
            };
            let tracks: Vec<Followed> = (0..6).map(|i| (keys[i], place(i), heights_m[i])).collect();
            renamed += usize::from(held.add(&tracks));
            for held_moment in &held.smoother.moments {
                let names: BTreeSet<u32> =
                    held_moment.people.iter().map(|trace| trace.id.unwrap().0).collect();
                assert_eq!(names.len(), 6, "seed {seed}, moment {moment}: {names:?}");
            }
        }
        assert!(renamed > 3, "{renamed}");
    }
}

/// All sets of exchanges, one after the other.
#[test]
fn annealing_mostly_finds_the_most_probable_of_all_sets_of_exchanges() {
    let (mut best_found, mut changed) = (0, 0);
    for seed in 0..12 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let heights_m: Vec<f64> = (0..5).map(|_| rng.random_range(1.64..1.76)).collect();
        let mut held = Held::new(0.0);
        // Nobody meets: the encounters are made up.
        let mut keys: Vec<Key> = (0..5).collect();
        for moment in 0..36 {
            if moment % 9 == 8 {
                keys.rotate_left(rng.random_range(0..3));
            }
            let tracks: Vec<Followed> =
                (0..5).map(|i| (keys[i], Vector2::new(i as f64 * 4.0, 0.0), heights_m[i])).collect();
            held.add(&tracks);
        }
        for _ in 0..11 {
            let a: Key = rng.random_range(0..5);
            let keys = [a, (a + rng.random_range(1..5)) % 5];
            let (time_s, place_nats) = (rng.random_range(1.0..8.0), rng.random_range(-6.0..3.0));
            held.encounters.insert(Encounter { time_s, keys, place_nats, is_exchange: false });
        }
        held.encounters.settled_s = f64::NEG_INFINITY;
        held.encounters.settled.clear();
        let window = Window::new(&held.smoother.moments, &held.encounters);
        let list = &held.encounters.list;
        let mut sums = Sums::default();
        let mut nats = |exchanges: &[bool]| {
            let places: f64 = list
                .iter()
                .zip(exchanges)
                .filter(|(_, is_exchange)| **is_exchange)
                .map(|(encounter, _)| encounter.place_nats - EXCHANGE_NATS)
                .sum();
            places + window.log_density(exchanges, &mut sums)
        };
        let sets = (0..1_usize << list.len()).map(|set| (0..list.len()).map(|i| set >> i & 1 == 1).collect());
        let best = sets.map(|set: Vec<bool>| nats(&set)).fold(f64::NEG_INFINITY, f64::max);
        let found = annealing::most_probable(&window, list, &mut rng);
        assert!(nats(&found) > best - 3.0, "seed {seed}: {} of {best} nats", nats(&found));
        best_found += usize::from(nats(&found) > best - 1e-6);
        changed += usize::from(found.contains(&true));
    }
    assert!(best_found >= 9 && changed > 6, "{best_found} and {changed} of 12");
}
