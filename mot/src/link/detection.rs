//! Input of linking: detections of people in a frame, as boxes in an image or as floor positions.

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::Point2;

use crate::histogram::Histogram;
use crate::rows::{PixelBox, Row, RowFile};
use crate::{Error, Result};

/// Height that replaces a box's for floor positions, metres, so that distances are measured in people's heights there,
/// too.
const PERSON_HEIGHT_M: f64 = 1.75;

/// A detection of a person in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Frame, from 1.
    pub frame: u32,
    /// Centre of the box, pixels, or position on the floor, metres.
    pub place: Point2<f64>,
    /// Box; `None` for a floor position.
    pub pixel_box: Option<PixelBox>,
    /// Score of the detector; higher is more certain.
    pub score: f64,
    /// Id of the online tracker's track, where tracklets are linked.
    pub tracklet: Option<u32>,
    /// Colours of the box's middle, where a video is given.
    pub colours: Option<Arc<Histogram>>,
}

/// Hellinger distance of two detections' colours: √(1 − their Bhattacharyya coefficient).
pub(super) fn colour_distance(a: &Detection, b: &Detection) -> Option<f64> {
    a.colours.as_ref().zip(b.colours.as_ref()).map(|(a, b)| a.distance(b))
}

impl Detection {
    /// Unit of distances: height of the box, pixels, or of a person, metres.
    pub fn scale(&self) -> f64 {
        self.pixel_box.map_or(PERSON_HEIGHT_M, |b| b.height)
    }

    /// Area of the box, square pixels; 0 for a floor position.
    pub fn area(&self) -> f64 {
        self.pixel_box.map_or(0.0, |b| b.width * b.height)
    }
}

/// Detections of a recording, ordered by frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Detections {
    /// Detections in time order; within a frame in the order of the file.
    pub all: Vec<Detection>,
    /// Whether these are floor positions rather than boxes.
    pub on_floor: bool,
}

impl Detections {
    /// Selects the wanted detections of a file of rows.
    ///
    /// # Errors
    /// A file with both boxes and floor positions.
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

    /// Copy with scores from 0 to 1, unless they are so already: margins of a classifier, for which 0 means even odds,
    /// are taken as log-odds.
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

    /// Range of each frame's detections: (frame, range) for frames with detections, in order.
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
