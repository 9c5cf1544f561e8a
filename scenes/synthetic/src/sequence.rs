//! Frames of a room with people in it, rendered one at a time on request, each with its ground truth.

use std::fmt::Write as _;

use image::{GrayImage, RgbImage};
use nalgebra::{Point2, Point3};

use super::render::{RenderOptions, StaticView, finish};
use super::room::SyntheticRoom;
use super::walkers::Walker;
use scenes::depth::DepthMap;

/// Options of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct SequenceOptions {
    /// Seed of noise and flicker.
    pub seed: u64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Number of frames.
    pub frames: u32,
    /// Whether pictures are rendered, or only masks and truth.
    pub images: bool,
    /// Rendering and noise.
    pub render: RenderOptions,
}

impl Default for SequenceOptions {
    fn default() -> Self {
        Self { seed: 1, rate_hz: 12.0, frames: 240, images: true, render: RenderOptions::default() }
    }
}

/// A recording of the room by all its cameras.
pub struct Sequence<'a> {
    room: &'a SyntheticRoom,
    walkers: Vec<Walker>,
    options: SequenceOptions,
    /// Views for the pictures; empty without them.
    pictures: Vec<StaticView>,
    /// Views of one ray through each pixel's centre, for the exact truth.
    exact: Vec<StaticView>,
}

/// One moment with its ground truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Number of the frame, counted from 1.
    pub frame: u32,
    /// Time since the first frame.
    pub time_s: f64,
    /// View of each camera of the room.
    pub cameras: Vec<CameraFrame>,
    /// People present, by id; corridors behind the doors included.
    pub people: Vec<PersonTruth>,
}

/// View of one camera, in its own (distorted) pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFrame {
    /// The picture, if asked for.
    pub image: Option<RgbImage>,
    /// 255 where a person is visible at the pixel's centre, else 0.
    pub mask: GrayImage,
    /// Id of the person visible at each pixel, 0 for nobody; row by row.
    pub ids: Vec<u32>,
    /// Depth along the camera's z, people included.
    pub depth: DepthMap,
}

/// Ground truth about a person at a moment.
#[derive(Debug, Clone, PartialEq)]
pub struct PersonTruth {
    /// Id, counted from 1.
    pub id: u32,
    /// Middle of the pelvis, projected to the floor.
    pub place: Point2<f64>,
    /// Middle of the head, half-way between chin and crown.
    pub head: Point3<f64>,
    /// Standing height.
    pub height_m: f64,
    /// Whether the person is in the room, not in a corridor behind a door.
    pub inside: bool,
    /// For each camera: the share of the person's pixels within the image that neither the room nor others hide; 0 for
    /// a person outside the image.
    pub visible: Vec<f64>,
}

impl SyntheticRoom {
    /// A recording of these people by all cameras of the room.
    pub fn sequence(&self, walkers: Vec<Walker>, options: SequenceOptions) -> Sequence<'_> {
        let still = |samples: u32| -> Vec<StaticView> {
            self.room.cameras.iter().map(|c| StaticView::new(self, &c.camera, samples)).collect()
        };
        let exact = still(1);
        let pictures = match options.images {
            false => Vec::new(),
            true if options.render.samples <= 1 => exact.clone(),
            true => still(options.render.samples),
        };
        Sequence { room: self, walkers, options, pictures, exact }
    }
}

impl Sequence<'_> {
    /// All people of the sequence, present or not.
    pub fn walkers(&self) -> &[Walker] {
        &self.walkers
    }

    /// All frames in order, each rendered on request.
    pub fn frames(&self) -> impl Iterator<Item = Frame> + '_ {
        (1..=self.options.frames).map(|frame| self.frame(frame))
    }

    /// Frame of that number (from 1); also beyond the last.
    pub fn frame(&self, frame: u32) -> Frame {
        let time_s = self.time_s(frame);
        let present: Vec<&Walker> = self.walkers.iter().filter(|w| w.place(time_s).is_some()).collect();
        let mut people: Vec<PersonTruth> = present.iter().filter_map(|w| self.truth(w, time_s)).collect();
        let mut cameras = Vec::with_capacity(self.exact.len());
        for (c, exact) in self.exact.iter().enumerate() {
            let figures = |still: &StaticView| -> Vec<_> {
                present.iter().filter_map(|w| w.parts(time_s)).map(|parts| still.figure(parts)).collect()
            };
            let labels = exact.labels(&figures(exact));
            for (person, (alone, seen)) in people.iter_mut().zip(&labels.counts) {
                person.visible.push(if *alone > 0 { *seen as f64 / *alone as f64 } else { 0.0 });
            }
            let id = |owner: &u16| if *owner == 0 { 0 } else { present[usize::from(*owner) - 1].id };
            let image = self.pictures.get(c).map(|still| {
                let render = &self.options.render;
                let colors = still.with_people(&self.room.lamps, &figures(still), render.shadows);
                finish(&colors, still, self.options.seed ^ ((c as u64 + 1) << 17), u64::from(frame), render)
            });
            cameras.push(CameraFrame {
                image,
                mask: exact.mask(&labels),
                ids: labels.owners.iter().map(id).collect(),
                depth: exact.depth(&labels.distances),
            });
        }
        Frame { frame, time_s, cameras, people }
    }

    /// True tracks of the people in the room as `MOTChallenge` 3-D rows, as in `tracks.txt`.
    pub fn truth_rows(&self) -> String {
        let mut rows = String::new();
        for frame in 1..=self.options.frames {
            for walker in &self.walkers {
                if let Some(person) = self.truth(walker, self.time_s(frame)).filter(|p| p.inside) {
                    // Writing to a string cannot fail.
                    let _ = writeln!(
                        rows,
                        "{frame},{},-1,-1,-1,-1,1,{:.4},{:.4},0",
                        person.id, person.place.x, person.place.y
                    );
                }
            }
        }
        rows
    }

    fn time_s(&self, frame: u32) -> f64 {
        f64::from(frame.saturating_sub(1)) / self.options.rate_hz
    }

    /// Truth about a person without the visible shares.
    fn truth(&self, walker: &Walker, time_s: f64) -> Option<PersonTruth> {
        let place = walker.place(time_s)?;
        Some(PersonTruth {
            id: walker.id,
            place,
            head: walker.head(time_s)?,
            height_m: walker.body.height_m,
            inside: self.room.is_inside(&place),
            visible: Vec::new(),
        })
    }
}
