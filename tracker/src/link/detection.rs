//! What is linked: a person seen in a frame, as a box in an image or as a place on the floor.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::Point2;

use crate::identity::appearance::Histogram;
use crate::tracks::rows::{PixelBox, Row, RowFile};
use crate::{Error, Result};

/// What stands for a box's height where there are floor positions: distances are then measured in people's heights, too.
const PERSON_HEIGHT_M: f64 = 1.75;

/// One detection.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Frame, from 1.
    pub frame: u32,
    /// The box's centre in pixels, or the place on the floor in metres.
    pub place: Point2<f64>,
    /// The box, where there is one.
    pub pixel_box: Option<PixelBox>,
    /// How sure the detector is; more is surer.
    pub score: f64,
    /// The track of the online tracker that it belongs to, where tracklets are linked.
    pub tracklet: Option<u32>,
    /// The colours of the box's middle, where a video tells them.
    pub colours: Option<Arc<Histogram>>,
}

/// Hellinger distance of two detections' colours: √(1 − their Bhattacharyya coefficient).
pub(super) fn colour_distance(a: &Detection, b: &Detection) -> Option<f64> {
    a.colours.as_ref().zip(b.colours.as_ref()).map(|(a, b)| a.distance(b))
}

impl Detection {
    /// The length that distances are measured in: the box's height in pixels, or a person's height in metres.
    pub fn scale(&self) -> f64 {
        self.pixel_box.map_or(PERSON_HEIGHT_M, |b| b.height)
    }

    /// Area of the box, square pixels; 0 on the floor.
    pub fn area(&self) -> f64 {
        self.pixel_box.map_or(0.0, |b| b.width * b.height)
    }
}

/// Detections of a recording, by frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detections {
    /// In time order; within a frame in the order of the file.
    pub all: Vec<Detection>,
    /// Whether these are places on the floor rather than boxes.
    pub on_floor: bool,
}

impl Detections {
    /// Takes the detections out of a file of rows: those that are wanted.
    ///
    /// # Errors
    /// A file in which some rows are boxes and some floor positions.
    pub fn from_rows(file: &RowFile, is_wanted: impl Fn(&Row) -> bool) -> Result<Self> {
        let on_floor = !file.has_boxes();
        if on_floor && let Some(row) = file.rows.iter().find(|r| r.position.is_none()) {
            return Err(Error::content(
                &file.path,
                format!("line {}", row.line),
                "is a box where other rows are floor positions; link them from two files",
            ));
        }
        let mut all: Vec<Detection> = file
            .rows
            .iter()
            .filter(|row| is_wanted(row))
            .map(|row| {
                let pixel_box = row.pixel_box.filter(|_| !on_floor);
                let middle = |b: PixelBox| Point2::new(b.left + 0.5 * b.width, b.top + 0.5 * b.height);
                Detection {
                    frame: row.frame,
                    place: pixel_box.map(middle).or(row.position).unwrap_or_else(Point2::origin),
                    pixel_box,
                    score: row.confidence,
                    tracklet: row.id,
                    colours: None,
                }
            })
            .collect();
        all.sort_by_key(|d| d.frame);
        Ok(Self { all, on_floor })
    }

    /// The same with scores from 0 to 1, where they are not so already: margins of a classifier, which are 0 where a person is
    /// as likely as none, are taken as log-odds.
    pub fn with_probabilities(&self) -> Cow<'_, Self> {
        if self.all.iter().all(|d| (0.0..=1.0).contains(&d.score)) {
            return Cow::Borrowed(self);
        }
        let mut sure = self.clone();
        for detection in &mut sure.all {
            detection.score = 1.0 / (1.0 + (-detection.score).exp());
        }
        Cow::Owned(sure)
    }

    /// Where each frame's detections begin and end: (frame, range), frames with detections only, in order.
    pub fn frames(&self) -> Vec<(u32, std::ops::Range<usize>)> {
        let mut frames: Vec<(u32, std::ops::Range<usize>)> = Vec::new();
        for (index, detection) in self.all.iter().enumerate() {
            match frames.last_mut() {
                Some((frame, range)) if *frame == detection.frame => range.end = index + 1,
                _ => frames.push((detection.frame, index..index + 1)),
            }
        }
        frames
    }
}
