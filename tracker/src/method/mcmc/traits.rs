//! Traits by which people are told apart in a detector's boxes: height, and the appearance vectors of the rows.

use super::learnt_height::LearntHeight;
use super::options::Spread;
use crate::identity::mean_vector::{MeanVector, log_distance_ratio};

/// Number of boxes to which a mean vector is faded before new ones are added.
const REMEMBERED_BOXES: f64 = 400.0;
/// Factor of the log ratio of the vectors' distances, and number of boxes at which half of it counts: vectors of
/// successive boxes have errors in common, and a network's scale is unknown.
const VECTORS_WEIGHT: f64 = 7.0;
const HALF_KNOWN_BOXES: f64 = 8.0;

/// Traits that the boxes of one moment showed.
#[derive(Debug, Clone, Default)]
pub(super) struct ShownTraits {
    /// Height; `None` where the boxes did not measure it.
    pub(super) height: Option<Spread>,
    /// Radius; `None` where the boxes did not measure it.
    pub(super) radius: Option<Spread>,
    /// Vectors of the boxes that are surely this person's.
    pub(super) vector: MeanVector,
}

/// Traits averaged over moments.
#[derive(Debug, Clone, Default)]
pub(super) struct LearntTraits {
    height: LearntHeight,
    vector: MeanVector,
}

impl LearntTraits {
    /// Adds the traits of one moment.
    pub(super) fn add(&mut self, shown: &ShownTraits) {
        shown.height.iter().for_each(|height| self.height.add(height));
        self.vector.add(&shown.vector, REMEMBERED_BOXES);
    }

    /// Mean vector.
    pub(super) fn vector(&self) -> &MeanVector {
        &self.vector
    }
}

/// Factor of log ratios of vectors' distances, where a mean is that of so many boxes.
pub(super) fn vectors_weight(boxes: f64) -> f64 {
    VECTORS_WEIGHT * boxes / (boxes + HALF_KNOWN_BOXES)
}

/// Log probability ratio, nats, that two people exchanged their tracks after they had shown `before`, given that the
/// tracks showed `since` afterwards; `heights` is the prior of all people's heights.
pub(super) fn exchange_nats(before: [&LearntTraits; 2], since: [&LearntTraits; 2], heights: &Spread) -> f64 {
    let height = |tail: usize, head: usize| since[tail].height.log_density(&before[head].height, heights);
    let by_heights = height(0, 1) + height(1, 0) - height(0, 0) - height(1, 1);
    let [before, since] = [before, since].map(|pair| pair.map(|traits| &traits.vector));
    let fewest = before.iter().chain(&since).map(|vector| vector.boxes()).fold(f64::INFINITY, f64::min);
    let weight = vectors_weight(fewest);
    if weight > 0.0 { by_heights + weight * log_distance_ratio(before, since) } else { by_heights }
}
