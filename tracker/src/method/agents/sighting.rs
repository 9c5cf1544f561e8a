//! What the image tracking of one station finds.

use nalgebra::{Matrix2, Point2};

use super::Looks;

/// Measurement of one person by one station at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Number of the image track: the same as long as image tracking takes it for the same person. It may be wrong
    /// about that where people cross.
    pub track: u32,
    /// Place on the floor, metres.
    pub position: Point2<f64>,
    /// Covariance of the place, m²: long along the line of sight.
    pub covariance: Matrix2<f64>,
    /// Height of the person, metres.
    pub height_m: f64,
    /// Colours; `None` where too little is seen of the person.
    pub looks: Option<Looks>,
    /// Whether other people are so near, on the floor or in the image, that it may be one of them.
    pub is_crowded: bool,
}

/// All that one station's image tracking finds at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sightings {
    /// Capture time, seconds on the station's clock.
    pub time_s: f64,
    /// One a person found, by ascending track.
    pub people: Vec<Sighting>,
    /// Whether the camera showed anything usable; when not, nobody is seen and nobody is missed.
    pub is_usable: bool,
}
