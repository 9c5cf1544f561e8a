//! Feature tracks over a capture: KLT, each feature re-registered against its first appearance.
//!
//! A frame's points are predicted in the next by the camera's rotation ([`turn`]), followed by pyramidal Lucas–Kanade
//! (C. Tomasi and T. Kanade, "Detection and tracking of point features", 1991; corners after J. Shi and C. Tomasi,
//! "Good features to track", CVPR 1994), and checked by following them back. Lucas–Kanade from frame to frame drifts;
//! so each point then is registered ([`register`]) against the patch of its first appearance, which also detects when
//! it shows something else. Lost features are replaced, spread over the image, so tracks come and go.

mod filmed_size;
mod intensity;
mod probe;
mod register;
pub(crate) mod revisit;
mod turn;

use calib::Intrinsics;
use calib::vision::flow::{self, FlowPyramid};
use image::RgbImage;
use nalgebra::{Matrix2, Point2, UnitQuaternion};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::Result;
pub(crate) use filmed_size::FilmedPatch;
pub(crate) use intensity::Intensity;
pub(crate) use register::{Patch, Reading, Warp};
use turn::CoarseScales;

/// Options of feature detection and tracking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureOptions {
    /// Number of features followed at a time.
    pub count: usize,
    /// Number of cells along the longer image side over which they are spread.
    pub grid: usize,
    /// Least distance between features, pixels.
    pub min_distance_px: f64,
    /// Half the side of a feature's patch, less half a pixel.
    pub patch_radius_px: i32,
    /// Side of the Lucas–Kanade window, pixels.
    pub window_px: u32,
    /// Number of times that Lucas–Kanade halves the image.
    pub pyramid_depth: u32,
    /// Largest distance of a feature from its start when it is followed backwards, pixels.
    pub max_return_px: f64,
    /// Largest distance between the results of Lucas–Kanade and of registration, pixels.
    pub max_disagreement_px: f64,
    /// Least correlation with a feature's first appearance.
    pub min_correlation: f64,
    /// Quality of a corner, as a fraction of the strongest, below which it is no feature.
    pub corner_quality: f64,
}

impl Default for FeatureOptions {
    fn default() -> Self {
        Self {
            count: 700,
            grid: 16,
            min_distance_px: 8.0,
            patch_radius_px: 8,
            window_px: 21,
            pyramid_depth: 4,
            max_return_px: 1.0,
            max_disagreement_px: 2.0,
            min_correlation: 0.8,
            corner_quality: 0.0005,
        }
    }
}

/// Observations of one feature: frames (from 0, rising, with gaps perhaps) and pixels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FeatureTrack {
    /// One entry a frame that observed the feature.
    pub observations: Vec<(usize, Point2<f64>)>,
}

/// Report of feature tracking.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FeatureReport {
    /// Number of tracks of two frames or more.
    pub tracks: usize,
    /// Number of observations of all tracks.
    pub observations: usize,
    /// Number of features carried from each frame to the next; one entry fewer than frames.
    pub carried: Vec<usize>,
}

/// One feature being followed.
struct Feature {
    track: usize,
    patch: Patch,
    warp: Warp,
}

/// Follows features through the frames; `intrinsics` need only be roughly right.
///
/// # Errors
/// [`crate::error::Error::Calib`] when OpenCV refuses.
pub fn track(
    frames: &[RgbImage],
    intrinsics: &Intrinsics,
    options: &FeatureOptions,
) -> Result<(Vec<FeatureTrack>, FeatureReport)> {
    let mut tracks: Vec<FeatureTrack> = Vec::new();
    let mut report = FeatureReport::default();
    let mut live: Vec<Feature> = Vec::new();
    let mut before: Option<FrameImages> = None;
    for (frame, image) in frames.iter().enumerate() {
        let seen = FrameImages::new(image, intrinsics, options)?;
        if let Some(before) = &before {
            live = carry(live, before, &seen, intrinsics, options)?;
            report.carried.push(live.len());
        }
        let born = births(&seen, &live, options)?;
        live.extend(born.into_iter().map(|(patch, warp)| {
            tracks.push(FeatureTrack::default());
            Feature { track: tracks.len() - 1, patch, warp }
        }));
        for feature in &live {
            tracks[feature.track].observations.push((frame, feature.warp.center));
        }
        before = Some(seen);
    }
    tracks.retain(|t| t.observations.len() >= 2);
    report.tracks = tracks.len();
    report.observations = tracks.iter().map(|t| t.observations.len()).sum();
    Ok((tracks, report))
}

/// A frame in the forms that tracking reads.
struct FrameImages {
    gray: image::GrayImage,
    intensity: Intensity,
    pyramid: FlowPyramid,
    coarse: CoarseScales,
}

impl FrameImages {
    fn new(image: &RgbImage, intrinsics: &Intrinsics, options: &FeatureOptions) -> Result<Self> {
        let gray = image::imageops::grayscale(image);
        let intensity = Intensity::new(image);
        let pyramid = FlowPyramid::new(&gray, options.window_px, options.pyramid_depth)?;
        let coarse = CoarseScales::new(&intensity, intrinsics);
        Ok(Self { gray, intensity, pyramid, coarse })
    }
}

/// Carries features from one frame to the next; lost ones end.
///
/// The turn is estimated from the whole picture, so a near object that covers most of it, and moves in it otherwise than the room,
/// makes it wrong. Where most features are lost they are therefore also looked for at their old pixels.
fn carry(
    live: Vec<Feature>,
    from: &FrameImages,
    to: &FrameImages,
    intrinsics: &Intrinsics,
    options: &FeatureOptions,
) -> Result<Vec<Feature>> {
    let turn = from.coarse.turn_to(&to.coarse);
    let turned = carried(&live, &guesses(&live, intrinsics, &turn), from, to, options)?;
    let count = |found: &[Option<Warp>]| found.iter().flatten().count();
    let found = if 2 * count(&turned) >= live.len() {
        turned
    } else {
        let resting: Vec<Warp> = live.iter().map(|feature| feature.warp).collect();
        let rested = carried(&live, &resting, from, to, options)?;
        if count(&rested) > count(&turned) { rested } else { turned }
    };
    let moved = |(feature, warp): (Feature, Option<Warp>)| Some(Feature { warp: warp?, ..feature });
    Ok(live.into_iter().zip(found).filter_map(moved).collect())
}

/// The features' warps after a turn of the camera.
fn guesses(live: &[Feature], intrinsics: &Intrinsics, turn: &UnitQuaternion<f64>) -> Vec<Warp> {
    let carried_by_turn = |p: &Point2<f64>| turn::moved(p, intrinsics, turn);
    let guess = |feature: &Feature| {
        let warp = feature.warp;
        let near = |dx, dy| carried_by_turn(&(warp.center + nalgebra::Vector2::new(dx, dy)));
        match (near(0.0, 0.0), near(1.0, 0.0), near(0.0, 1.0)) {
            (Some(center), Some(right), Some(below)) => {
                let local = Matrix2::from_columns(&[right - center, below - center]);
                Warp { center, affine: local * warp.affine }
            }
            _ => warp,
        }
    };
    live.iter().map(guess).collect()
}

/// The features' warps in the next frame, looked for from guesses of them; `None` for lost ones.
fn carried(
    live: &[Feature],
    guesses: &[Warp],
    from: &FrameImages,
    to: &FrameImages,
    options: &FeatureOptions,
) -> Result<Vec<Option<Warp>>> {
    let starts: Vec<Point2<f64>> = live.iter().map(|f| f.warp.center).collect();
    let aims: Vec<Point2<f64>> = guesses.iter().map(|g| g.center).collect();
    let ends = flow::follow(&from.pyramid, &to.pyramid, &starts, &aims)?;
    let reached: Vec<Point2<f64>> = ends.iter().zip(&aims).map(|(end, aim)| end.unwrap_or(*aim)).collect();
    let back = flow::follow(&to.pyramid, &from.pyramid, &reached, &starts)?;
    let returned = |index: usize| {
        ends[index].is_some()
            && back[index].is_some_and(|p| (p - starts[index]).norm() <= options.max_return_px)
    };
    let found = live.par_iter().zip(guesses).enumerate().map(|(index, (feature, guess))| {
        let start = Warp { center: reached[index], affine: guess.affine };
        let found = returned(index).then(|| feature.patch.register(&to.intensity, &start))??;
        let agrees = (found.warp.center - reached[index]).norm() <= options.max_disagreement_px;
        (agrees && found.correlation >= options.min_correlation).then_some(found.warp)
    });
    Ok(found.collect())
}

/// New features at corners without a feature, spread over a grid.
fn births(seen: &FrameImages, live: &[Feature], options: &FeatureOptions) -> Result<Vec<(Patch, Warp)>> {
    let (width, height) = (seen.intensity.width, seen.intensity.height);
    let cell = (width.max(height) as f64 / options.grid as f64).max(1.0);
    let (columns, rows) = ((width as f64 / cell).ceil() as usize, (height as f64 / cell).ceil() as usize);
    let quota = options.count.div_ceil((columns * rows).max(1)).max(1);
    let cell_of = |p: &Point2<f64>| {
        ((p.y / cell) as usize).min(rows - 1) * columns + ((p.x / cell) as usize).min(columns - 1)
    };
    let mut members: Vec<Vec<Point2<f64>>> = vec![Vec::new(); columns * rows];
    for feature in live {
        members[cell_of(&feature.warp.center)].push(feature.warp.center);
    }
    let corners = flow::corners(
        &seen.gray,
        8 * options.count,
        options.corner_quality,
        0.5 * options.min_distance_px,
        5,
    )?;
    let mut born = Vec::new();
    // First every cell gets its share; then the others may hold more, since plain walls leave cells empty.
    for share in [quota, 3 * quota] {
        for corner in &corners {
            let home = cell_of(corner);
            if live.len() + born.len() >= options.count || members[home].len() >= share {
                continue;
            }
            if members.iter().flatten().any(|p| (p - corner).norm() < options.min_distance_px) {
                continue;
            }
            let warp = Warp { center: *corner, affine: Matrix2::identity() };
            if let Some(patch) = Patch::cut(&seen.intensity, &warp, options.patch_radius_px) {
                members[home].push(*corner);
                born.push((patch, warp));
            }
        }
    }
    Ok(born)
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    const SIZE: (u32, u32) = (320, 240);
    /// Motion of the wall between two frames, pixels.
    const MOVED: (f64, f64) = (-7.0, 2.0);

    /// A light wall with spots of many sizes, moved, behind a dark board that covers all right of a slanted line.
    fn frame(moved: (f64, f64), board_from: f64) -> RgbImage {
        let spots = |x: f64, y: f64| -> f64 {
            let wave = |k: f64, turn: f64| (k * (x * turn.cos() + y * turn.sin()) + 7.0 * turn).sin();
            (0..12).map(|i| wave(0.05 + 0.045 * f64::from(i), 2.4 * f64::from(i))).sum()
        };
        RgbImage::from_fn(SIZE.0, SIZE.1, |u, v| {
            let (x, y) = (f64::from(u), f64::from(v));
            let level = if x > board_from - 0.4 * y {
                30.0 + 2.0 * (0.3 * y).sin()
            } else {
                170.0 + 12.0 * spots(x - moved.0, y - moved.1)
            };
            Rgb([level.clamp(0.0, 255.0) as u8; 3])
        })
    }

    #[test]
    fn a_wall_is_followed_when_something_near_comes_before_it() {
        let frames = [frame((0.0, 0.0), 310.0), frame(MOVED, 215.0)];
        let lens = Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 70.0);
        let (tracks, _) = track(&frames, &lens, &FeatureOptions::default()).unwrap();
        let seen_still = |p: &Point2<f64>| p.x > 20.0 && p.x < 195.0 - 0.4 * p.y;
        let first =
            |track: &&FeatureTrack| track.observations[0].0 == 0 && seen_still(&track.observations[0].1);
        let followed: Vec<_> = tracks.iter().filter(first).collect();
        let is_right = |track: &&&FeatureTrack| {
            let moved = track.observations[1].1 - track.observations[0].1;
            (moved - nalgebra::Vector2::new(MOVED.0, MOVED.1)).norm() < 0.2
        };
        let right = followed.iter().filter(is_right).count();
        assert!(right > 60 && 20 * right > 19 * followed.len(), "{right} of {} right", followed.len());
    }
}
