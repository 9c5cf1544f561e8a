//! All cameras in one frame: similarities from picked points, chained over the cameras, then all captures adjusted together.
//!
//! Each camera's reconstruction has its own frame and scale. Points picked in two reference images give, with the
//! depth measured there ([`crate::ray_depth`]; where that fails, dense stereo's), two sets of 3-D points and so a
//! similarity by Horn's closed form ([`calib::absolute_orientation`]); the best-joined pairs are chained from the first
//! camera on ([`graph`]). Cameras and points then move until the picks project onto their pixels ([`refine`]), which shows the
//! picks that do not fit, and, with the surfaces' help, depths that are another surface's ([`foreign_depths`]). From there on all
//! captures are adjusted together, key frame by key frame, with the features that two cameras see ([`adjustment`]), and once more with
//! their features on the floor in one plane ([`on_floor`]).

mod adjustment;
mod foreign_depths;
mod graph;
mod on_floor;
mod refine;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point2, Point3, Similarity3};
use serde::{Deserialize, Serialize};

use crate::floor::Plane;
use crate::project::Project;
use crate::ray_depth::{MeasuredPixel, RayMeasurement};
use crate::surface::Surface;
use crate::{Error, Result};
pub use adjustment::CaptureMotion;
use adjustment::{JointBundle, SharedFeature};

/// Options of joining cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MergeOptions {
    /// Standard deviation of a pick, pixels.
    pub pick_sigma_px: f64,
    /// Standard deviation of dense stereo's depth at a pick, as a share of the depth.
    pub depth_sigma: f64,
    /// Relative error of a depth measured along a pick's ray beyond its own standard deviation: the error of the
    /// capture's motion.
    pub motion_sigma: f64,
    /// Distance from its projection after refinement beyond which a pick is an outlier, pixels.
    pub outlier_px: f64,
}

impl Default for MergeOptions {
    fn default() -> Self {
        Self { pick_sigma_px: 0.5, depth_sigma: 0.01, motion_sigma: 0.003, outlier_px: 6.0 }
    }
}

/// Report of joining cameras.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct MergeReport {
    /// Root mean square distance between the picks and the projections of their points, pixels, without outliers.
    pub pick_rms_px: f64,
    /// Outliers among the picks: number of the point (from 1), index of the camera, distance in pixels.
    pub outliers: Vec<(usize, usize, f64)>,
    /// Depths at picks that belong to another surface than the pick and are not used: number of the point (from 1), index of the
    /// camera.
    pub foreign_depths: Vec<(usize, usize)>,
    /// Distance of each pick that fits from the projection of its point: number of the point (from 1), index of the
    /// camera, pixels.
    pub misfits_px: Vec<(usize, usize, f64)>,
    /// Relative standard deviation by which the adjustment changed each camera's depths beside their scale; that of the depths at the
    /// picks where captures were not adjusted.
    pub depth_sigma: Vec<f64>,
    /// The adjustment of all captures; `None` for one camera, and for surfaces without motions.
    pub adjustment: Option<AdjustmentReport>,
}

/// Report of the adjustment of all captures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AdjustmentReport {
    /// Number of features of either camera that were found in the other's picture, for each pair of cameras whose surfaces and
    /// pictures agree enough for a search.
    pub shared_features: BTreeMap<[usize; 2], usize>,
    /// Whether it contradicts the picks; then it is not used.
    pub contradicts_picks: bool,
}

impl MergeReport {
    /// Whether a point, by its number from 1, was left out.
    pub fn is_left_out(&self, number: usize) -> bool {
        self.outliers.iter().any(|(point, ..)| *point == number)
    }
}

/// Cameras and points in the first camera's frame and scale.
#[derive(Debug, Clone)]
pub struct Merged {
    /// Similarity of each camera; the first is the identity.
    pub common_from_camera: Vec<Similarity3<f64>>,
    /// Picked points, `None` for outliers.
    pub points: Vec<Option<Point3<f64>>>,
}

impl Merged {
    /// Pose of each camera from the common frame.
    pub fn poses(&self) -> Vec<Isometry3<f64>> {
        self.common_from_camera.iter().map(camera_pose).collect()
    }

    /// Distance of a pick from the projection of its point, pixels; infinite where the point is behind the camera, `None` for a
    /// point without a place.
    fn misfit_px(&self, pick: &LiftedPick, surfaces: &[Surface]) -> Option<f64> {
        let seen = self.common_from_camera[pick.camera].inverse() * self.points[pick.point]?;
        let pixel = surfaces[pick.camera].intrinsics.project(&seen);
        Some(pixel.map_or(f64::INFINITY, |pixel| (pixel - pick.pixel).norm()))
    }
}

/// Pose of a camera in the other frame, in that frame's units: the scale only stretches the camera's space.
pub(crate) fn camera_pose(frame_from_camera: &Similarity3<f64>) -> Isometry3<f64> {
    frame_from_camera.isometry.inverse()
}

/// Joins all cameras by their picks.
///
/// # Errors
/// [`Error::File`] naming the pick that contradicts the others of a pair, or a pair without enough usable depth at
/// its picks.
pub fn merge(
    project: &Project,
    surfaces: &[Surface],
    lenses: &[calib::Intrinsics],
    measured: &[Vec<MeasuredPixel>],
    options: &MergeOptions,
) -> Result<(Merged, MergeReport)> {
    let picks = lift(project, surfaces, lenses, measured, options)?;
    tell_depths(project, &picks);
    let start = graph::chain(project, &picks, surfaces.len())?;
    let merged = refine::refine(&picks, &start, surfaces, options);
    let (merged, report) = foreign_depths::leave_out(&picks, merged, surfaces, options);
    check_pairs(project, &picks, &report)?;
    Ok((merged, report))
}

/// Captures and picks that were merged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct MergedCaptures<'a> {
    pub(crate) motions: &'a [CaptureMotion<'a>],
    pub(crate) surfaces: &'a [Surface],
    pub(crate) lenses: &'a [calib::Intrinsics],
    pub(crate) measured: &'a [Vec<MeasuredPixel>],
}

/// Cameras whose captures were adjusted together.
pub(crate) struct AdjustedCaptures<'a> {
    bundle: JointBundle<'a>,
    surfaces: &'a [Surface],
    picks: Vec<LiftedPick>,
    pick_sigma_px: f64,
    pub(crate) merged: Merged,
    pub(crate) report: MergeReport,
}

/// Adjusts all captures together from where they were merged. `None` for one camera, for surfaces without motions, and where the
/// adjustment contradicts the picks, which the report then tells.
///
/// # Errors
/// [`Error::Calib`] when OpenCV refuses.
pub(crate) fn adjust<'a>(
    project: &Project,
    captures: &MergedCaptures<'a>,
    (merged, report): (&Merged, &mut MergeReport),
    options: &MergeOptions,
) -> Result<Option<AdjustedCaptures<'a>>> {
    let MergedCaptures { motions, surfaces, lenses, measured } = *captures;
    if merged.common_from_camera.len() < 2 || motions.len() < merged.common_from_camera.len() {
        return Ok(None);
    }
    let mut picks = lift(project, surfaces, lenses, measured, options)?;
    picks.retain(|pick| !report.is_left_out(pick.point + 1));
    for pick in &mut picks {
        pick.forget_foreign_depth(&report.foreign_depths);
    }
    let shared = adjustment::shared_features(motions, surfaces, &merged.common_from_camera)?;
    let shared_features = shared.iter().map(|(pair, found)| (*pair, found.len())).collect();
    let shared: Vec<SharedFeature> = shared.into_values().flatten().collect();
    let bundle = adjustment::adjust(motions, surfaces, merged, (&picks, options.pick_sigma_px), &shared);
    report.adjustment = Some(AdjustmentReport { shared_features, contradicts_picks: false });
    let pick_sigma_px = options.pick_sigma_px;
    let start = AdjustedCaptures {
        bundle,
        surfaces,
        picks,
        pick_sigma_px,
        merged: merged.clone(),
        report: report.clone(),
    };
    let adjusted = start.taken();
    if let (None, Some(told)) = (&adjusted, &mut report.adjustment) {
        told.contradicts_picks = true;
    }
    Ok(adjusted)
}

impl AdjustedCaptures<'_> {
    /// The same with the bundle's cameras. `None` where they spoil the fit of the picks.
    fn taken(self) -> Option<Self> {
        let adjusted = self.bundle.adjusted();
        let mut points = vec![None; self.merged.points.len()];
        for (number, place) in adjusted.picks {
            points[number] = Some(place);
        }
        let merged = Merged { common_from_camera: adjusted.common_from_camera, points };
        let misfits_px: Vec<(usize, usize, f64)> = self
            .picks
            .iter()
            .filter_map(|pick| Some((pick.point + 1, pick.camera, merged.misfit_px(pick, self.surfaces)?)))
            .collect();
        let squares: f64 = misfits_px.iter().map(|(.., off)| off * off).sum();
        let pick_rms_px = (squares / misfits_px.len().max(1) as f64).sqrt();
        if !pick_rms_px.is_finite() || spoils(pick_rms_px, self.report.pick_rms_px, self.pick_sigma_px) {
            tracing::debug!(
                "the adjustment moves the picks from {} to {pick_rms_px} px",
                self.report.pick_rms_px
            );
            return None;
        }
        let told = adjusted.depth_sigma.iter().zip(&self.report.depth_sigma);
        let depth_sigma = told.map(|(adjusted, at_picks)| adjusted.unwrap_or(*at_picks)).collect();
        let report = MergeReport { pick_rms_px, misfits_px, depth_sigma, ..self.report };
        Some(Self { merged, report, ..self })
    }

    /// Adjusts once more with the features on the floor in one plane, and returns that plane in the common frame. `None` where few
    /// are there, or where that contradicts the picks.
    pub(crate) fn on_floor(mut self, floor: &Plane) -> Option<(Self, Plane)> {
        if !self.bundle.lay_on(floor, self.surfaces) {
            return None;
        }
        let laid = self.taken()?;
        let floor = laid.bundle.floor();
        Some((laid, floor))
    }
}

/// All pairs of cameras.
pub(crate) fn pairs(cameras: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..cameras).flat_map(move |a| (a + 1..cameras).map(move |b| [a, b]))
}

/// Tells whether further constraints spoil the fit of the picks: root mean square distances with them and without them,
/// pixels. A few picks can be fitted to a tenth of a pixel by cameras that stand wrong, so the fit without them is no measure
/// below the noise of a pick: `√2 pick_sigma_px` for both of its coordinates.
fn spoils(with_px: f64, without_px: f64, pick_sigma_px: f64) -> bool {
    with_px > (1.5 * without_px + 0.5).max(std::f64::consts::SQRT_2 * pick_sigma_px)
}

/// A pick with its depth.
#[derive(Debug, Clone)]
struct LiftedPick {
    /// Index of the point in the project.
    point: usize,
    camera: usize,
    /// Pixel in the pinhole image.
    pixel: Point2<f64>,
    /// Position in the camera's frame, where its depth is known.
    seen: Option<Point3<f64>>,
    /// Depth along z and its relative standard deviation, where it is known.
    depth: Option<(f64, f64)>,
    /// Frames of its camera's capture that show it, and the pixel (as filmed) there; without the reference frame.
    frames: Vec<(usize, Point2<f64>)>,
}

fn lift(
    project: &Project,
    surfaces: &[Surface],
    lenses: &[calib::Intrinsics],
    measured: &[Vec<MeasuredPixel>],
    options: &MergeOptions,
) -> Result<Vec<LiftedPick>> {
    let mut picks = Vec::new();
    for (point, picked) in project.points.iter().enumerate() {
        for (camera, pixel) in &picked.picks {
            let pinhole = pinhole_pixel(&lenses[*camera], pixel).ok_or_else(|| {
                let place = format!("[[point]] {}, {}", point + 1, project.cameras[*camera].name);
                Error::content(&project.path, place, "the lens model gives no ray to this pixel")
            })?;
            let measurement = measured_at(&measured[*camera], pixel);
            let own = measurement.map(|own| (own.depth.depth, own.depth.sigma.hypot(options.motion_sigma)));
            let dense = || Some((surfaces[*camera].point_at(&pinhole)?.z, options.depth_sigma));
            let depth = own.or_else(dense);
            let ray = surfaces[*camera].intrinsics.unproject(&pinhole);
            let seen = depth.zip(ray).map(|((depth, _), ray)| Point3::from(ray * depth));
            let frames = measurement.map_or_else(Vec::new, |own| own.seen.clone());
            picks.push(LiftedPick { point, camera: *camera, pixel: pinhole, seen, depth, frames });
        }
    }
    Ok(picks)
}

/// Writes the depth at each pick to the log, in units of its camera, with its relative standard deviation.
fn tell_depths(project: &Project, picks: &[LiftedPick]) {
    for LiftedPick { point, camera, depth, frames, .. } in picks {
        let name = &project.cameras[*camera].name;
        let depth = depth.map_or("no depth".to_owned(), |(depth, sigma)| {
            format!("depth {depth:.4} ± {:.1} %", 100.0 * sigma)
        });
        tracing::debug!("[[point]] {}, {name}: {depth}, seen in {} more frames", point + 1, frames.len());
    }
}

/// Measured depth at exactly this pixel (as filmed).
pub(crate) fn measured_at<'a>(
    measured: &'a [MeasuredPixel],
    pixel: &Point2<f64>,
) -> Option<&'a RayMeasurement> {
    measured.iter().find(|m| m.pixel == *pixel).map(|m| &m.measured)
}

/// Converts a pixel as filmed to the pixel of the same ray in the pinhole image.
pub(crate) fn pinhole_pixel(lens: &calib::Intrinsics, pixel: &Point2<f64>) -> Option<Point2<f64>> {
    let ray = lens.unproject(pixel)?;
    lens.pinhole().project(&ray.into())
}

/// Checks that every camera keeps enough points without the outliers; otherwise the worst outlier is reported.
fn check_pairs(project: &Project, picks: &[LiftedPick], report: &MergeReport) -> Result<()> {
    let worst = report.outliers.iter().max_by(|a, b| a.2.total_cmp(&b.2));
    let Some((point, camera, off)) = worst else { return Ok(()) };
    for joined in 0..project.cameras.len() {
        let left = picks
            .iter()
            .filter(|p| p.camera == joined && !report.outliers.iter().any(|o| o.0 == p.point + 1))
            .count();
        if left < crate::project::LEAST_SHARED_POINTS {
            let place = format!("[[point]] {point}, {}", project.cameras[*camera].name);
            let problem = format!(
                "is {off:.1} pixels from where the other picks put it, and without it `{}` has only {left} points left; \
                 pick it again",
                project.cameras[joined].name
            );
            return Err(Error::content(&project.path, place, problem));
        }
    }
    Ok(())
}
