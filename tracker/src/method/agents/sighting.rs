//! Measurements by the image tracking of one station.

use nalgebra::{Matrix2, Point2};

use super::Looks;

/// Measurement of one person by one station at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Number of the image track. A track may switch to another person where people cross.
    pub track: u32,
    /// Place on the floor, metres.
    pub position: Point2<f64>,
    /// Covariance of the place, m²; largest along the line of sight.
    pub covariance: Matrix2<f64>,
    /// Height of the person, metres.
    pub height_m: f64,
    /// Measured colours; `None` when too little of the person is visible.
    pub looks: Option<Looks>,
    /// Whether the sighting may be of another person, who is near on the floor or in the image.
    pub is_crowded: bool,
}

/// All measurements by one station's image tracking at one moment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sightings {
    /// Capture time, seconds on the station's clock.
    pub time_s: f64,
    /// One sighting per detected person, by ascending track.
    pub people: Vec<Sighting>,
    /// Whether the camera had a usable image; without one, missing sightings are not missed detections.
    pub is_usable: bool,
}
