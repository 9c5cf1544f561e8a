//! Mean appearance vector of a person, as re-identification networks give one for each box.
//!
//! Vectors are compared by their direction: `1 − cos` of the angle between them. Networks differ in how far apart the
//! vectors of two people are, so a decision rests on the ratio of two distances.

/// Sum of the unit vectors of a person's boxes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MeanVector {
    sum: Vec<f64>,
    boxes: f64,
}

impl MeanVector {
    /// Number of boxes, after fading.
    pub fn boxes(&self) -> f64 {
        self.boxes
    }

    /// Mean of the boxes' unit vectors; empty before the first box.
    pub fn mean(&self) -> impl Iterator<Item = f64> + '_ {
        self.sum.iter().map(|value| value / self.boxes)
    }

    /// Adds the vector of one box; one without direction, or of another length than those before, is left out.
    pub fn add_box(&mut self, vector: &[f32]) {
        let norm = vector.iter().map(|value| f64::from(*value).powi(2)).sum::<f64>().sqrt();
        if norm > 0.0 && (self.sum.is_empty() || self.sum.len() == vector.len()) {
            self.sum.resize(vector.len(), 0.0);
            for (sum, value) in self.sum.iter_mut().zip(vector) {
                *sum += f64::from(*value) / norm;
            }
            self.boxes += 1.0;
        }
    }

    /// Adds other boxes of the same person. Earlier ones are first faded to at most `remembered`.
    pub fn add(&mut self, other: &Self, remembered: f64) {
        if other.sum.is_empty() {
            return;
        }
        self.sum.resize(other.sum.len(), 0.0);
        let fade = if self.boxes > remembered { remembered / self.boxes } else { 1.0 };
        for (own, new) in self.sum.iter_mut().zip(&other.sum) {
            *own = *own * fade + new;
        }
        self.boxes = self.boxes * fade + other.boxes;
    }

    /// Distance of two directions: 0 for the same, 1 for orthogonal ones, 2 for opposite ones; 1 without a direction.
    pub fn distance(&self, other: &Self) -> f64 {
        let norm = |vector: &Self| vector.sum.iter().map(|value| value * value).sum::<f64>().sqrt();
        let both = norm(self) * norm(other);
        if both == 0.0 {
            return 1.0;
        }
        1.0 - self.sum.iter().zip(&other.sum).map(|(a, b)| a * b).sum::<f64>() / both
    }
}

/// Log ratio of the distances of two people's vectors from those learnt before, as they are named now over as they are
/// after an exchange of their names: positive where the exchange fits better. `known` and `now` are of the same two
/// people; a person of whom no vector was known before is passed over.
pub fn log_distance_ratio(known: [&MeanVector; 2], now: [&MeanVector; 2]) -> f64 {
    /// Distance that is no different from 0.
    const LEAST: f64 = 0.02;
    let (mut as_named, mut exchanged) = (LEAST, LEAST);
    for person in [0, 1] {
        if known[person].boxes > 0.0 {
            as_named += known[person].distance(now[person]);
            exchanged += known[person].distance(now[1 - person]);
        }
    }
    (as_named / exchanged).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn of(vectors: &[&[f32]]) -> MeanVector {
        let mut mean = MeanVector::default();
        for vector in vectors {
            mean.add_box(vector);
        }
        mean
    }

    #[test]
    fn distances_are_those_of_directions() {
        let (x, y) = (of(&[&[2.0, 0.0]]), of(&[&[0.0, 0.1]]));
        assert_relative_eq!(x.distance(&of(&[&[7.0, 0.0]])), 0.0, epsilon = 1e-12);
        assert_relative_eq!(x.distance(&y), 1.0, epsilon = 1e-12);
        assert_relative_eq!(x.distance(&of(&[&[-1.0, 0.0]])), 2.0, epsilon = 1e-12);
        // Long vectors weigh as much as short ones.
        let diagonal = of(&[&[100.0, 0.0], &[0.0, 0.5]]);
        assert_relative_eq!(x.distance(&diagonal), 1.0 - 0.5_f64.sqrt(), epsilon = 1e-12);
        assert_relative_eq!(x.distance(&MeanVector::default()), 1.0);
        assert_eq!((of(&[&[0.0, 0.0]]).boxes(), of(&[&[1.0], &[1.0, 0.0]]).boxes()), (0.0, 1.0));
    }

    #[test]
    fn old_boxes_fade() {
        let mut memory = of(&[[1.0, 0.0].as_slice(); 100]);
        memory.add(&of(&[[0.0, 1.0].as_slice(); 10]), 10.0);
        assert_relative_eq!(memory.distance(&of(&[&[1.0, 1.0]])), 0.0, epsilon = 1e-12);
        assert_relative_eq!(memory.boxes(), 20.0);
    }

    #[test]
    fn the_ratio_tells_in_which_order_two_people_fit() {
        let (a, b) = (of(&[&[1.0, 0.1]]), of(&[&[0.1, 1.0]]));
        assert!(log_distance_ratio([&a, &b], [&b, &a]) > 1.0);
        assert_relative_eq!(
            log_distance_ratio([&a, &b], [&a, &b]),
            -log_distance_ratio([&a, &b], [&b, &a]),
            epsilon = 1e-12
        );
        // Somebody who was never seen apart: the other one decides.
        let nobody = MeanVector::default();
        assert!(log_distance_ratio([&a, &nobody], [&b, &a]) > 1.0);
        assert_relative_eq!(log_distance_ratio([&nobody, &nobody], [&b, &a]), 0.0);
    }
}
