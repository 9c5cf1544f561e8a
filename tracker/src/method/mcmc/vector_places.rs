//! Places at which this moment's boxes show appearance vectors, as evidence of who stands there.
//!
//! The boxes' likelihood does not depend on who is who; the vectors' does. Each place at which a person was fitted to the
//! boxes has the mean vector of these boxes. A known person at such a place has the log-likelihood
//!
//! ```text
//! w(n) · ( mean over known people j of ln d_j  −  ln d )        d: distance of the vector learnt from the one seen
//! ```
//!
//! relative to a stranger, whose vector is as far away as that of the others is on average; w grows with the number n of
//! boxes.

use nalgebra::Vector2;

use super::traits::{LearntTraits, vectors_weight};
use crate::identity::mean_vector::MeanVector;

/// Largest distance of a body from the place of the boxes that it explains, metres.
const SAME_PLACE_M: f64 = 0.3;
/// Largest evidence of one moment, nats.
const MOST_NATS: f64 = 4.0;
/// Least number of boxes of which a vector is learnt, before it says who somebody is.
const ENOUGH_BOXES: f64 = 20.0;
/// Distance that is no different from 0.
const LEAST: f64 = 0.02;

/// Log-likelihood of the vectors seen at some places for one person.
#[derive(Debug, Clone, Default)]
pub(super) struct VectorPlaces {
    /// Place, metres, and log-likelihood, nats.
    places: Vec<(Vector2<f64>, f64)>,
}

impl VectorPlaces {
    /// Evidence for each of the known people (with what was learnt of them), from the places (metres) at which vectors are
    /// seen.
    pub(super) fn of_people(learnt: &[&LearntTraits], seen: &[(Vector2<f64>, MeanVector)]) -> Vec<Self> {
        let is_known = |traits: &LearntTraits| traits.vector().boxes() >= ENOUGH_BOXES;
        let mut evidence = vec![Self::default(); learnt.len()];
        for (place, vector) in seen.iter().filter(|(_, vector)| vector.boxes() > 0.0) {
            let log = |traits: &LearntTraits| (traits.vector().distance(vector) + LEAST).ln();
            let logs: Vec<Option<f64>> =
                learnt.iter().map(|traits| is_known(traits).then(|| log(traits))).collect();
            let known = logs.iter().flatten().count();
            let mean = logs.iter().flatten().sum::<f64>() / known.max(1) as f64;
            for (evidence, log) in evidence.iter_mut().zip(&logs) {
                let nats = log.map_or(0.0, |log| vectors_weight(vector.boxes()) * (mean - log));
                evidence.places.push((*place, nats.clamp(-MOST_NATS, MOST_NATS)));
            }
        }
        evidence
    }

    /// Log-likelihood of what is seen at a place (metres), relative to a stranger; 0 where no vector is seen.
    pub(super) fn log_likelihood(&self, x_m: f64, y_m: f64) -> f64 {
        let squared_m2 = |place: &Vector2<f64>| (place.x - x_m).powi(2) + (place.y - y_m).powi(2);
        let nearest = self.places.iter().map(|(place, nats)| (squared_m2(place), *nats));
        let nearest = nearest.min_by(|one, other| one.0.total_cmp(&other.0));
        nearest.filter(|(m2, _)| *m2 < SAME_PLACE_M.powi(2)).map_or(0.0, |(_, nats)| nats)
    }
}

#[cfg(test)]
mod tests {
    use super::super::traits::ShownTraits;
    use super::*;

    fn vector(of: [f32; 2], boxes: usize) -> MeanVector {
        let mut mean = MeanVector::default();
        (0..boxes).for_each(|_| mean.add_box(&of));
        mean
    }

    fn learnt(of: [f32; 2], boxes: usize) -> LearntTraits {
        let mut learnt = LearntTraits::default();
        learnt.add(&ShownTraits { vector: vector(of, boxes), ..ShownTraits::default() });
        learnt
    }

    #[test]
    fn vectors_speak_for_who_stands_where_they_are_seen_and_nowhere_else() {
        let people = [learnt([1.0, 0.1], 40), learnt([0.1, 1.0], 40), learnt([0.5, 0.5], 3)];
        let seen = [
            (Vector2::new(1.0, 1.0), vector([1.0, 0.2], 3)),
            (Vector2::new(3.0, 1.0), vector([0.0, 1.0], 1)),
        ];
        let [a, b, unknown] = &VectorPlaces::of_people(&people.each_ref(), &seen)[..] else { panic!() };
        assert!(a.log_likelihood(1.1, 1.0) > 1.0 && b.log_likelihood(1.1, 1.0) < -1.0);
        assert!(a.log_likelihood(3.0, 1.1) < 0.0 && b.log_likelihood(3.0, 1.1) > 0.0);
        // More boxes say more.
        assert!(a.log_likelihood(1.0, 1.0) > b.log_likelihood(3.0, 1.0));
        assert_eq!((a.log_likelihood(2.0, 1.0), unknown.log_likelihood(1.0, 1.0)), (0.0, 0.0));
    }
}
