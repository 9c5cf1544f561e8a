//! Watch over a camera's pose during a run: has it turned since the run's first picture?
//!
//! Each look follows corners of the first picture into the present one (optical flow, milliseconds). Optical flow takes a change of
//! brightness for motion, so both pictures are first divided by their mean around each pixel: what is left is the same by day and
//! by lamplight. People, shadows and a moved chair leave most other corners where they were; only where few are is the present
//! picture compared with the first one by its keypoints, as films are with reference pictures before a run. A camera has turned when
//! most matches agree on one rotation, and few on none.

use calib::Intrinsics;
use calib::vision::Morphology;
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
/// Half the side of the square over which a pixel's surroundings are averaged, less half a pixel, and the level of a pixel that is as
/// bright as they are.
const AROUND_PX: u32 = 10;
const EVEN_LEVEL: u32 = 96;
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
        let pyramid = FlowPyramid::new(&evenly_lit(&grey)?, WINDOW_PX, DEPTH)?;
        Ok(Some(Self { grey, corners, pyramid, landmarks: None }))
    }

    /// Whether enough corners are where they were.
    fn is_like(&self, now: &GrayImage, lens: &Intrinsics) -> Result<bool> {
        let there = FlowPyramid::new(&evenly_lit(now)?, WINDOW_PX, DEPTH)?;
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

/// The picture divided by the mean around each pixel: light that changes smoothly over the picture leaves it as it is.
fn evenly_lit(grey: &GrayImage) -> Result<GrayImage> {
    let mut even = GrayImage::default();
    Morphology::default().box_blur(grey, AROUND_PX, &mut even)?;
    for (around, level) in even.iter_mut().zip(grey.iter()) {
        // One more of both: a black picture is evenly lit, too.
        let ratio = EVEN_LEVEL * (u32::from(*level) + 1) / (u32::from(*around) + 1);
        *around = ratio.min(u32::from(u8::MAX)) as u8;
    }
    Ok(even)
}

#[cfg(test)]
mod tests {
    use image::Luma;

    use super::*;

    const SIZE: (u32, u32) = (320, 240);

    fn lens() -> Intrinsics {
        Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 70.0)
    }

    /// Tiles of random brightness, moved, in a light by column, with a little noise of its own.
    fn picture(moved_px: f64, light: impl Fn(u32) -> f64, grain: u32) -> GrayImage {
        let hash = |x: u32, y: u32| f64::from((x * 7919 + y * 104_729).wrapping_mul(2_654_435_761) >> 24);
        // A tile's edge is as soft as a lens makes it.
        let tiles = |x: f64, y: f64| {
            let (left, part) = ((x / 12.0).floor(), ((x / 12.0).fract() * 12.0).min(1.0));
            let of = |column: f64| hash(column as u32 + 7, (y / 12.0) as u32 + 3);
            40.0 + 0.5 * (part * of(left) + (1.0 - part) * of(left - 1.0))
        };
        GrayImage::from_fn(SIZE.0, SIZE.1, |u, v| {
            let noise = hash(u + 1000 * grain, v) / 64.0 - 2.0;
            let level = light(u) * tiles(f64::from(u) + 100.0 - moved_px, f64::from(v)) + noise;
            Luma([level.clamp(0.0, 255.0) as u8])
        })
    }

    #[test]
    fn corners_stay_where_they_are_in_any_light() {
        let first = FirstPicture::of(picture(0.0, |_| 1.0, 1)).unwrap().unwrap();
        let is_like = |now: &GrayImage| first.is_like(now, &lens()).unwrap();
        for factor in [0.35, 0.6, 0.8, 1.0, 1.3] {
            assert!(is_like(&picture(0.0, |_| factor, 2)), "{factor}");
            assert!(is_like(&picture(0.0, |u| if u < 160 { 0.55 * factor } else { factor }, 3)), "{factor}");
        }
        // What a turn of a third of a degree and of two degrees moves is no light.
        for turned_deg in [0.33_f64, 2.0] {
            let moved_px = lens().fx * turned_deg.to_radians().tan();
            for factor in [0.6, 1.0, 1.3] {
                assert!(!is_like(&picture(moved_px, |_| factor, 4)), "{turned_deg}° at {factor}");
            }
        }
    }
}
