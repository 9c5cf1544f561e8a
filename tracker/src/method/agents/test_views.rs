//! Fields of view for tests.

use nalgebra::Point2;

use super::{FieldOfView, StationId};

/// Visible part of a person as a function of station and place; all fields of view overlap.
pub(super) struct Views(pub(super) fn(u8, Point2<f64>) -> f64);

impl Views {
    /// Every station sees every place.
    pub(super) const OPEN: Self = Self(|_, _| 1.0);
}

impl FieldOfView for Views {
    fn visible(&self, station: StationId, place: Point2<f64>, _height_m: f64) -> f64 {
        (self.0)(station.0, place)
    }

    fn overlap(&self, _: StationId, _: StationId) -> bool {
        true
    }
}
