//! Guided matching under a known similarity between two cameras' spaces: each corner of either picture is searched
//! around the projection of its surface point in the other.

use calib::absolute_orientation;
use calib::vision::flow;
use nalgebra::{Matrix2, Point2, Point3, Similarity3, Vector2};
use rayon::prelude::*;

use super::ProposalOptions;
use super::alignment::miss_px;
use super::evidence::{ComparedView, carried};
use super::landmarks::Landmark;
use crate::Result;
use crate::features::{Patch, Reading, Warp};
use crate::surface::Surface;

/// Number of corners, their least strength as a share of the strongest, and the least distance between them.
const CORNERS: usize = 3000;
const QUALITY: f64 = 0.0005;
const APART_PX: f64 = 7.0;
const BLOCK_PX: u32 = 5;
/// Largest relative difference in depth of coinciding surfaces.
const SAME: f64 = 0.06;
/// Least share of known depths, and of these on one plane, of a continuous patch, and the tolerance for the latter.
const LEAST_WHOLE: f64 = 0.7;
const WHOLE: f32 = 0.03;
/// Largest distance from its start of a match followed back.
const RETURN_PX: f64 = 1.0;
/// Difference in correlation below which another match is ambiguous, and distance from which on it is another one.
const LEAST_LEAD: f64 = 0.02;
const ELSEWHERE_PX: f64 = 3.0;
/// Number of rounds of matching, each with a similarity refitted to the matches before.
const ROUNDS: usize = 3;
/// Factor over the median error beyond which a match is an outlier …
const OUTLYING: f64 = 3.0;
/// … and least error for that threshold.
const EXACT_PX: f64 = 0.01;

/// A subpixel match: both pixels, and the correlation of the pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GuidedMatch {
    pub(super) pixels: [Point2<f64>; 2],
    pub(super) positions: [Point3<f64>; 2],
    pub(super) correlation: f64,
    /// Distance from its prediction by the similarity and the other camera's depth, pixels.
    pub(super) off_px: f64,
}

impl GuidedMatch {
    /// The same match with the cameras exchanged.
    fn swapped(mut self) -> Self {
        self.pixels.reverse();
        self.positions.reverse();
        self
    }
}

/// All matches guided by a similarity, and the similarity refitted to them.
///
/// # Errors
/// [`crate::error::Error::Calib`] when OpenCV refuses.
pub(super) fn matches(
    seen: [&ComparedView<'_>; 2],
    start: &Similarity3<f64>,
    tolerance_px: f64,
    options: &ProposalOptions,
) -> Result<(Similarity3<f64>, Vec<GuidedMatch>)> {
    let corners = |seen: &ComparedView<'_>| {
        let gray = image::imageops::grayscale(&seen.surface.picture);
        flow::corners(&gray, CORNERS, QUALITY, APART_PX, BLOCK_PX)
    };
    let corners = [corners(seen[0])?, corners(seen[1])?];
    let mut similarity = *start;
    let mut matches: Vec<GuidedMatch> = Vec::new();
    let mut reach_px = tolerance_px;
    for _ in 0..ROUNDS {
        let inverse = similarity.inverse();
        let both = [&similarity, &inverse];
        let there = |corner: &Point2<f64>| follow(seen, both, corner, reach_px, options);
        let back = |corner: &Point2<f64>| {
            follow([seen[1], seen[0]], [both[1], both[0]], corner, reach_px, options)
                .map(GuidedMatch::swapped)
        };
        matches = corners[0].par_iter().filter_map(there).collect();
        matches.par_extend(corners[1].par_iter().filter_map(back));
        let mut off: Vec<f64> = matches.iter().map(|m| m.off_px).collect();
        off.sort_by(f64::total_cmp);
        let Some(median) = off.get(off.len() / 2).map(|m| m.max(EXACT_PX)) else { break };
        reach_px = (OUTLYING * median).min(tolerance_px);
        matches.retain(|m| m.off_px <= reach_px);
        let Some(again) = refitted(seen, &similarity, &matches, median) else { break };
        similarity = again;
    }
    Ok((similarity, matches))
}

/// Searches given pixels of the first picture in the second: the index of each one found, and its pixel there.
pub(super) fn followed(
    seen: [&ComparedView<'_>; 2],
    first_from_second: &Similarity3<f64>,
    pixels: &[Point2<f64>],
    reach_px: f64,
    options: &ProposalOptions,
) -> Vec<(usize, Point2<f64>)> {
    let second_from_first = first_from_second.inverse();
    let both = [first_from_second, &second_from_first];
    let found = |(index, pixel): (usize, &Point2<f64>)| {
        let found = follow(seen, both, pixel, reach_px, options)?;
        (found.off_px <= reach_px).then_some((index, found.pixels[1]))
    };
    pixels.par_iter().enumerate().filter_map(found).collect()
}

/// Similarity fitted to the matches; matches with errors above `median_px` count less.
fn refitted(
    seen: [&ComparedView<'_>; 2],
    first_from_second: &Similarity3<f64>,
    matches: &[GuidedMatch],
    median_px: f64,
) -> Option<Similarity3<f64>> {
    // The error of either camera's depths grows with the square of the distance.
    let variance = |m: &GuidedMatch| {
        let error = |camera: usize| {
            let depth = m.positions[camera].z;
            depth * seen[camera].surface.depth_sigma(depth as f32)
        };
        error(0).powi(2) + (first_from_second.scaling() * error(1)).powi(2)
    };
    // A match with a large error may be wrong.
    let weight = |m: &GuidedMatch| 1.0 / (variance(m) * (1.0 + (m.off_px / median_px).powi(2)));
    let weights: Vec<f64> = matches.iter().map(weight).collect();
    let (a, b): (Vec<_>, Vec<_>) = matches.iter().map(|m| (m.positions[0], m.positions[1])).unzip();
    absolute_orientation::similarity_weighted(&b, &a, &weights).ok()
}

/// Searches a corner of the first picture in the second.
fn follow(
    seen: [&ComparedView<'_>; 2],
    [first_from_second, second_from_first]: [&Similarity3<f64>; 2],
    corner: &Point2<f64>,
    reach_px: f64,
    options: &ProposalOptions,
) -> Option<GuidedMatch> {
    let [here, there] = seen;
    let position = here.surface.point_at(corner).filter(|_| is_whole(here.surface, corner, options))?;
    let expected = carried(here.surface, there.surface, second_from_first, corner)?;
    // Occluded points are behind the other camera's surface.
    let meets = |surface: &Surface, pixel: &Point2<f64>, position: &Point3<f64>| {
        let seen = surface.point_at(pixel)?;
        ((position.z / seen.z - 1.0).abs() < SAME).then_some(seen)
    };
    meets(there.surface, &expected.center, &(second_from_first * position))?;
    let (pixel, correlation) = register(here, there, corner, (&expected, reach_px), options)?;
    let other = there.surface.point_at(&pixel).filter(|_| is_whole(there.surface, &pixel, options))?;
    let back = carried(there.surface, here.surface, first_from_second, &pixel)?;
    let (again, _) = register(there, here, &pixel, (&Warp { center: *corner, ..back }, 0.0), options)?;
    let pair = [Landmark { pixel: *corner, position }, Landmark { pixel, position: other }];
    let lenses = seen.map(|s| &s.surface.intrinsics);
    let off_px = miss_px(&pair, lenses, first_from_second);
    ((again - corner).norm() <= RETURN_PX).then_some(GuidedMatch {
        pixels: [*corner, pixel],
        positions: [position, other],
        correlation,
        off_px,
    })
}

/// Tells whether a patch shows one surface: an edge and the surface behind it look different from elsewhere.
fn is_whole(surface: &Surface, pixel: &Point2<f64>, options: &ProposalOptions) -> bool {
    let (width, height) = (surface.width() as i32, surface.height() as i32);
    let (x, y) = (pixel.x.round() as i32, pixel.y.round() as i32);
    let reach = options.patch_radius_px;
    if x < reach || y < reach || x >= width - reach || y >= height - reach {
        return false;
    }
    let Some(plane) = surface.support((y * width + x) as usize) else { return false };
    let around = (-reach..=reach).flat_map(|v| (-reach..=reach).map(move |u| (u, v)));
    let (mut known, mut on_plane) = (0, 0);
    for (u, v) in around {
        let depth = surface.depth[((y + v) * width + x + u) as usize];
        if depth > 0.0 {
            known += 1;
            on_plane += i32::from((depth * plane.moved(u as f32, v as f32).w - 1.0).abs() < WHOLE);
        }
    }
    let all = (2 * reach + 1).pow(2);
    f64::from(known) > LEAST_WHOLE * f64::from(all) && f64::from(on_plane) > LEAST_WHOLE * f64::from(known)
}

/// Searches the patch around a pixel of one picture in the other: exhaustively within `reach_px`, then to a fraction of
/// a pixel.
fn register(
    from: &ComparedView<'_>,
    onto: &ComparedView<'_>,
    pixel: &Point2<f64>,
    (start, reach_px): (&Warp, f64),
    options: &ProposalOptions,
) -> Option<(Point2<f64>, f64)> {
    let home = Warp { center: *pixel, affine: Matrix2::identity() };
    let patch = Patch::cut(&from.intensity, &home, options.patch_radius_px)?;
    let reach = reach_px.ceil() as i32;
    let (mut best, mut tried, mut reading) = (None, Vec::new(), Reading::default());
    for (x, y) in (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y))) {
        let shift = Vector2::new(f64::from(x), f64::from(y));
        if shift.norm() > reach_px {
            continue;
        }
        let there = Warp { center: start.center + shift, ..*start };
        let Some(correlation) = patch.correlation(&onto.intensity, &there, &mut reading) else { continue };
        tried.push((shift, correlation));
        if best.is_none_or(|(_, most)| correlation > most) {
            best = Some((shift, correlation));
        }
    }
    let (shift, most) = best?;
    let elsewhere = tried.iter().filter(|(s, _)| (s - shift).norm() > ELSEWHERE_PX);
    if elsewhere.map(|(_, c)| *c).fold(f64::NEG_INFINITY, f64::max) > most - LEAST_LEAD {
        return None;
    }
    let found = patch.register(&onto.intensity, &Warp { center: start.center + shift, ..*start })?;
    (found.correlation >= options.point_correlation).then_some((found.warp.center, found.correlation))
}
