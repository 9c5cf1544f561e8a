//! Counts of what was left out, and what has been told of it.

use std::collections::{BTreeMap, BTreeSet};

use super::Refusal;

/// Names of cameras whose refusals are remembered; with more of them nothing is told any more.
const MOST_NAMES: usize = 512;

/// Counts of what was left out, and what has been told of it.
#[derive(Debug, Default)]
pub(super) struct Refusals {
    counts: BTreeMap<Refusal, u64>,
    told: BTreeSet<(String, Refusal)>,
}

impl Refusals {
    /// Counts a refusal; returns whether it is the first of its kind of this camera, which is to be told.
    pub(super) fn count(&mut self, camera: &str, refusal: Refusal) -> bool {
        *self.counts.entry(refusal).or_default() += 1;
        let key = (camera.to_owned(), refusal);
        (self.told.len() < MOST_NAMES || self.told.contains(&key)) && self.told.insert(key)
    }

    /// Makes the next refusal of this kind told again.
    pub(super) fn forget(&mut self, camera: &str, refusal: Refusal) -> bool {
        self.told.remove(&(camera.to_owned(), refusal))
    }

    pub(super) fn counts(&self) -> &BTreeMap<Refusal, u64> {
        &self.counts
    }
}
