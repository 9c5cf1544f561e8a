//! Events against the truth: true paths, the events that they make, tracks with a tracker's errors, and scores.
//!
//! * [`TruePath`] — a person's path; [`truth::true_events`] — the events of the paths.
//! * [`places::marked`] — regions and lines in a room.
//! * [`noise`] — the lines of `tracks.jsonl` that a tracker with known errors would write of the paths.
//! * [`score`] — precision, recall and errors of events.

pub mod noise;
pub mod places;
pub mod score;
pub mod truth;

use mot::rows::RowFile;
use nalgebra::Point2;
use synthetic::{SyntheticRoom, Walker};

/// A person's true path while they are in the room.
#[derive(Debug, Clone, PartialEq)]
pub struct TruePath {
    /// The person, from 1.
    pub id: u32,
    /// Times, seconds, and positions, metres; in order of time.
    pub samples: Vec<(f64, Point2<f64>)>,
}

impl TruePath {
    /// Path of a walker within the walls, at 100 samples a second, `later_s` later.
    pub fn of_walker(walker: &Walker, room: &SyntheticRoom, id: u32, later_s: f64) -> Self {
        const STEP_S: f64 = 0.01;
        let (first_s, last_s) = walker.span_s();
        let steps = ((last_s - first_s) / STEP_S) as u32;
        let times = (0..=steps).map(|i| first_s + f64::from(i) * STEP_S);
        let samples = times.filter_map(|t| Some((t + later_s, walker.place(t)?)));
        Self { id, samples: samples.filter(|(_, place)| room.is_inside(place)).collect() }
    }

    /// Paths of a truth file, whose frames are `1 / rate_hz` apart.
    pub fn of_rows(rows: &RowFile, rate_hz: f64) -> Vec<Self> {
        let mut paths: Vec<Self> = Vec::new();
        for row in &rows.rows {
            let (Some(id), Some(place)) = (row.id, row.position) else { continue };
            let sample = (f64::from(row.frame - 1) / rate_hz, place);
            match paths.iter_mut().find(|path| path.id == id) {
                Some(path) => path.samples.push(sample),
                None => paths.push(Self { id, samples: vec![sample] }),
            }
        }
        paths
    }

    /// Position at a time, interpolated; `None` before and after the path.
    pub fn at(&self, time_s: f64) -> Option<Point2<f64>> {
        let next = self.samples.partition_point(|(t, _)| *t < time_s);
        let (t1, b) = *self.samples.get(next)?;
        if t1 <= time_s {
            return Some(b);
        }
        let (t0, a) = *self.samples.get(next.checked_sub(1)?)?;
        Some(a + (b - a) * ((time_s - t0) / (t1 - t0)))
    }

    /// First and last time, seconds.
    pub fn span_s(&self) -> (f64, f64) {
        let time = |sample: Option<&(f64, Point2<f64>)>| sample.map_or(f64::NAN, |(t, _)| *t);
        (time(self.samples.first()), time(self.samples.last()))
    }
}
