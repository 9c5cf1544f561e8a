//! Traits by which people are told apart in a detector's boxes: height, width, and the appearance vectors of the rows.

use super::learnt_length::{LearntLength, Length};
use super::options::Spread;
use super::posture::Size;
use crate::identity::mean_vector::{MeanVector, log_distance_ratio};

/// Number of boxes to which a mean vector is faded before new ones are added.
const REMEMBERED_BOXES: f64 = 400.0;
/// Factor of the log ratio of the vectors' distances, and number of boxes at which half of it counts: vectors of
/// successive boxes have errors in common, and a network's scale is unknown.
const VECTORS_WEIGHT: f64 = 7.0;
pub(super) const HALF_KNOWN_BOXES: f64 = 8.0;

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

/// Height and radius averaged over moments.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct LearntSize {
    height: LearntLength,
    radius: LearntLength,
}

impl LearntSize {
    /// Adds the size that one moment showed.
    pub(super) fn add(&mut self, shown: &ShownTraits) {
        shown.height.iter().for_each(|height| self.height.add(Length::Height, height));
        shown.radius.iter().for_each(|radius| self.radius.add(Length::Radius, radius));
    }

    /// Average over the moments of both.
    pub(super) fn with(&self, other: &Self) -> Self {
        Self { height: self.height.with(&other.height), radius: self.radius.with(&other.radius) }
    }

    /// Average over the moments that are not in `part`.
    pub(super) fn without(&self, part: &Self) -> Self {
        Self { height: self.height.without(&part.height), radius: self.radius.without(&part.radius) }
    }

    /// The same average, as certain as sizes of another time can be compared with it.
    pub(super) fn of_another_time(&self) -> Self {
        Self {
            height: self.height.of_another_time(Length::Height),
            radius: self.radius.of_another_time(Length::Radius),
        }
    }

    /// Average of a length, with its standard deviation; `None` before the first measurement.
    pub(super) fn average(&self, length: Length) -> Option<Spread> {
        match length {
            Length::Height => self.height.average(length),
            Length::Radius => self.radius.average(length),
        }
    }

    /// Log density of all lengths shown, of one person of unknown size, nats, up to a constant of the single lengths.
    pub(super) fn log_marginal(&self, population: &Size) -> f64 {
        self.height.log_marginal(&population.height) + self.radius.log_marginal(&population.radius)
    }

    /// Log density that this is the size of the person of whom `before` was learnt, among those of this population.
    pub(super) fn log_density(&self, before: &Self, population: &Size) -> f64 {
        self.height.log_density(Length::Height, &before.height, &population.height)
            + self.radius.log_density(Length::Radius, &before.radius, &population.radius)
    }
}

/// Log probability ratio, nats, that two people exchanged their tracks after they had shown `before`, given the sizes
/// `since` then.
pub(super) fn size_exchange_nats(
    before: [&LearntSize; 2],
    since: [&LearntSize; 2],
    population: &Size,
) -> f64 {
    let nats = |tail: usize, head: usize| since[tail].log_density(before[head], population);
    nats(0, 1) + nats(1, 0) - nats(0, 0) - nats(1, 1)
}

/// Traits averaged over moments.
#[derive(Debug, Clone, Default)]
pub(super) struct LearntTraits {
    pub(super) size: LearntSize,
    vector: MeanVector,
}

impl LearntTraits {
    /// Adds the traits of one moment.
    pub(super) fn add(&mut self, shown: &ShownTraits) {
        self.size.add(shown);
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
/// tracks showed `since` afterwards.
pub(super) fn exchange_nats(before: [&LearntTraits; 2], since: [&LearntTraits; 2], population: &Size) -> f64 {
    let by_sizes =
        size_exchange_nats(before.map(|traits| &traits.size), since.map(|traits| &traits.size), population);
    let [before, since] = [before, since].map(|pair| pair.map(|traits| &traits.vector));
    let fewest = before.iter().chain(&since).map(|vector| vector.boxes()).fold(f64::INFINITY, f64::min);
    let weight = vectors_weight(fewest);
    if weight > 0.0 { by_sizes + weight * log_distance_ratio(before, since) } else { by_sizes }
}
