use nalgebra::{Matrix2, Vector2};

use super::super::motion::{Measurement, Motion};
use super::super::options::Spread;
use super::super::smoother::FixedLagSmoother;
use super::super::traits::ShownTraits;
use super::*;

const STEP_S: f64 = 0.25;
/// Standard deviation of the heights that one moment shows, metres, and that of its places.
const HEIGHT_SIGMA_M: f64 = 0.04;
const PLACE_SIGMA_M: f64 = 0.05;
/// Moment at which two people meet.
const MEET: usize = 24;

/// A track at one moment: key, name, place and the height of the person whom it follows, metres.
type Followed = (Key, u32, Vector2<f64>, f64);

/// Held moments with what was learnt of each name, as the tracker has them.
#[derive(Default)]
struct Held {
    smoother: FixedLagSmoother,
    motions: BTreeMap<Key, Motion>,
    learnt: BTreeMap<TrackId, LearntTraits>,
    encounters: Encounters,
    moments: usize,
}

impl Held {
    /// Adds a moment with these tracks.
    fn add(&mut self, tracks: &[Followed]) {
        let options = McmcOptions::of_boxes();
        let covariance = Matrix2::identity() * PLACE_SIGMA_M.powi(2);
        let trace = |(key, name, place, height_m): &Followed| {
            let measured = Measurement { place: *place, covariance };
            let motion = match self.motions.get(key) {
                Some(before) => before.continued(STEP_S, true, Some(&measured), &options.motion),
                None => Motion::appeared(*place, &covariance, &options.motion),
            };
            let height = Some(Spread { mean_m: *height_m, sigma_m: HEIGHT_SIGMA_M });
            Trace {
                key: *key,
                id: Some(TrackId(*name)),
                motion,
                radius_m: 0.25,
                height_m: 1.7,
                confidence: 1.0,
                visible: vec![1.0],
                shown: ShownTraits { height, ..ShownTraits::default() },
                learnt: LearntTraits::default(),
            }
        };
        let traces: Vec<Trace> = tracks.iter().map(trace).collect();
        for trace in &traces {
            self.motions.insert(trace.key, trace.motion.clone());
            self.learnt.entry(TrackId(name_of(trace))).or_default().add(&trace.shown);
        }
        let tracked = traces.iter().map(|trace| TrackId(name_of(trace)));
        let tracked = tracked.map(|id| (id, self.learnt[&id].clone())).collect();
        self.smoother.push((self.moments as u32, self.now_s()), REMEMBERED_S, traces, true);
        self.encounters.remember(&self.smoother.moments, tracked, &options);
        self.moments += 1;
    }

    fn now_s(&self) -> f64 {
        self.moments as f64 * STEP_S
    }

    /// The clearest exchange, where a lost person comes back with these log odds by place and time.
    fn clearest(&self, returns_nats: f64) -> Option<Renaming> {
        let room = |_: &Lost, _: &Vector2<f64>, _: f64| returns_nats;
        self.encounters.clearest(&self.smoother.moments, &room, &McmcOptions::of_boxes())
    }
}

fn name_of(trace: &Trace) -> u32 {
    trace.id.unwrap().0
}

/// Two people who walk towards each other, stand together for a second, and walk back; from then on the tracks have each
/// other's person.
fn meeting(moment: usize, heights_m: [f64; 2]) -> [Followed; 2] {
    let away_m = ((moment as f64 - MEET as f64).abs() - 2.0).max(0.0) * 0.1;
    let places = [Vector2::new(3.0 - away_m, 2.05), Vector2::new(3.0 + away_m, 1.95)];
    let person = |track: usize| if moment < MEET { track } else { 1 - track };
    [0, 1].map(|i| (i as Key, i as u32 + 1, places[person(i)], heights_m[person(i)]))
}

/// First moment after the meeting at which it is decided, with the exchange.
fn decision(heights_m: [f64; 2]) -> Option<(usize, Renaming, Held)> {
    let mut held = Held::default();
    for moment in 0..MEET + 60 {
        held.add(&meeting(moment, heights_m));
        if let Some(renaming) = held.clearest(0.0) {
            return Some((moment - MEET, renaming, held));
        }
    }
    None
}

#[test]
fn people_who_stood_together_get_their_ids_back_when_their_sizes_are_clear() {
    let (after, renaming, mut held) = decision([1.74, 1.68]).unwrap();
    assert!((4..40).contains(&after), "{after} moments");
    assert!((renaming.time_s - MEET as f64 * STEP_S).abs() < 1.0, "{}", renaming.time_s);
    // The names follow the heights again, before and after.
    held.smoother.exchange_names_since(renaming.ids, renaming.time_s);
    held.encounters.exchange(&renaming);
    for moment in &held.smoother.moments {
        for trace in moment.people.iter().filter(|_| (moment.time_s - renaming.time_s).abs() > 1.0) {
            let height_m = trace.shown.height.unwrap().mean_m;
            assert_eq!(name_of(trace), if height_m > 1.71 { 1 } else { 2 }, "{} s", moment.time_s);
        }
    }
    // The tracker exchanges the learnt sizes with the names.
    for (id, size) in renaming.ids.iter().zip(renaming.sizes) {
        held.encounters.tracked.get_mut(id).unwrap().size = size;
    }
    assert!(held.clearest(0.0).is_none(), "only one of both can be right");
}

#[test]
fn clear_sizes_are_decided_sooner_and_equal_ones_never() {
    let [clear, less] = [[1.80, 1.62], [1.72, 1.70]].map(decision).map(|of| of.map(|(after, ..)| after));
    assert!(
        clear.is_some_and(|clear| less.is_none_or(|less| clear < less)),
        "{clear:?} and {less:?} moments"
    );
    assert!(decision([1.7, 1.7]).is_none());
}

/// The exchange by which somebody whose track ended in the middle of the room is the one who appears there, if any.
fn found_again(heights_m: [f64; 2], gap: usize, returns_nats: f64) -> Option<Renaming> {
    let mut held = Held::default();
    let other = (9, 9, Vector2::new(8.0, 8.0), 1.7);
    for moment in 0..50 + gap {
        let place = Vector2::new(1.0 + 0.1 * moment as f64, 2.0);
        let person = match moment {
            0..30 => Some((1, 1, place, heights_m[0])),
            _ if moment < 30 + gap => None,
            _ => Some((2, 2, place, heights_m[1])),
        };
        held.add(&[Some(other), person].into_iter().flatten().collect::<Vec<_>>());
    }
    held.clearest(returns_nats)
}

#[test]
fn a_new_track_with_the_size_of_a_lost_person_gets_the_old_id() {
    let renaming = found_again([1.8, 1.8], 4, 0.0).unwrap();
    assert_eq!((renaming.ids, renaming.kind), ([TrackId(1), TrackId(2)], Kind::Found));
    assert!((renaming.time_s - 29.0 * STEP_S).abs() < 1e-9);
    assert!(found_again([1.8, 1.65], 4, 0.0).is_none(), "another person");
    assert!(found_again([1.8, 1.8], 4, -20.0).is_none(), "too far away");
    // Longer ago than encounters are remembered.
    assert!(found_again([1.8, 1.8], 90, 0.0).is_none());
}

#[test]
fn exchanged_names_are_those_of_later_encounters_too() {
    let [a, b, c] = [1, 2, 3].map(TrackId);
    let met = |time_s: f64, ids: [TrackId; 2]| Encounter { time_s, ids, place_nats: 0.0 };
    let mut encounters = Encounters {
        met: vec![met(1.0, [a, c]), met(2.0, [a, b]), met(3.0, [a, c]), met(3.0, [b, c])],
        ..Encounters::default()
    };
    encounters.exchange(&Renaming { time_s: 2.0, ids: [a, b], sizes: <[_; 2]>::default(), kind: Kind::Met });
    let ids: Vec<[TrackId; 2]> = encounters.met.iter().map(|met| met.ids).collect();
    assert_eq!(ids, [[a, c], [b, c], [a, c]]);
}

/// Exchanges, one after the other, after a tall person was lost at the twentieth moment and the track of a smaller one, two metres
/// away, took them seven moments later; the smaller one is followed anew two moments after that. The lost person comes back with
/// these log odds by place and time.
fn gone_over(heights_m: [f64; 2], returns_nats: f64) -> Vec<Renaming> {
    let mut held = Held::default();
    for moment in 0..60 {
        let along_m = 1.0 + 0.05 * moment as f64;
        let [tall, small] = [2.0, 3.0].map(|y_m| Vector2::new(along_m, y_m));
        let mut tracks: Vec<Followed> = Vec::new();
        if moment < 20 {
            tracks.push((1, 1, tall, heights_m[0]));
        }
        if moment < 27 {
            tracks.push((2, 2, small, heights_m[1]));
        } else {
            tracks.push((2, 2, tall, heights_m[0]));
        }
        if moment >= 29 {
            tracks.push((3, 3, small, heights_m[1]));
        }
        held.add(&tracks);
    }
    let mut renamings = Vec::new();
    while let Some(renaming) = held.clearest(returns_nats).filter(|_| renamings.len() < 5) {
        held.smoother.exchange_names_since(renaming.ids, renaming.time_s);
        held.encounters.exchange(&renaming);
        for (id, size) in renaming.ids.iter().zip(renaming.sizes) {
            if let Some(traits) = held.encounters.tracked.get_mut(id) {
                traits.size = size;
            }
        }
        // Names that nobody has any more are not tracked.
        let last = held.smoother.moments.back().unwrap();
        let learnt = |trace: &Trace| {
            let size = renaming.ids.iter().position(|id| Some(*id) == trace.id).map(|i| renaming.sizes[i]);
            let mut traits = held.encounters.tracked.get(&trace.id.unwrap()).cloned().unwrap_or_default();
            traits.size = size.unwrap_or(traits.size);
            (trace.id.unwrap(), traits)
        };
        held.encounters.tracked = last.people.iter().map(learnt).collect();
        renamings.push(renaming);
    }
    renamings
}

#[test]
fn a_track_that_goes_over_to_a_lost_person_leaves_its_own_behind() {
    let [tall, small, new] = [1, 2, 3].map(TrackId);
    let renamings = gone_over([1.85, 1.62], 0.0);
    let ids: Vec<[TrackId; 2]> = renamings.iter().map(|renaming| renaming.ids).collect();
    assert_eq!(ids, [[tall, small], [small, new]]);
    let left = Vector2::new(1.0 + 0.05 * 26.0, 3.0);
    let (time_s, Kind::GoneOver(place)) = (renamings[0].time_s, renamings[0].kind) else {
        panic!("{:?}", renamings[0].kind)
    };
    assert!((time_s - 26.0 * STEP_S).abs() < 1e-9 && (place - left).norm() < 0.1, "{time_s} {place}");
    assert_eq!(renamings[1].kind, Kind::Found);
    // Nobody goes over to somebody who cannot have been there.
    assert!(gone_over([1.85, 1.62], -1000.0).is_empty());
}
