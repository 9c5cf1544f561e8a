//! Tests on walkers in rendered rooms, whose places are known.

use std::collections::BTreeMap;

use synthetic::{PersonTruth, RoomOptions, Sequence, SequenceOptions, WalkerOptions};

use super::*;
use crate::TrackId;
use crate::prepared_room::PreparationOptions;

const RATE_HZ: f64 = 12.0;

#[test]
fn walkers_of_a_rendered_room_are_followed_through_furniture_and_each_other() {
    let options = RoomOptions { seed: 5, image_px: [200, 150], ..RoomOptions::default() };
    let made = options.build().unwrap();
    let folder = tempfile::tempdir().unwrap();
    made.room.write(folder.path()).unwrap();
    let room = scenes::room::Room::read(folder.path()).unwrap();
    let stage = PreparedRoom::prepare(&room, folder.path(), &PreparationOptions::default()).unwrap();
    let walkers = made.walkers(&WalkerOptions { seed: 3, people: 3, ..WalkerOptions::default() });
    let sequence = made.sequence(
        walkers,
        SequenceOptions { frames: 240, images: false, rate_hz: RATE_HZ, ..SequenceOptions::default() },
    );
    // Errors of the people found both at once and after smoothing, so that both means are over the same people and
    // moments.
    let (mut at_once_m, mut later_m) = (0.0, 0.0);
    for seed in 1..=2 {
        let [at_once, later] = follow(
            Mcmc::new(stage.clone(), McmcOptions { seed, ..McmcOptions::default() }).unwrap(),
            &sequence,
        );
        for score in [&at_once, &later] {
            let (found, mean_m) = (score.errors_m.len(), score.mean_m());
            let recall = found as f64 / f64::from(score.truths);
            println!(
                "{found} of {}, {} m, {} strangers, {:?}",
                score.truths, mean_m, score.strangers, score.names
            );
            assert!(score.truths > 300, "the test needs people");
            assert!(recall > 0.9 && mean_m < 0.08, "recall {recall}, mean {mean_m} m");
            assert!(score.strangers * 20 < score.truths, "{} of {}", score.strangers, score.truths);
            for (person, names) in &score.names {
                let (most, all) = (names.values().max().copied().unwrap_or(0), names.values().sum::<u32>());
                assert!(most * 20 >= all * 19, "person {person} went by {names:?}");
            }
        }
        assert!(later.errors_m.len() >= at_once.errors_m.len());
        for (at, error_m) in &at_once.errors_m {
            if let Some(later) = later.errors_m.get(at) {
                at_once_m += error_m;
                later_m += later;
            }
        }
    }
    // The improvement depends on the masks' errors, and these masks have none: on the office's film
    // (tests/end_to_end) it is larger.
    assert!(later_m < at_once_m, "{later_m} after {at_once_m}");
}

/// Scores of the estimates reported at once, and of the smoothed ones.
fn follow(mut mcmc: Mcmc, sequence: &Sequence) -> [Score; 2] {
    let waits = (mcmc.lag_s() * RATE_HZ).ceil() as u32;
    let (mut truths, mut at_once, mut later) = (Vec::new(), Vec::new(), Vec::new());
    for frame in sequence.frames() {
        let cameras: Vec<CameraFrame> =
            frame.cameras.into_iter().map(|c| CameraFrame::of_mask(&c.mask)).collect();
        let moment = Moment { frame: frame.frame, time_s: frame.time_s, cameras: &cameras };
        at_once.push(mcmc.step(&moment).unwrap());
        if frame.frame > waits {
            later.push(mcmc.smoothed(frame.frame - waits).unwrap());
        }
        truths.push(frame.people);
    }
    later.extend((truths.len() as u32 - waits + 1..=truths.len() as u32).map(|f| mcmc.smoothed(f).unwrap()));
    [scored(&truths, at_once), scored(&truths, later)]
}

#[derive(Debug)]
struct Score {
    truths: u32,
    strangers: u32,
    /// Distance of each found person from the truth by moment and person, metres.
    errors_m: BTreeMap<(usize, u32), f64>,
    /// Number of moments of each id, by person.
    names: BTreeMap<u32, BTreeMap<TrackId, u32>>,
}

impl Score {
    fn mean_m(&self) -> f64 {
        self.errors_m.values().sum::<f64>() / self.errors_m.len() as f64
    }
}

fn scored(truths: &[Vec<PersonTruth>], people: Vec<Vec<PersonEstimate>>) -> Score {
    assert_eq!(truths.len(), people.len());
    let mut score = Score { truths: 0, strangers: 0, errors_m: BTreeMap::new(), names: BTreeMap::new() };
    for (moment, (truths, mut people)) in truths.iter().zip(people).enumerate() {
        for truth in truths.iter().filter(|p| p.inside) {
            score.truths += 1;
            let distance = |p: &PersonEstimate| (p.x_m - truth.place.x).hypot(p.y_m - truth.place.y);
            let nearest =
                (0..people.len()).min_by(|a, b| distance(&people[*a]).total_cmp(&distance(&people[*b])));
            if let Some(i) = nearest.filter(|i| distance(&people[*i]) < 0.5) {
                score.errors_m.insert((moment, truth.id), distance(&people[i]));
                let person = people.swap_remove(i);
                *score.names.entry(truth.id).or_default().entry(person.id).or_default() += 1;
            }
        }
        score.strangers += people.len() as u32;
    }
    score
}
