//! Input of a tracker (the observations of one time) and its output (the people).

use std::sync::Arc;

use image::RgbImage;
use mot::TrackId;

use crate::observation::{Colours, Mask, PersonBox};

/// One camera's part of one moment, in the camera's *pinhole* image at the working size
/// ([`crate::prepared_room::PreparedCamera`]).
#[derive(Debug, Clone, Default)]
pub struct CameraFrame {
    /// Foreground mask. `None` when the camera has nothing usable: the frame is missing, frozen, or all foreground
    /// (lights switched). The camera is then left out of every likelihood.
    pub mask: Option<Mask>,
    /// Colours of the foreground, for appearance; `None` when only masks are given.
    pub colours: Option<Colours>,
    /// Boxes that a detector drew around people; `None` without a detector.
    pub boxes: Option<Vec<PersonBox>>,
    /// The picture, for methods that ask for it ([`crate::method::Needs`]).
    pub image: Option<Arc<RgbImage>>,
}

impl CameraFrame {
    /// Builds the frame of a camera from its mask alone.
    pub fn of_mask(mask: impl Into<Mask>) -> Self {
        Self { mask: Some(mask.into()), ..Self::default() }
    }

    /// Builds the frame of a camera from a detector's boxes alone.
    pub fn of_boxes(boxes: Vec<PersonBox>) -> Self {
        Self { boxes: Some(boxes), ..Self::default() }
    }

    /// Builds the frame of a camera from its picture alone.
    pub fn of_image(image: RgbImage) -> Self {
        Self { image: Some(Arc::new(image)), ..Self::default() }
    }
}

/// The observations of all cameras at one time.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// Number of the moment, from 1.
    pub frame: u32,
    /// Capture time, seconds. It grows from moment to moment, not always by the same step.
    pub time_s: f64,
    /// One entry a camera, in the order of [`crate::prepared_room::PreparedRoom::cameras`].
    pub cameras: &'a [CameraFrame],
}

/// Estimate of one person at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct PersonEstimate {
    /// The person's track.
    pub id: TrackId,
    /// Position on the floor along x, metres in the room's frame.
    pub x_m: f64,
    /// Position on the floor along y, metres in the room's frame.
    pub y_m: f64,
    /// Height of the tracked point above the floor, metres: 0 for methods that track the standing point.
    pub z_m: f64,
    /// Radius of the upright ellipsoid that models the body, metres.
    pub radius_m: f64,
    /// Height of the body, metres.
    pub height_m: f64,
    /// Velocity along x, m/s.
    pub vx: f64,
    /// Velocity along y, m/s.
    pub vy: f64,
    /// Standard deviations of the position along x and y, metres.
    pub sigma_m: [f64; 2],
    /// Probability that the person exists and is in the room, 0 to 1.
    pub confidence: f64,
    /// Visible fraction in each camera, in the order of the prepared room's cameras: the part of the person's
    /// silhouette within the image that neither the room nor other people hide; 0 when no part of it is in the image.
    pub visible: Vec<f64>,
}

#[cfg(test)]
impl PersonEstimate {
    /// A person who stands still at a place and is certain, for tests.
    pub(crate) fn standing(id: u32, x_m: f64, y_m: f64) -> Self {
        Self {
            id: TrackId(id),
            x_m,
            y_m,
            z_m: 0.0,
            radius_m: 0.25,
            height_m: 1.75,
            vx: 0.0,
            vy: 0.0,
            sigma_m: [0.0; 2],
            confidence: 1.0,
            visible: Vec::new(),
        }
    }
}
