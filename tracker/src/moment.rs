//! Input of a tracker (the observations of one time) and its output (the people).

use std::sync::Arc;

use image::RgbImage;
use serde::{Deserialize, Serialize};

use crate::observation::{Colours, Mask, PersonBox};

/// A person's number: given once, never given again in the same run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent)]
pub struct TrackId(pub u32);

impl std::fmt::Display for TrackId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

/// One camera's part of one moment. All of it is in the camera's *pinhole* image at the working size
/// ([`crate::stage::StageCamera`]).
#[derive(Debug, Clone, Default)]
pub struct CameraFrame {
    /// Foreground. `None` when the camera has nothing usable now: the frame is missing, frozen, or all foreground (lights
    /// switched). It is then left out of every likelihood.
    pub mask: Option<Mask>,
    /// Colours of the foreground, for appearance; `None` when only masks are given.
    pub colours: Option<Colours>,
    /// Boxes that a detector drew around people; `None` without a detector.
    pub boxes: Option<Vec<PersonBox>>,
    /// The picture, for methods that ask for it ([`crate::method::Needs`]).
    pub image: Option<Arc<RgbImage>>,
}

impl CameraFrame {
    /// A camera of which only the mask is known.
    pub fn of_mask(mask: impl Into<Mask>) -> Self {
        Self { mask: Some(mask.into()), ..Self::default() }
    }

    /// A camera of which only a detector's boxes are known.
    pub fn of_boxes(boxes: Vec<PersonBox>) -> Self {
        Self { boxes: Some(boxes), ..Self::default() }
    }

    /// A camera of which only the picture is known.
    pub fn of_image(image: RgbImage) -> Self {
        Self { image: Some(Arc::new(image)), ..Self::default() }
    }
}

/// All cameras at one time.
#[derive(Debug, Clone, Copy)]
pub struct Moment<'a> {
    /// The frame's number, from 1.
    pub frame: u32,
    /// When it was taken, in seconds. Grows from moment to moment, not always evenly.
    pub time_s: f64,
    /// One entry a camera, in the order of [`crate::stage::Stage::cameras`].
    pub cameras: &'a [CameraFrame],
}

/// A person at one time, as far as it is known.
#[derive(Debug, Clone, PartialEq)]
pub struct PersonEstimate {
    /// Who.
    pub id: TrackId,
    /// Where on the floor, metres in the room's frame.
    pub x_m: f64,
    /// Where on the floor, metres in the room's frame.
    pub y_m: f64,
    /// Height of what is followed above the floor: 0 for methods that follow the standing point.
    pub z_m: f64,
    /// Radius of the upright ellipsoid that stands for the body, metres.
    pub radius_m: f64,
    /// Height of the body, metres.
    pub height_m: f64,
    /// Velocity along x, m/s.
    pub vx: f64,
    /// Velocity along y, m/s.
    pub vy: f64,
    /// Standard deviation of the position along x and y, metres.
    pub sigma_m: [f64; 2],
    /// Probability that this person is there, in the room, 0 to 1.
    pub confidence: f64,
    /// One entry a camera, in the stage's order: the fraction of the person's silhouette within the image that the room
    /// and the other people leave visible; 0 when no part of it is in the image.
    pub visible: Vec<f64>,
}
