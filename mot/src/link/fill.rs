//! Rows of a track file from linked detections: gaps are filled, boxes are smoothed.

use nalgebra::Point2;

use super::detection::Detections;
use crate::rows::PixelBox;

/// Longest gap that is filled, frames: over an hour. Rows of a longer one would be invented, and fill the memory.
const LONGEST_GAP: u32 = 100_000;

/// A row of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackRow {
    /// Frame, from 1.
    pub frame: u32,
    /// Box in the image, where boxes were linked.
    pub pixel_box: Option<PixelBox>,
    /// Centre of the box, or position on the floor.
    pub place: Point2<f64>,
    /// Score of the detection; for a filled row the mean of its neighbours'.
    pub score: f64,
    /// Whether the row is a detection rather than filled in.
    pub is_seen: bool,
}

/// Options of the post-processing of tracks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillOptions {
    /// Whether frames between two detections of a track are filled.
    pub interpolate: bool,
    /// Standard deviation of the Gaussian that smooths boxes, frames; 0 does not smooth.
    pub smooth_frames: f64,
}

/// Rows of a track over detections.
pub fn rows(detections: &Detections, track: &[u32], options: &FillOptions) -> Vec<TrackRow> {
    let seen = |node: u32| {
        let d = &detections.all[node as usize];
        TrackRow { frame: d.frame, pixel_box: d.pixel_box, place: d.place, score: d.score, is_seen: true }
    };
    let observed: Vec<TrackRow> = track.iter().map(|n| seen(*n)).collect();
    let observed =
        if options.smooth_frames > 0.0 { smoothed(&observed, options.smooth_frames) } else { observed };
    let mut rows = Vec::with_capacity(observed.len());
    for (index, row) in observed.iter().enumerate() {
        if options.interpolate && index > 0 {
            fill(&observed[index - 1], row, &mut rows);
        }
        rows.push(*row);
    }
    rows
}

/// Adds the frames between two rows by linear interpolation; none in a gap of more than [`LONGEST_GAP`] frames.
fn fill(before: &TrackRow, after: &TrackRow, rows: &mut Vec<TrackRow>) {
    if after.frame - before.frame > LONGEST_GAP {
        return;
    }
    let gap = f64::from(after.frame - before.frame);
    for frame in before.frame + 1..after.frame {
        let t = f64::from(frame - before.frame) / gap;
        rows.push(TrackRow {
            frame,
            pixel_box: before.pixel_box.zip(after.pixel_box).map(|(a, b)| between(&a, &b, t)),
            place: before.place + (after.place - before.place) * t,
            score: 0.5 * (before.score + after.score),
            is_seen: false,
        });
    }
}

fn between(a: &PixelBox, b: &PixelBox, t: f64) -> PixelBox {
    let mix = |a: f64, b: f64| a + (b - a) * t;
    PixelBox {
        left: mix(a.left, b.left),
        top: mix(a.top, b.top),
        width: mix(a.width, b.width),
        height: mix(a.height, b.height),
    }
}

/// Smooths each row by a local straight line through its neighbours, weighted by a Gaussian of their time: follows a
/// steady walk without lag, also at a track's ends.
fn smoothed(rows: &[TrackRow], sigma_frames: f64) -> Vec<TrackRow> {
    let reach = (3.0 * sigma_frames).ceil() as u32;
    let mut first = 0;
    let mut smooth = Vec::with_capacity(rows.len());
    for row in rows {
        while rows[first].frame + reach < row.frame {
            first += 1;
        }
        let near: Vec<(f64, f64, &TrackRow)> = rows[first..]
            .iter()
            .take_while(|r| r.frame <= row.frame + reach)
            .map(|r| {
                let t = f64::from(r.frame) - f64::from(row.frame);
                ((-0.5 * (t / sigma_frames).powi(2)).exp(), t, r)
            })
            .collect();
        let line = |value: &dyn Fn(&TrackRow) -> f64| straight(&near, value);
        let pixel_box = row.pixel_box.map(|_| {
            let of =
                |part: fn(&PixelBox) -> f64| line(&|r: &TrackRow| r.pixel_box.as_ref().map_or(0.0, part));
            let (width, height) = (of(|b| b.width.ln()).exp(), of(|b| b.height.ln()).exp());
            let (x, y) = (of(|b| b.left + 0.5 * b.width), of(|b| b.top + 0.5 * b.height));
            PixelBox { left: x - 0.5 * width, top: y - 0.5 * height, width, height }
        });
        let place = Point2::new(line(&|r| r.place.x), line(&|r| r.place.y));
        smooth.push(TrackRow { pixel_box, place, ..*row });
    }
    smooth
}

/// Value at time 0 of the weighted least-squares line.
fn straight(near: &[(f64, f64, &TrackRow)], value: &dyn Fn(&TrackRow) -> f64) -> f64 {
    let (mut w, mut wt, mut wtt, mut wv, mut wtv) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (weight, t, row) in near {
        let v = value(row);
        w += weight;
        wt += weight * t;
        wtt += weight * t * t;
        wv += weight * v;
        wtv += weight * t * v;
    }
    let determinant = w * wtt - wt * wt;
    if determinant > 1e-9 * w * w { (wtt * wv - wt * wtv) / determinant } else { wv / w }
}
