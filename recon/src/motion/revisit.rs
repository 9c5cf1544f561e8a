//! Search for lost features at their predictions by a first reconstruction ([`crate::features::revisit`]), and the
//! adjustment that includes them.
//!
//! Tracks alone tie each frame to its neighbours, so errors add up along the path; a feature that is found again ties
//! frames that are far apart in time, under wider angles. The better the reconstruction, the more of them are found,
//! and the smaller the search radius can be: so the search is repeated.

use calib::least_squares::Loss;
use image::RgbImage;
use nalgebra::{Isometry3, Matrix2, Point2, Point3, Vector2, Vector3};
use rayon::prelude::*;

use super::partial_reconstruction::{Adjustment, PartialReconstruction, passing};
use super::triangulation::TriangulationLimits;
use crate::bundle::LensFreedom;
use crate::features::revisit::{RevisitOptions, seen_again};
use crate::features::{FeatureOptions, FeatureTrack, Intensity, Warp};

/// Search radius around a feature's prediction, round after round, pixels.
const SEARCH_PX: [i32; 2] = [12, 6];
/// Least correlation with a feature's first appearance: more than for following, as the position is less certain.
const MIN_CORRELATION: f64 = 0.85;
/// Least difference in correlation to all other places nearby.
const MIN_LEAD: f32 = 0.05;
/// Largest angle between the directions of two views of a patch, degrees; beyond it the patch looks different.
const WIDEST_DEG: f64 = 35.0;
/// Largest error of an observation, and the scale of the loss, in the first adjustments, pixels: wide, as the new
/// observations contradict the reconstruction that found them.
const TAKING_IN_PX: [(f64, f64); 2] = [(12.0, 4.0), (8.0, 2.0)];

/// Completes the reconstruction's tracks and adjusts it, until little more is found.
pub(super) fn revisit(
    partial: &mut PartialReconstruction<'_>,
    frames: &[RgbImage],
    options: &FeatureOptions,
    lens: LensFreedom,
) {
    let images: Vec<Intensity> = frames.par_iter().map(Intensity::new).collect();
    for search_px in SEARCH_PX {
        let how = RevisitOptions { search_px, min_correlation: MIN_CORRELATION, min_lead: MIN_LEAD };
        let predict = |track, frame| predicted(partial, track, frame);
        let tracks: Vec<FeatureTrack> = seen_again(&images, &partial.tracks, predict, &how, options);
        partial.tracks = tracks.into();
        for (max_error_px, scale_px) in TAKING_IN_PX {
            let accept =
                TriangulationLimits { max_error_px, min_angle: 0.5_f64.to_radians(), min_sightings: 3 };
            let loss = Loss::Cauchy(scale_px);
            let solver = passing(20);
            partial.adjust(&Adjustment { gate_px: 2.0 * max_error_px, loss, lens, solver });
            partial.triangulate(&accept, false);
        }
    }
}

/// Predicted warp of a track's first patch in a frame that views it from about the same direction.
fn predicted(partial: &PartialReconstruction<'_>, track: usize, frame: usize) -> Option<Warp> {
    let point = partial.points[track]?;
    let (first, _) = *partial.tracks[track].observations.first()?;
    let ray = |pose: &Isometry3<f64>| -> Vector3<f64> { point - pose.inverse() * Point3::origin() };
    let (from, to) = (partial.poses[first]?, partial.poses[frame]?);
    let is_alike = ray(&from).angle(&ray(&to)) <= WIDEST_DEG.to_radians();
    if is_alike { carried_patch(partial, track, 0, frame) } else { None }
}

/// Predicted warp, in a frame, of the patch of a track's observation with an index, taken as a piece of plane that faces its
/// camera.
pub(super) fn carried_patch(
    partial: &PartialReconstruction<'_>,
    track: usize,
    cut_at: usize,
    frame: usize,
) -> Option<Warp> {
    let point = partial.points[track]?;
    let (first, home) = *partial.tracks[track].observations.get(cut_at)?;
    let (from, to) = (partial.poses[first]?, partial.poses[frame]?);
    let depth = (from * point).z;
    if depth <= 0.0 {
        return None;
    }
    let center = partial.intrinsics.project(&(to * point))?;
    if !partial.intrinsics.contains(&center) {
        return None;
    }
    let to_from_from = to * from.inverse();
    let carried = |pixel: &Point2<f64>| {
        let ray = partial.intrinsics.unproject(pixel)?;
        partial.intrinsics.project(&(to_from_from * Point3::from(ray * depth)))
    };
    let at = carried(&home)?;
    let right = carried(&(home + Vector2::x()))? - at;
    let below = carried(&(home + Vector2::y()))? - at;
    Some(Warp { center, affine: Matrix2::from_columns(&[right, below]) })
}
