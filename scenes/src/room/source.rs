//! The world of the program that a room was imported from.

use serde::{Deserialize, Serialize};

/// Way from the source of an import to the room.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// Metres that were added to the source's coordinates: a georeferenced scan's far frame is brought to the origin.
    pub shift: [f64; 3],
}

impl Source {
    /// Defect for which the table is unusable.
    pub(super) fn defect(&self) -> Option<String> {
        let is_finite = self.shift.iter().all(|metres| metres.is_finite());
        (!is_finite)
            .then(|| "a number of `shift` is not finite; give the metres, or remove the table".to_owned())
    }
}
