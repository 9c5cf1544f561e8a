//! Reasons for which a station's packets are left out.

use std::collections::{BTreeMap, BTreeSet};

/// Reason for which packets are left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Refusal {
    /// Another version of the packets.
    Version,
    /// The station belongs to another room.
    Room,
    /// A camera that the room does not have, or numbers otherwise.
    Camera,
    /// More bytes than a packet can have.
    Oversized,
    /// Bytes that are no packet.
    Malformed,
    /// A sequence number that came before.
    Replayed,
    /// Another station of the same camera is heard already.
    Rival,
    /// The station's clock is wrong by more than a minute, or its capture times are.
    Clock,
    /// More than 2 s on its way.
    Late,
}

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
