//! Reassociation of tracks that met: whether two people exchanged their tracks, decided by the moments that followed.
//!
//! The sampler associates each moment's boxes by the predictions of that moment. Two people who pass each other within
//! the boxes' noise can exchange their tracks there, and only the following moments show it: one of the two would have
//! turned, grown, or changed clothes. For each pair of tracks that were close within the last [`WINDOW_S`] seconds, this module
//! compares the two assignments of the measurements since some moment s to the tracks before s:
//!
//! ```text
//! log p(own) − log p(exchanged) = Σ over both tracks, moments after s:  log N(measured place; predicted by the head's filter)
//!                                 + log p(traits since s | traits until s)
//! ```
//!
//! with the traits of [`exchange_nats`]: height and width, among those of the [population](super::population), and the appearance vectors of a
//! detector that gives them.
//!
//! It is the switch move of S. Oh, S. Russell, S. Sastry, "Markov chain Monte Carlo data association for multi-target
//! tracking", IEEE TAC 54(3), 2009, over a sliding window, accepted where it is clearly more probable. The filters of an
//! exchanged pair are run again from s, so that held moments are smoothed as if the tracks had never been exchanged.

use std::collections::VecDeque;

use super::LEAST_STEP_S;
use super::motion::Motion;
use super::options::{McmcOptions, MotionOptions};
use super::person::Key;
use super::posture::Size;
use super::smoother::{LaggedMoment, WINDOW_S};
use super::trace::Trace;
use super::traits::{LearntTraits, exchange_nats};

/// Largest distance of two people who may exchange their tracks, metres.
const MET_M: f64 = 0.8;
/// Largest number of moments at which an exchange of one pair is considered.
const MOST_PLACES: usize = 8;
/// Least log probability ratio of an exchange that is carried out, nats.
const CLEARLY_NATS: f64 = 2.0;
/// Factor of the evidence of places: errors of successive moments are correlated.
const PLACES_WEIGHT: f64 = 0.4;

/// Two tracks that exchanged their people.
#[derive(Debug, Clone)]
pub(super) struct Exchange {
    pub(super) keys: [Key; 2],
    /// Present motions of the two, with each other's measurements since the exchange.
    pub(super) motions: [Motion; 2],
    /// Learnt traits of the two, likewise.
    pub(super) learnt: [LearntTraits; 2],
}

/// Successive moments in which both tracks of a pair are present, with their times in seconds.
struct Pair<'a> {
    moments: Vec<(f64, [&'a Trace; 2])>,
    options: &'a MotionOptions,
}

impl<'a> Pair<'a> {
    /// The pair with these keys in the latest moments, back to `first_s`, in which both are present.
    fn latest(
        moments: &'a VecDeque<LaggedMoment>,
        keys: [Key; 2],
        first_s: f64,
        options: &'a MotionOptions,
    ) -> Self {
        let recent = moments.iter().rev().take_while(|moment| moment.time_s >= first_s);
        let both = recent.map_while(|moment| {
            let of = |key: Key| moment.people.iter().find(|trace| trace.key == key);
            Some((moment.time_s, [of(keys[0])?, of(keys[1])?]))
        });
        let mut moments: Vec<_> = both.collect();
        moments.reverse();
        Self { moments, options }
    }

    /// The pair with these keys from the moment `first` on, for [`WINDOW_S`] seconds or while both are present.
    fn following(
        moments: &'a VecDeque<LaggedMoment>,
        first: usize,
        keys: [Key; 2],
        options: &'a MotionOptions,
    ) -> Self {
        let from_s = moments.get(first).map_or(0.0, |moment| moment.time_s);
        let near =
            moments.range(first.min(moments.len())..).take_while(|moment| moment.time_s <= from_s + WINDOW_S);
        let both = near.map_while(|moment| {
            let of = |key: Key| moment.people.iter().find(|trace| trace.key == key);
            Some((moment.time_s, [of(keys[0])?, of(keys[1])?]))
        });
        Self { moments: both.collect(), options }
    }

    /// Continues both tracks after the moment `from` with the other one's measurements, and passes the motions of each
    /// moment to `each`. Returns the sum of the log densities of the measurements.
    fn exchanged(&self, from: usize, mut each: impl FnMut(&[Motion; 2])) -> f64 {
        let (mut time_s, heads) = self.moments[from];
        let mut motions = heads.map(|head| head.motion.clone());
        let mut sum = 0.0;
        for (later_s, [a, b]) in &self.moments[from + 1..] {
            let dt_s = (later_s - time_s).max(LEAST_STEP_S);
            time_s = *later_s;
            for (motion, tail) in motions.iter_mut().zip([b, a]) {
                let (in_sight, seen) = (motion.measured.is_some(), tail.motion.measured.as_ref());
                *motion = motion.continued(dt_s, in_sight, seen, self.options);
                sum += motion.log_evidence;
            }
            each(&motions);
        }
        sum
    }

    /// Log probability ratio of an exchange after the moment `from`, nats.
    fn gain(&self, from: usize, population: &Size) -> f64 {
        let mut own = 0.0;
        let mut since = <[LearntTraits; 2]>::default();
        for (_, pair) in &self.moments[from + 1..] {
            for (since, trace) in since.iter_mut().zip(pair) {
                own += trace.motion.log_evidence;
                since.add(&trace.shown);
            }
        }
        let before = self.moments[from].1.map(|head| &head.learnt);
        let by_traits = exchange_nats(before, since.each_ref(), population);
        PLACES_WEIGHT * (self.exchanged(from, |_| ()) - own) + by_traits
    }

    /// Best moment for an exchange, with its gain.
    fn best(&self, population: &Size) -> Option<(usize, f64)> {
        let now = self.moments.last()?.1;
        // Names that were exchanged since then were exchanged for what was seen since then.
        let has_its_name =
            |(then, now): (&Trace, &Trace)| then.id.is_none_or(|id| now.id.is_none_or(|now| now == id));
        let is_close = |i: &usize| {
            let [a, b] = self.moments[*i].1;
            (a.motion.place() - b.motion.place()).norm() < MET_M
                && has_its_name((a, now[0]))
                && has_its_name((b, now[1]))
        };
        let close: Vec<usize> = (0..self.moments.len().saturating_sub(1)).filter(is_close).collect();
        let every = close.len().div_ceil(MOST_PLACES).max(1);
        let gains = close.into_iter().rev().step_by(every).map(|from| (from, self.gain(from, population)));
        gains.max_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Log probability ratio by the places alone, nats, that two tracks exchanged their people after the moment `from`; only of
/// people who were close then.
pub(super) fn place_nats(
    moments: &VecDeque<LaggedMoment>,
    from: usize,
    keys: [Key; 2],
    options: &McmcOptions,
) -> Option<f64> {
    let pair = Pair::following(moments, from, keys, &options.motion);
    let [a, b] = pair.moments.first()?.1;
    if (a.motion.place() - b.motion.place()).norm() >= MET_M {
        return None;
    }
    let own: f64 = pair.moments[1..].iter().flat_map(|(_, both)| both).map(|t| t.motion.log_evidence).sum();
    Some(PLACES_WEIGHT * (pair.exchanged(0, |_| ()) - own))
}

/// Exchanges back the tracks of the people who exchanged them; the last moment is the present one.
pub(super) fn reassociate(
    moments: &mut VecDeque<LaggedMoment>,
    options: &McmcOptions,
    population: &Size,
) -> Vec<Exchange> {
    let mut exchanges: Vec<Exchange> = Vec::new();
    let Some(now) = moments.back() else { return exchanges };
    let first_s = now.time_s - WINDOW_S;
    let keys: Vec<Key> = now.people.iter().map(|trace| trace.key).collect();
    let mut candidates: Vec<(f64, [Key; 2], usize)> = Vec::new();
    for (i, a) in keys.iter().enumerate() {
        for b in &keys[..i] {
            let pair = Pair::latest(moments, [*b, *a], first_s, &options.motion);
            if let Some((from, gain)) = pair.best(population).filter(|(_, gain)| *gain > CLEARLY_NATS) {
                candidates.push((gain, [*b, *a], pair.moments.len() - from));
            }
        }
    }
    candidates.sort_by(|one, other| other.0.total_cmp(&one.0));
    for (_, keys, back) in candidates {
        if exchanges.iter().all(|done| !done.keys.iter().any(|key| keys.contains(key))) {
            exchanges.extend(exchange(moments, keys, back, options));
        }
    }
    exchanges
}

/// Exchanges two tracks in the last `back` − 1 moments.
fn exchange(
    moments: &mut VecDeque<LaggedMoment>,
    keys: [Key; 2],
    back: usize,
    options: &McmcOptions,
) -> Option<Exchange> {
    let mut motions: Vec<[Motion; 2]> = Vec::new();
    let pair = Pair::latest(moments, keys, f64::NEG_INFINITY, &options.motion);
    let from = pair.moments.len().checked_sub(back)?;
    pair.exchanged(from, |both| motions.push(both.clone()));
    let mut learnt = pair.moments[from].1.map(|head| head.learnt.clone());
    let first = moments.len() + 1 - back;
    for (moment, both) in moments.iter_mut().skip(first).zip(&motions) {
        let of = |key: Key| moment.people.iter().position(|trace| trace.key == key);
        let (a, b) = (of(keys[0])?, of(keys[1])?);
        let names = [a, b].map(|i| (moment.people[i].key, moment.people[i].id));
        for (name, at) in [b, a].into_iter().enumerate() {
            let trace = &mut moment.people[at];
            (trace.key, trace.id) = names[name];
            trace.motion = both[name].clone();
            learnt[name].add(&trace.shown);
            trace.learnt = learnt[name].clone();
        }
    }
    Some(Exchange { keys, motions: motions.pop()?, learnt })
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::super::motion::Measurement;
    use super::super::options::Spread;
    use super::super::smoother::FixedLagSmoother;
    use super::super::traits::ShownTraits;
    use super::*;
    use crate::TrackId;

    const STEP_S: f64 = 0.25;
    /// First moment in which the two tracks have each other's person, and number of moments.
    const EXCHANGED: usize = 10;
    const MOMENTS: usize = 18;
    /// Lag, seconds: all moments are held.
    const LAG_S: f64 = 10.0;

    /// A person at a moment: place and height, metres, and appearance vector.
    type Person = (Vector2<f64>, f64, [f32; 2]);
    /// Appearance vectors of two people who look alike, and of two who do not.
    const ALIKE: [[f32; 2]; 2] = [[1.0, 0.2], [1.0, 0.1]];
    const DIFFERENT: [[f32; 2]; 2] = [[1.0, 0.2], [0.3, 1.0]];

    /// Two people who pass each other at 1 m/s each, or who meet and turn back.
    fn people(moment: usize, is_turning: bool, heights_m: [f64; 2], vectors: [[f32; 2]; 2]) -> [Person; 2] {
        let ahead_m = STEP_S * (moment as f64 - EXCHANGED as f64 + 0.5);
        let x_m = if is_turning { -ahead_m.abs() } else { ahead_m };
        let places = [Vector2::new(3.0 + x_m, 2.05), Vector2::new(3.0 - x_m, 1.95)];
        [0, 1].map(|i| (places[i], heights_m[i], vectors[i]))
    }

    /// Held moments of two tracks that follow these people up to [`EXCHANGED`], and each other's from then on.
    fn exchanged_tracks(is_turning: bool, heights_m: [f64; 2], vectors: [[f32; 2]; 2]) -> FixedLagSmoother {
        let options = McmcOptions::of_boxes();
        let mut smoother = FixedLagSmoother::default();
        let covariance = Matrix2::identity() * 0.05_f64.powi(2);
        let mut tracks: Option<[(Motion, LearntTraits); 2]> = None;
        for moment in 0..MOMENTS {
            let mut seen = people(moment, is_turning, heights_m, vectors);
            if moment >= EXCHANGED {
                seen.swap(0, 1);
            }
            let before = tracks.take();
            let now = [0, 1].map(|i| {
                let (place, height_m, vector) = seen[i];
                let measured = Measurement { place, covariance };
                let (motion, mut learnt) = match &before {
                    None => {
                        let motion = Motion::appeared(place, &covariance, &options.motion);
                        (motion, LearntTraits::default())
                    }
                    Some(tracks) => {
                        let (motion, learnt) = &tracks[i];
                        (motion.continued(STEP_S, true, Some(&measured), &options.motion), learnt.clone())
                    }
                };
                let height = Some(Spread { mean_m: height_m, sigma_m: 0.04 });
                let mut shown = ShownTraits { height, ..ShownTraits::default() };
                // As three cameras see the person.
                (0..3).for_each(|_| shown.vector.add_box(&vector));
                learnt.add(&shown);
                (motion, learnt, shown)
            });
            let traces = now.iter().enumerate().map(|(i, (motion, learnt, shown))| Trace {
                key: i as Key,
                id: Some(TrackId(i as u32 + 1)),
                motion: motion.clone(),
                radius_m: 0.25,
                height_m: 1.7,
                confidence: 1.0,
                visible: vec![1.0],
                shown: shown.clone(),
                learnt: learnt.clone(),
            });
            smoother.push((moment as u32, moment as f64 * STEP_S), LAG_S, traces.collect(), true);
            tracks = Some(now.map(|(motion, learnt, _)| (motion, learnt)));
        }
        smoother
    }

    /// Largest distance of a told person from the person with this id, metres, over all moments.
    fn largest_error_m(smoother: &mut FixedLagSmoother, is_turning: bool) -> f64 {
        let of_moment = |moment: usize| {
            let truth = people(moment, is_turning, [0.0; 2], ALIKE);
            let told = smoother.take(moment as u32).unwrap();
            assert_eq!(told.len(), 2);
            told.iter()
                .map(|p| (Vector2::new(p.x_m, p.y_m) - truth[p.id.0 as usize - 1].0).norm())
                .fold(0.0, f64::max)
        };
        (0..MOMENTS).map(of_moment).fold(0.0, f64::max)
    }

    #[test]
    fn people_who_pass_each_other_get_their_tracks_back_in_all_held_moments() {
        let options = McmcOptions::of_boxes();
        let mut smoother = exchanged_tracks(false, [1.7; 2], ALIKE);
        assert!(largest_error_m(&mut smoother.clone(), false) > 1.0);
        let exchanges = reassociate(&mut smoother.moments, &options, &Size::prior(&options));
        assert_eq!(exchanges.len(), 1);
        assert!(largest_error_m(&mut smoother, false) < 0.2);
        assert!(
            reassociate(&mut smoother.moments, &options, &Size::prior(&options)).is_empty(),
            "only one of both can be right"
        );
    }

    #[test]
    fn people_of_different_height_who_turn_back_are_told_apart_by_it() {
        let options = McmcOptions::of_boxes();
        // By the places alone they passed each other, which is how the exchanged tracks continue.
        let mut alike = exchanged_tracks(true, [1.7; 2], ALIKE);
        assert!(reassociate(&mut alike.moments, &options, &Size::prior(&options)).is_empty());
        let mut different = exchanged_tracks(true, [1.85, 1.6], ALIKE);
        assert_eq!(reassociate(&mut different.moments, &options, &Size::prior(&options)).len(), 1);
        assert!(largest_error_m(&mut different, true) < 0.4);
    }

    #[test]
    fn heights_tell_nobody_apart_where_boxes_make_everybody_equally_tall() {
        let options = McmcOptions::of_boxes();
        let prior = Size::prior(&options);
        let equal = Size { height: Spread { sigma_m: 0.002, ..prior.height }, ..prior };
        let mut smoother = exchanged_tracks(true, [1.85, 1.6], ALIKE);
        assert!(reassociate(&mut smoother.moments, &options, &equal).is_empty());
    }

    #[test]
    fn people_of_different_appearance_who_turn_back_are_told_apart_by_their_vectors() {
        let options = McmcOptions::of_boxes();
        let mut different = exchanged_tracks(true, [1.7; 2], DIFFERENT);
        assert_eq!(reassociate(&mut different.moments, &options, &Size::prior(&options)).len(), 1);
        assert!(largest_error_m(&mut different, true) < 0.4);
    }

    #[test]
    fn names_are_exchanged_in_all_held_moments_since_the_meeting() {
        let mut smoother = exchanged_tracks(false, [1.7; 2], ALIKE);
        assert!(largest_error_m(&mut smoother.clone(), false) > 1.0);
        smoother.exchange_names([0, 1]);
        assert!(largest_error_m(&mut smoother, false) < 0.4);
    }

    #[test]
    fn moments_before_an_exchange_of_names_are_left_alone() {
        let options = McmcOptions::of_boxes();
        let mut smoother = exchanged_tracks(true, [1.7; 2], DIFFERENT);
        let last = smoother.moments.back_mut().unwrap();
        let [a, b] = &mut last.people[..] else { panic!("two people") };
        std::mem::swap(&mut a.id, &mut b.id);
        assert!(reassociate(&mut smoother.moments, &options, &Size::prior(&options)).is_empty());
    }
}
