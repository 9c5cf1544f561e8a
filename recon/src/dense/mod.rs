//! Dense multi-view stereo: a depth and a normal for the reference image's pixels, where they can be estimated.
//!
//! The reference view and a few key frames of the capture ([`keyframes`]) each get a depth map by PatchMatch
//! ([`patchmatch`]) at half size, which starts from one at a quarter; the reference's is refined at full size, where those of
//! the others are known; each then checks the others ([`consistency`]). Everything is in the capture's own frame and scale: the
//! reference camera is the identity.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod consistency;
mod keyframes;
mod level;
mod ncc;
mod options;
mod patch;
mod patchmatch;
mod support;

use calib::Intrinsics;
use calib::undistort::UndistortMap;
use image::RgbImage;
use nalgebra::{Isometry3, Point3};

pub use options::DenseOptions;
pub use support::{Pinhole, Support, SupportMap};

use crate::{Error, Result};
use level::{PyramidLevel, ViewMapping};
use patchmatch::{DepthProblem, Guide, Source};

/// A capture with known motion.
#[derive(Debug, Clone, Copy)]
pub struct PosedCapture<'a> {
    /// Name of the camera, for messages.
    pub name: &'a str,
    /// Frames as filmed, distorted.
    pub frames: &'a [RgbImage],
    /// Index of the reference frame.
    pub reference: usize,
    /// Intrinsics of the frames.
    pub intrinsics: &'a Intrinsics,
    /// Pose of each frame that has one.
    pub camera_from_world: &'a [Option<Isometry3<f64>>],
    /// Sparse points, from which the range of depths is taken.
    pub points: &'a [Point3<f64>],
}

/// Stereo's result for one pose of the camera.
#[derive(Debug, Clone)]
pub struct DenseView {
    /// Undistorted (pinhole) picture.
    pub picture: RgbImage,
    /// Pinhole camera of the picture.
    pub intrinsics: Intrinsics,
    /// Pose; the identity for the reference view.
    pub camera_from_reference: Isometry3<f64>,
    /// Plane of each pixel, reliable or not.
    pub map: SupportMap,
    /// Whether the lens filmed each pixel: a distorted picture, straightened, does not fill its frame.
    pub filmed: Vec<bool>,
    /// Number of other views that agree with each pixel's depth; 0: not reliable.
    pub agreeing: Vec<u8>,
    /// Change of inverse depth that shifts a pixel by one in the farthest view: the unit of stereo's errors.
    pub step: f32,
}

impl DenseView {
    /// Depth along z at a pixel, where it is reliable.
    pub fn depth(&self, x: usize, y: usize) -> Option<f32> {
        let i = y * self.map.width + x;
        (self.agreeing[i] > 0).then(|| 1.0 / self.map.supports[i].w)
    }

    /// Camera in single precision for inner loops.
    pub fn pinhole(&self) -> Pinhole {
        let k = &self.intrinsics;
        Pinhole { fx: k.fx as f32, fy: k.fy as f32, cx: k.cx as f32, cy: k.cy as f32 }
    }
}

/// Report of dense stereo.
#[derive(Debug, Clone, PartialEq)]
pub struct DenseReport {
    /// Key frames used, as indices into the capture.
    pub key_frames: Vec<usize>,
    /// Number of the reference image's pixels that the lens filmed.
    pub filmed_pixels: usize,
    /// Share of them with a reliable depth.
    pub covered: f64,
}

/// Computes the depth maps: the reference view at full size first, then the key frames at half size.
///
/// # Errors
/// [`Error::Capture`] when no frame lies far enough from the reference, or there are too few points for a range of
/// depths.
pub fn reconstruct(
    capture: &PosedCapture<'_>,
    options: &DenseOptions,
) -> Result<(Vec<DenseView>, DenseReport)> {
    let reference_from_world = capture
        .camera_from_world
        .get(capture.reference)
        .copied()
        .flatten()
        .ok_or_else(|| Error::capture(capture.name, "the reference frame has no pose"))?;
    let to_reference = reference_from_world.inverse();
    let points: Vec<Point3<f64>> =
        capture.points.iter().map(|p| reference_from_world * p).filter(|p| p.z > 0.0).collect();
    let in_reference = keyframes::seen_by(&Isometry3::identity(), &points, capture.intrinsics);
    let frames = choose_frames(capture, &to_reference, &in_reference, options);
    if frames.is_empty() {
        return Err(Error::capture(
            capture.name,
            "no frame with a known pose lies away from the reference and looks the same way; film with the camera \
             moved sideways by a tenth of the distance to what it sees",
        ));
    }
    let undistort = UndistortMap::new(capture.intrinsics);
    let filmed = undistort.filmed();
    let pinhole = capture.intrinsics.pinhole();
    let mut views: Vec<StereoView> = Vec::with_capacity(frames.len() + 1);
    for &frame in std::iter::once(&capture.reference).chain(&frames) {
        let camera_from_reference =
            capture.camera_from_world[frame].map_or_else(Isometry3::identity, |pose| pose * to_reference);
        let picture = undistort.image(&capture.frames[frame]);
        let mut levels = vec![(PyramidLevel::new(&picture, &filmed, &pinhole), pinhole.clone())];
        for halved in 0..options.most_halvings() {
            let (level, intrinsics) = &levels[halved];
            levels.push(level.halved(intrinsics));
        }
        let range = inverse_depth_range(&points, &camera_from_reference).ok_or_else(|| {
            Error::capture(capture.name, "too few points are seen to tell the range of depths")
        })?;
        views.push(StereoView { picture, camera_from_reference, levels, range });
    }
    let maps = estimate_half(&views, options);
    let (reference_map, agreeing) = refine_reference(&views, &maps, &pinhole, options);
    let filmed_pixels = filmed.iter().filter(|filmed| **filmed).count();
    let covered = agreeing.iter().filter(|a| **a > 0).count() as f64 / filmed_pixels.max(1) as f64;

    let key_agreeing: Vec<Vec<u8>> = (1..views.len())
        .map(|i| consistency::agreeing(&problem(&views, i, 1, Some(&maps), options), &maps[i], options))
        .collect();
    let steps: Vec<f32> = (0..views.len())
        .map(|i| {
            let focal_px = if i == 0 { pinhole.fx } else { views[i].levels[1].1.fx };
            inverse_depth_step(&views, i, focal_px)
        })
        .collect();
    let mut result = Vec::with_capacity(views.len());
    let mut maps = maps.into_iter().skip(1).zip(key_agreeing);
    for (i, view) in views.into_iter().enumerate() {
        let filmed = view.levels[usize::from(i > 0)].0.filmed();
        let (map, agreeing, intrinsics, picture) = if i == 0 {
            (reference_map.clone(), agreeing.clone(), pinhole.clone(), view.picture)
        } else {
            let Some((map, agreeing)) = maps.next() else { break };
            let half = view.levels[1].1.clone();
            let (w, h) = (half.width, half.height);
            let small = image::imageops::resize(&view.picture, w, h, image::imageops::FilterType::Triangle);
            (map, agreeing, half, small)
        };
        result.push(DenseView {
            picture,
            intrinsics,
            camera_from_reference: view.camera_from_reference,
            map,
            filmed,
            agreeing,
            step: steps[i],
        });
    }
    Ok((result, DenseReport { key_frames: frames, filmed_pixels, covered }))
}

/// One view with its image pyramid.
struct StereoView {
    picture: RgbImage,
    camera_from_reference: Isometry3<f64>,
    /// Images at full size, at half of it, and so on, each with its camera.
    levels: Vec<(PyramidLevel, Intrinsics)>,
    range: (f32, f32),
}

fn choose_frames(
    capture: &PosedCapture<'_>,
    to_reference: &Isometry3<f64>,
    points: &[Point3<f64>],
    options: &DenseOptions,
) -> Vec<usize> {
    let candidates: Vec<keyframes::KeyFrameCandidate> = capture
        .camera_from_world
        .iter()
        .enumerate()
        .filter(|(frame, _)| *frame != capture.reference)
        .filter_map(|(frame, pose)| {
            let picture = capture.frames.get(frame)?;
            Some(keyframes::KeyFrameCandidate {
                frame,
                camera_from_reference: (*pose)? * to_reference,
                sharpness: sharpness(picture),
            })
        })
        .collect();
    keyframes::choose(&candidates, points, capture.intrinsics, options)
}

/// Mean absolute difference of green between horizontal neighbours.
fn sharpness(picture: &RgbImage) -> f64 {
    let mut sum = 0u64;
    for row in picture.as_raw().chunks_exact(3 * picture.width() as usize) {
        let green = row.iter().skip(1).step_by(3);
        sum += green.clone().zip(green.skip(1)).map(|(a, b)| u64::from(a.abs_diff(*b))).sum::<u64>();
    }
    sum as f64 / f64::from(picture.width() * picture.height()).max(1.0)
}

/// Inverse depths from well behind the farthest point to well before the nearest.
fn inverse_depth_range(points: &[Point3<f64>], camera_from_reference: &Isometry3<f64>) -> Option<(f32, f32)> {
    /// Least number of points from which a range is taken.
    const LEAST: usize = 8;
    let mut depths: Vec<f64> =
        points.iter().map(|p| (camera_from_reference * p).z).filter(|z| *z > 0.0).collect();
    if depths.len() < LEAST {
        return None;
    }
    depths.sort_by(f64::total_cmp);
    let at = |share: f64| depths[((depths.len() - 1) as f64 * share) as usize];
    Some(((1.0 / (1.4 * at(0.99))) as f32, (1.0 / (0.4 * at(0.01))) as f32))
}

/// Depths of all views at half size, from random hypotheses at the smallest size on.
fn estimate_half(views: &[StereoView], options: &DenseOptions) -> Vec<SupportMap> {
    let smallest = options.most_halvings();
    let estimate = |i: usize| {
        let first = problem(views, i, smallest, None, options).solve(None);
        (1..smallest).rev().fold(first, |map, halved| {
            let level = &views[i].levels[halved].0;
            let larger = map.doubled(level.width, level.height);
            problem(views, i, halved, None, options).solve(Some(larger))
        })
    };
    (0..views.len()).map(estimate).collect()
}

/// Estimation problem of one view, its image `halved` so often; `maps`: the depths of all views at that size, if known.
fn problem<'a>(
    views: &'a [StereoView],
    index: usize,
    halved: usize,
    maps: Option<&'a [SupportMap]>,
    options: &DenseOptions,
) -> DepthProblem<'a> {
    let view = &views[index];
    // Key frames are chosen farthest first, so the first few are the most informative.
    let sources = views
        .iter()
        .enumerate()
        .filter(|(i, _)| *i != index)
        .take(options.sources)
        .map(|(i, other)| {
            let forward = other.camera_from_reference * view.camera_from_reference.inverse();
            let (from, to) = (&view.levels[halved].1, &other.levels[halved].1);
            Source {
                image: &other.levels[halved].0,
                pair: ViewMapping::new(from, to, &forward),
                guide: maps.map(|maps| Guide {
                    map: &maps[i],
                    scale: 1.0,
                    back: ViewMapping::new(to, from, &forward.inverse()),
                }),
            }
        })
        .collect();
    DepthProblem {
        reference: &view.levels[halved].0,
        sources,
        range: view.range,
        step: inverse_depth_step(views, index, view.levels[halved].1.fx),
        best_views: options.best_views,
        catching_up: options.catching_up,
        color_sigma: options.color_sigma,
        is_photometric: maps.is_none(),
        iterations: options.iterations[usize::from(halved < options.most_halvings())],
        seed: options.seed.wrapping_add(index as u64),
    }
}

/// Change of inverse depth that shifts a pixel by one in the farthest view.
fn inverse_depth_step(views: &[StereoView], index: usize, focal_px: f64) -> f32 {
    let here = views[index].camera_from_reference;
    let baseline = views
        .iter()
        .map(|v| (v.camera_from_reference * here.inverse()).translation.vector.norm())
        .fold(0.0, f64::max);
    (1.0 / (focal_px * baseline).max(1e-9)) as f32
}

/// Reference's map at full size, and the number of key frames that agree with each pixel.
fn refine_reference(
    views: &[StereoView],
    maps: &[SupportMap],
    pinhole: &Intrinsics,
    options: &DenseOptions,
) -> (SupportMap, Vec<u8>) {
    let reference = &views[0];
    let sources = views[1..]
        .iter()
        .zip(&maps[1..])
        .map(|(other, map)| {
            let forward = other.camera_from_reference;
            Source {
                image: &other.levels[0].0,
                pair: ViewMapping::new(pinhole, pinhole, &forward),
                guide: Some(Guide {
                    map,
                    scale: 0.5,
                    back: ViewMapping::new(&other.levels[1].1, pinhole, &forward.inverse()),
                }),
            }
        })
        .collect();
    let problem = DepthProblem {
        reference: &reference.levels[0].0,
        sources,
        range: reference.range,
        step: inverse_depth_step(views, 0, pinhole.fx),
        best_views: options.best_views,
        catching_up: options.catching_up,
        color_sigma: options.color_sigma,
        is_photometric: false,
        iterations: options.iterations[2],
        seed: options.seed.wrapping_add(views.len() as u64),
    };
    let start = maps[0].doubled(pinhole.width as usize, pinhole.height as usize);
    let map = problem.solve(Some(start));
    let agreeing = consistency::agreeing(&problem, &map, options);
    (map, agreeing)
}

#[cfg(test)]
mod tests;
