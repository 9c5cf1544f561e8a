//! Fixed-lag smoothing: corrects the estimates of a moment by the moments of the following `lag_s` seconds (Rauch,
//! Tung & Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 3(8), 1965).
//!
//! Later moments tell where a person was, and a track that is confirmed later already existed while it was
//! unconfirmed. The smoother therefore holds each moment for `lag_s` seconds and corrects its beliefs `m, P`
//! backwards from the latest moment, with what they predicted for the following one (`m⁻, P⁻`, by the transition F):
//!
//! ```text
//! G = P Fᵀ (P⁻)⁻¹      mˢ = m + G (mˢ₊₁ − m⁻)      Pˢ = P + G (Pˢ₊₁ − P⁻) Gᵀ
//! ```

use std::collections::VecDeque;

use super::motion::Belief;
use super::person::Key;
use super::trace::Trace;
use super::traits::LearntTraits;
use crate::PersonEstimate;

/// Time for which an exchange of tracks can be undone, and moments hold what decides it, seconds.
pub(super) const WINDOW_S: f64 = 3.0;

/// Fixed-lag smoother over the latest moments, oldest first.
#[derive(Debug, Clone, Default)]
pub(super) struct FixedLagSmoother {
    pub(super) moments: VecDeque<LaggedMoment>,
    /// Last moment that was taken.
    taken: Option<u32>,
}

/// Tracks of one held moment.
#[derive(Debug, Clone)]
pub(super) struct LaggedMoment {
    frame: u32,
    pub(super) time_s: f64,
    pub(super) people: Vec<Trace>,
    /// Whether a detector's boxes are the only observations: then a moment without a measurement is evidence of absence.
    by_boxes: bool,
    /// Whether the moment is older than [`WINDOW_S`], and its people's learnt traits are dropped.
    is_old: bool,
}

/// Time over which later moments correct a place, seconds. Those after it are left out, since they cost time: where moments are
/// a second apart, they would correct a place by another half centimetre.
const SMOOTHED_S: f64 = 3.0;

impl FixedLagSmoother {
    /// Appends a moment and holds it for `lag_s` seconds; older moments that were never taken are dropped.
    pub(super) fn push(
        &mut self,
        (frame, time_s): (u32, f64),
        lag_s: f64,
        people: Vec<Trace>,
        by_boxes: bool,
    ) {
        if let Some(latest_s) = self.moments.back().map(|latest| latest.time_s) {
            while self.moments.front().is_some_and(|first| first.time_s + lag_s < latest_s - 1e-6) {
                self.moments.pop_front();
            }
        }
        // Later than that, no single pair of tracks is exchanged.
        let first_s = time_s - WINDOW_S - 1e-6;
        let old = self.moments.iter_mut().rev().skip_while(|moment| moment.time_s >= first_s);
        for moment in old {
            if std::mem::replace(&mut moment.is_old, true) {
                break;
            }
            for trace in &mut moment.people {
                trace.learnt = LearntTraits::default();
            }
        }
        self.moments.push_back(LaggedMoment { frame, time_s, people, by_boxes, is_old: false });
    }

    /// Exchanges the names of two tracks, which belong to each other's people since they were nearest to each other, from
    /// then on. Returns the time of that moment, seconds; `None` where the two are not both held.
    pub(super) fn exchange_names(&mut self, keys: [Key; 2]) -> Option<f64> {
        let both = |moment: &LaggedMoment| -> Option<[usize; 2]> {
            let of = |key: Key| moment.people.iter().position(|p| p.key == key && p.id.is_some());
            Some([of(keys[0])?, of(keys[1])?])
        };
        let found: Vec<[usize; 2]> = self.moments.iter().rev().map_while(both).collect();
        let distance_m = |(back, [a, b]): (usize, &[usize; 2])| {
            let people = &self.moments[self.moments.len() - 1 - back].people;
            (people[*a].motion.place() - people[*b].motion.place()).norm()
        };
        let distances: Vec<f64> = found.iter().enumerate().map(distance_m).collect();
        let nearest = (0..found.len()).min_by(|i, j| distances[*i].total_cmp(&distances[*j])).unwrap_or(0);
        for ([a, b], moment) in found[..nearest].iter().zip(self.moments.iter_mut().rev()) {
            let (left, right) = moment.people.split_at_mut(*a.max(b));
            let (one, other) = (&mut left[*a.min(b)], &mut right[0]);
            std::mem::swap(&mut one.id, &mut other.id);
            std::mem::swap(&mut one.learnt, &mut other.learnt);
        }
        let back = (!found.is_empty()).then_some(nearest)?;
        Some(self.moments[self.moments.len() - 1 - back].time_s)
    }

    /// Tracks of the latest moment.
    pub(super) fn latest(&self) -> Option<&[Trace]> {
        self.moments.back().map(|moment| moment.people.as_slice())
    }

    /// Smoothed estimates of the people of a held moment; `None` if the moment is not held, or has been taken or
    /// passed over.
    pub(super) fn take(&mut self, frame: u32) -> Option<Vec<PersonEstimate>> {
        if self.taken.is_some_and(|taken| frame <= taken) {
            return None;
        }
        let at = self.moments.iter().position(|moment| moment.frame == frame)?;
        self.taken = Some(frame);
        let people = self.moments[at].people.iter();
        let mut estimates: Vec<_> = people.filter_map(|person| self.smoothed_estimate(at, person)).collect();
        // After an exchange, two unconfirmed tracks may both be confirmed with the same id: the one that gets it first keeps it.
        let confirmed: Vec<_> = estimates.iter().map(|(after, estimate)| (estimate.id, *after)).collect();
        estimates.retain(|(after, estimate)| {
            confirmed.iter().all(|(id, other_after)| *id != estimate.id || other_after >= after)
        });
        Some(estimates.into_iter().map(|(_, estimate)| estimate).collect())
    }

    /// Smoothed estimate of a person in the moment with this index, and the number of moments until the track is confirmed; `None`
    /// if it never is.
    fn smoothed_estimate(&self, at: usize, person: &Trace) -> Option<(usize, PersonEstimate)> {
        // The track's successive states, for as long as its key is present without a gap.
        let later = self.moments.range(at..).map_while(|m| m.people.iter().find(|p| p.key == person.key));
        let life: Vec<&Trace> = later.collect();
        let (confirmed_after, named) = life.iter().enumerate().find(|(_, p)| p.id.is_some())?;
        if person.id.is_none() && self.moments[at].people.iter().any(|other| other.id == named.id) {
            // The name was another track's at that time.
            return None;
        }
        let is_over = at + life.len() < self.moments.len() || life.last()?.id.is_none();
        let is_measured = life.iter().any(|p| p.motion.measured.is_some());
        if self.moments[at].by_boxes && is_over && !is_measured {
            // The person had left already: only the prediction went on.
            return None;
        }
        let until_s = self.moments[at].time_s + SMOOTHED_S + 1e-6;
        let times = self.moments.range(at..).map(|moment| moment.time_s);
        let near = life.iter().zip(times).take_while(|(_, time_s)| *time_s <= until_s).count();
        let mut belief = life.get(near.checked_sub(1)?)?.motion.belief.clone();
        for pair in life[..near].windows(2).rev() {
            belief = rts_step(pair[0], pair[1], &belief);
        }
        let confidence = if person.id.is_some() { person.confidence } else { named.confidence };
        Some((confirmed_after, PersonEstimate { confidence, ..person.estimate(named.id?, &belief) }))
    }
}

/// One backward step of Rauch, Tung & Striebel: belief of the earlier moment, given the smoothed belief of the later
/// one.
fn rts_step(earlier: &Trace, later: &Trace, known: &Belief) -> Belief {
    let then = &earlier.motion.belief;
    let Some(step) = &later.motion.arrived else { return then.clone() };
    let Some(inverse) = step.predicted.covariance.try_inverse() else { return then.clone() };
    let gain = then.covariance * step.transition.transpose() * inverse;
    let covariance =
        then.covariance + gain * (known.covariance - step.predicted.covariance) * gain.transpose();
    Belief {
        mean: then.mean + gain * (known.mean - step.predicted.mean),
        covariance: 0.5 * (covariance + covariance.transpose()),
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::Motion;
    use super::super::options::MotionOptions;
    use super::super::trace::LASTING_SIGMA_M;
    use super::super::traits::ShownTraits;
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{DMatrix, DVector, Matrix2, Matrix2x4, Matrix4, Vector2};

    use crate::TrackId;

    const LAG_S: f64 = 10.0;

    fn trace(motion: &Motion, id: Option<u32>, confidence: f64) -> Trace {
        Trace {
            key: 7,
            id: id.map(TrackId),
            motion: motion.clone(),
            radius_m: 0.25,
            height_m: 1.7,
            confidence,
            visible: vec![1.0],
            shown: ShownTraits::default(),
            learnt: LearntTraits::default(),
        }
    }

    /// Comparison with the batch solution: the normal equations of all states at once.
    #[test]
    fn smoothing_equals_the_batch_solution_within_the_time_that_corrects_a_place() {
        const MOMENTS: usize = 6;
        let options = MotionOptions::default();
        let lean = options.lean_s;
        let h = Matrix2x4::new(1.0, 0.0, lean, 0.0, 0.0, 1.0, 0.0, lean);
        let noise = Matrix2::new(0.004, 0.001, 0.001, 0.006);
        let gait = Matrix2::identity() * options.gait_sigma_m.powi(2);
        let found = [(1.06, 2.03), (1.17, 2.01), (1.19, 2.09), (1.33, 2.16), (1.36, 2.19)];

        let mut motion = Motion::appeared(Vector2::new(1.0, 2.0), &(Matrix2::identity() * 0.01), &options);
        let mut information = DMatrix::<f64>::zeros(4 * MOMENTS, 4 * MOMENTS);
        let mut weighed = DVector::<f64>::zeros(4 * MOMENTS);
        let first = motion.belief.covariance.try_inverse().unwrap();
        information.view_mut((0, 0), (4, 4)).copy_from(&first);
        weighed.rows_mut(0, 4).copy_from(&(first * motion.belief.mean));

        let mut smoother = FixedLagSmoother::default();
        smoother.push((1, 0.0), LAG_S, vec![trace(&motion, Some(3), 1.0)], false);
        for (k, (x, y)) in found.into_iter().enumerate() {
            // Hidden for a while.
            let is_seen = k != 2;
            let before = motion.belief.covariance;
            motion.predict(0.1 + 0.05 * k as f64, is_seen, &options);
            let f = motion.arrived.as_ref().unwrap().transition;
            let prior = motion.belief.clone();
            let q = (prior.covariance - f * before * f.transpose()).try_inverse().unwrap();
            let step = 4 * k;
            for (at, block) in [
                ((step, step), f.transpose() * q * f),
                ((step, step + 4), -f.transpose() * q),
                ((step + 4, step), -q * f),
                ((step + 4, step + 4), q),
            ] {
                let sum = information.fixed_view::<4, 4>(at.0, at.1) + block;
                information.view_mut(at, (4, 4)).copy_from(&sum);
            }
            if is_seen {
                // The posterior of a sampler without gait noise; the belief adds that noise.
                let seen = Vector2::new(x, y);
                let s = h * prior.covariance * h.transpose() + noise;
                let gain = prior.covariance * h.transpose() * s.try_inverse().unwrap();
                let mean = prior.mean + gain * (seen - h * prior.mean);
                let covariance = (Matrix4::identity() - gain * h) * prior.covariance;
                motion.condition(&(h * mean), &(h * covariance * h.transpose()), &options);
                let r = (noise + gait).try_inverse().unwrap();
                let sum = information.fixed_view::<4, 4>(step + 4, step + 4) + h.transpose() * r * h;
                information.view_mut((step + 4, step + 4), (4, 4)).copy_from(&sum);
                let sum = weighed.fixed_rows::<4>(step + 4) + h.transpose() * r * seen;
                weighed.rows_mut(step + 4, 4).copy_from(&sum);
            }
            // All within the time that corrects a place.
            let time_s = 0.5 * (k as f64 + 1.0);
            smoother.push((k as u32 + 2, time_s), LAG_S, vec![trace(&motion, Some(3), 1.0)], false);
        }
        let covariance = information.try_inverse().unwrap();
        let mean = &covariance * weighed;
        for k in 0..MOMENTS {
            let people = smoother.take(k as u32 + 1).unwrap();
            let [person] = people.as_slice() else { panic!("{people:?}") };
            let found = [person.x_m, person.y_m, person.vx, person.vy];
            for (i, value) in found.into_iter().enumerate() {
                assert_relative_eq!(value, mean[4 * k + i], epsilon = 1e-8);
            }
            for (axis, sigma_m) in person.sigma_m.into_iter().enumerate() {
                let variance = covariance[(4 * k + axis, 4 * k + axis)];
                assert_relative_eq!(sigma_m, variance.sqrt().hypot(LASTING_SIGMA_M), epsilon = 1e-8);
            }
        }
    }

    #[test]
    fn smoothing_reports_only_tracks_that_are_confirmed_later() {
        let motion = Motion::appeared(Vector2::zeros(), &Matrix2::identity(), &MotionOptions::default());
        let other = |key| Trace { key, ..trace(&motion, None, 0.5) };
        let mut smoother = FixedLagSmoother::default();
        smoother.push((4, 0.4), LAG_S, vec![trace(&motion, None, 0.5), other(8)], false);
        smoother.push((5, 0.5), LAG_S, vec![trace(&motion, None, 0.6), other(8)], false);
        smoother.push((6, 0.6), LAG_S, vec![trace(&motion, Some(2), 0.9)], false);
        smoother.push((7, 0.7), LAG_S, vec![trace(&motion, Some(9), 0.7)], false);
        let reported = |people: Vec<PersonEstimate>| -> Vec<(u32, f64)> {
            people.iter().map(|p| (p.id.0, p.confidence)).collect()
        };
        // The confidence is that of the moment of confirmation; a later exchange of ids changes nothing.
        assert_eq!(reported(smoother.take(4).unwrap()), [(2, 0.9)]);
        assert_eq!(reported(smoother.take(6).unwrap()), [(2, 0.9)]);
        assert!(smoother.take(5).is_none(), "moments up to the one that was asked for are forgotten");
        assert_eq!(reported(smoother.take(7).unwrap()), [(9, 0.7)]);
        assert!(smoother.take(8).is_none());
    }

    #[test]
    fn no_id_is_reported_twice_in_a_moment() {
        let motion = Motion::appeared(Vector2::zeros(), &Matrix2::identity(), &MotionOptions::default());
        let track = |key, id| Trace { key, ..trace(&motion, id, 0.9) };
        let mut smoother = FixedLagSmoother::default();
        // Two tracks, confirmed one after the other; their ids were exchanged between the two confirmations.
        smoother.push((1, 0.1), LAG_S, vec![track(8, None), track(7, None)], false);
        smoother.push((2, 0.2), LAG_S, vec![track(8, None), track(7, Some(14))], false);
        smoother.push((3, 0.3), LAG_S, vec![track(8, Some(14)), track(7, Some(15))], false);
        let ids = |people: Vec<PersonEstimate>| people.iter().map(|p| p.id.0).collect::<Vec<u32>>();
        assert_eq!(ids(smoother.take(1).unwrap()), [14]);
        assert_eq!(ids(smoother.take(2).unwrap()), [14]);
        assert_eq!(ids(smoother.take(3).unwrap()), [14, 15]);
    }

    /// A person out of sight is reported as long as their track goes on; with boxes alone, a track that ends without
    /// another measurement is reported up to its last one.
    #[test]
    fn by_boxes_a_track_that_ends_is_reported_up_to_its_last_measurement() {
        let options = MotionOptions::default();
        let reported = |by_boxes: bool, ends: bool| -> Vec<usize> {
            let mut motion = Motion::appeared(Vector2::zeros(), &Matrix2::identity(), &options);
            let mut smoother = FixedLagSmoother::default();
            for frame in 0..6 {
                if frame > 0 {
                    motion.predict(0.5, true, &options);
                }
                if frame < 3 {
                    motion.measure(&Vector2::zeros(), &Matrix2::identity(), &options);
                }
                let people = if ends && frame == 5 { Vec::new() } else { vec![trace(&motion, Some(1), 0.9)] };
                smoother.push((frame, 0.5 * f64::from(frame)), LAG_S, people, by_boxes);
            }
            (0..6).map(|frame| smoother.take(frame).unwrap().len()).collect()
        };
        assert_eq!(reported(true, true), [1, 1, 1, 0, 0, 0]);
        assert_eq!(reported(true, false), [1; 6]);
        assert_eq!(reported(false, true), [1, 1, 1, 1, 1, 0]);
    }

    #[test]
    fn moments_older_than_the_lag_are_dropped() {
        let mut smoother = FixedLagSmoother::default();
        for frame in 0..1000 {
            smoother.push((frame, f64::from(frame) * 0.1), 0.4, Vec::new(), false);
        }
        assert!(smoother.moments.len() <= 6, "{}", smoother.moments.len());
        assert!(smoother.take(995).is_some(), "0.4 s ago");
    }
}
