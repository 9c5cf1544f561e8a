//! Counts of refusals, and a record of those that were logged.

use std::collections::{BTreeMap, BTreeSet};

use super::Refusal;

/// Largest number of camera names whose refusals are stored; beyond it nothing is logged.
const MOST_NAMES: usize = 512;

/// Counts of refusals, and a record of those that were logged.
#[derive(Debug, Default)]
pub(super) struct Refusals {
    counts: BTreeMap<Refusal, u64>,
    logged: BTreeSet<(String, Refusal)>,
}

impl Refusals {
    /// Counts a refusal. Returns whether it is the first of its kind for this camera, which is to be logged.
    pub(super) fn count(&mut self, camera: &str, refusal: Refusal) -> bool {
        *self.counts.entry(refusal).or_default() += 1;
        let key = (camera.to_owned(), refusal);
        (self.logged.len() < MOST_NAMES || self.logged.contains(&key)) && self.logged.insert(key)
    }

    /// Lets the next refusal of this kind be logged again. Returns whether one had been logged.
    pub(super) fn forget(&mut self, camera: &str, refusal: Refusal) -> bool {
        self.logged.remove(&(camera.to_owned(), refusal))
    }

    pub(super) fn counts(&self) -> &BTreeMap<Refusal, u64> {
        &self.counts
    }
}
