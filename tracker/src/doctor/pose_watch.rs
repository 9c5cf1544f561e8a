//! Watch over a camera's pose during a run: has it turned since the run's first picture?
//!
//! Each look follows corners of the first picture into the present one (optical flow, milliseconds). People, shadows and a
//! moved chair leave most other corners where they were; only where few are is the present picture compared with the
//! first one by its keypoints, as films are with reference pictures before a run. A camera has turned when most matches
//! agree on one rotation, and few on none.

use calib::Intrinsics;
use calib::vision::flow::{self, FlowPyramid};
use image::{GrayImage, RgbImage};
use nalgebra::{Point2, UnitQuaternion};

use super::agreement::Landmarks;
use super::views::{self, TURNED_DEG};
use crate::Result;

/// Time between two looks, seconds; and where the camera is known to be at rest elsewhere.
const LOOK_EVERY_S: f64 = 0.5;
const LOOK_AT_REST_EVERY_S: f64 = 5.0;
/// Most corners that are followed, the fewest of a picture that can be watched, and their least distance, pixels.
const MOST_CORNERS: usize = 150;
const LEAST_CORNERS: usize = 30;
const APART_PX: f64 = 14.0;
/// Quality of a corner relative to the strongest, and the side of the window of its gradients, pixels.
const QUALITY: f64 = 0.01;
const BLOCK_PX: u32 = 5;
/// Window and depth of the flow.
const WINDOW_PX: u32 = 15;
const DEPTH: u32 = 3;
/// Distance up to which a corner has not moved, as a share of that by the least turn that is told.
const UNMOVED_PART: f64 = 0.35;
/// Share of the corners that have not moved in a camera that has not turned.
const UNMOVED_SHARE: f64 = 0.3;
/// Turn between two looks up to which a camera is at rest, degrees, …
const REST_DEG: f64 = 0.2;
/// … and the time for which it must be, seconds: a hand may still be on it.
const REST_S: f64 = 1.5;

/// Result of a look at a camera's picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoseFinding {
    /// The camera stands as in the first picture, or nothing tells that it does not.
    Unmoved,
    /// The camera seems to have turned; one look alone may be deceived.
    Doubtful,
    /// The camera has turned, and may still be moving.
    Moved,
    /// The camera has turned, and is at rest.
    AtRest,
}

/// Watch over the pose of one camera.
pub struct PoseWatch {
    lens: Intrinsics,
    first: Option<FirstPicture>,
    looked_s: Option<f64>,
    finding: PoseFinding,
    /// Turn that the latest look has found.
    turn: Option<UnitQuaternion<f64>>,
    /// Time since which looks have found the same turn, seconds.
    rest_since_s: f64,
}

struct FirstPicture {
    grey: GrayImage,
    corners: Vec<Point2<f64>>,
    pyramid: FlowPyramid,
    /// Keypoints, once they are needed.
    landmarks: Option<Landmarks>,
}

impl PoseWatch {
    /// Watch over a camera with these intrinsics, at the size of the pictures that it will be shown.
    pub fn new(lens: Intrinsics) -> Self {
        Self {
            lens,
            first: None,
            looked_s: None,
            finding: PoseFinding::Unmoved,
            turn: None,
            rest_since_s: 0.0,
        }
    }

    /// The picture that later ones are compared with.
    pub fn first_picture(&self) -> Option<&GrayImage> {
        self.first.as_ref().map(|first| &first.grey)
    }

    /// Time of the latest look, seconds.
    pub fn looked_s(&self) -> Option<f64> {
        self.looked_s
    }

    /// Begins anew with the next picture.
    pub fn restart(&mut self) {
        *self = Self::new(self.lens.clone());
    }

    /// Takes a picture into account. A camera that has turned at two looks is never found unmoved again.
    ///
    /// # Errors
    /// An error of OpenCV.
    pub fn look(&mut self, picture: &RgbImage, time_s: f64) -> Result<PoseFinding> {
        let every_s = if self.finding == PoseFinding::AtRest { LOOK_AT_REST_EVERY_S } else { LOOK_EVERY_S };
        if self.looked_s.is_some_and(|looked_s| (0.0..every_s - 1e-6).contains(&(time_s - looked_s))) {
            return Ok(self.finding);
        }
        self.looked_s = Some(time_s);
        let grey = image::imageops::grayscale(picture);
        let Some(first) = &mut self.first else {
            self.first = FirstPicture::of(grey)?;
            return Ok(self.finding);
        };
        let has_moved = matches!(self.finding, PoseFinding::Moved | PoseFinding::AtRest);
        if !has_moved && first.is_like(&grey, &self.lens)? {
            (self.finding, self.turn) = (PoseFinding::Unmoved, None);
            return Ok(self.finding);
        }
        let turn = first.turn(&grey, &self.lens)?;
        let is_same =
            turn.zip(self.turn).is_some_and(|(now, before)| now.angle_to(&before).to_degrees() <= REST_DEG);
        if !is_same {
            self.rest_since_s = time_s;
        }
        let is_at_rest = is_same && time_s - self.rest_since_s >= REST_S - 1e-6;
        self.finding = match (self.finding, turn) {
            (PoseFinding::Unmoved, Some(_)) => PoseFinding::Doubtful,
            (PoseFinding::Unmoved | PoseFinding::Doubtful, None) => PoseFinding::Unmoved,
            (_, Some(_)) if is_at_rest => PoseFinding::AtRest,
            _ => PoseFinding::Moved,
        };
        self.turn = turn;
        Ok(self.finding)
    }
}

/// Number of pictures, in the order in which they were taken, before the camera turned for good; all of them where it
/// did not. `lens` is that of the pictures' size.
///
/// # Errors
/// An error of OpenCV.
pub fn pictures_before_turn(pictures: &[RgbImage], lens: &Intrinsics) -> Result<usize> {
    let grey = |picture: &RgbImage| image::imageops::grayscale(picture);
    let all = pictures.len();
    let [first, .., last] = pictures else { return Ok(all) };
    let Some(mut first) = FirstPicture::of(grey(first))? else { return Ok(all) };
    let mut has_turned = |picture: &RgbImage| -> Result<bool> {
        let picture = grey(picture);
        Ok(!first.is_like(&picture, lens)? && first.turn(&picture, lens)?.is_some())
    };
    if !has_turned(last)? {
        return Ok(all);
    }
    let mut before = all - 1;
    while before > 1 && has_turned(&pictures[before - 1])? {
        before -= 1;
    }
    Ok(before)
}

impl FirstPicture {
    /// `None` for a picture with too little to follow.
    fn of(grey: GrayImage) -> Result<Option<Self>> {
        let corners = flow::corners(&grey, MOST_CORNERS, QUALITY, APART_PX, BLOCK_PX)?;
        if corners.len() < LEAST_CORNERS {
            return Ok(None);
        }
        let pyramid = FlowPyramid::new(&grey, WINDOW_PX, DEPTH)?;
        Ok(Some(Self { grey, corners, pyramid, landmarks: None }))
    }

    /// Whether enough corners are where they were.
    fn is_like(&self, now: &GrayImage, lens: &Intrinsics) -> Result<bool> {
        let there = FlowPyramid::new(now, WINDOW_PX, DEPTH)?;
        let ends = flow::follow(&self.pyramid, &there, &self.corners, &self.corners)?;
        let limit_px = UNMOVED_PART * lens.fx * TURNED_DEG.to_radians().tan();
        let is_unmoved = |(start, end): (&Point2<f64>, &Option<Point2<f64>>)| {
            end.is_some_and(|end| (end - start).norm() <= limit_px)
        };
        let unmoved = self.corners.iter().zip(&ends).filter(|pair| is_unmoved(*pair)).count();
        Ok(unmoved as f64 >= UNMOVED_SHARE * self.corners.len() as f64)
    }

    /// Turn of the camera since this picture, if the present one shows clearly that there is one.
    fn turn(&mut self, now: &GrayImage, lens: &Intrinsics) -> Result<Option<UnitQuaternion<f64>>> {
        let own = match &self.landmarks {
            Some(own) => own,
            None => self.landmarks.insert(Landmarks::of(&self.grey, lens)?),
        };
        let agreement = own.agreement(&Landmarks::of(now, lens)?);
        Ok(views::is_turned(&agreement).then_some(agreement.film_from_reference))
    }
}
