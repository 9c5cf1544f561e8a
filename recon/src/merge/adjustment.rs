//! One bundle adjustment of all captures: key frames, the features in them, features that two cameras see, and picks.
//!
//! A similarity a camera joins captures that are frozen. Here their key frames move one by one, with all points, so that what
//! one camera sees of another's features corrects both. All observations are pixels of one kind, a point in a key frame:
//!
//! * a feature in its own capture, as it was tracked;
//! * a feature of one capture in the reference picture of another ([`crate::proposals::found_in_both`]);
//! * a pick, where its rays meet, and as a feature of its own capture where its patch was registered in the frames
//!   ([`crate::ray_depth`]), seen in the other cameras' reference pictures as exactly as a person picks.
//!
//! Lenses differ, so pixels are carried to one pinhole by their rays, each with the standard deviation that it has there.
//! [`crate::bundle`] has the residuals, the elimination of the points, and the minimisation.

use std::collections::BTreeMap;

use calib::Intrinsics;
use calib::least_squares::Loss;
use nalgebra::{Isometry3, Point2, Point3, Similarity3, Vector2};

use super::{LiftedPick, Merged};
use crate::Result;
use crate::bundle::{BundleOptions, BundleProblem, BundleState, Observation};
use crate::motion::SparsePoint;
use crate::proposals;
use crate::surface::Surface;

/// Largest number of key frames of a capture beside its reference frame.
const KEY_FRAMES: usize = 24;
/// Least number of key frames that show a point.
const LEAST_SEEN: usize = 3;
/// Least noise of a capture's features, pixels: pictures without noise have patches that change with the view.
const LEAST_NOISE_PX: f64 = 0.05;
/// Factor on the noise of a capture's features, since a patch errs alike in frames that follow each other.
const CORRELATED: f64 = 2.0;
/// Standard deviation of a feature that is found in another camera's picture, pixels.
const FOUND_SIGMA_PX: f64 = 0.25;
/// Number of independent observations as which the features of one camera in the picture of another count at most.
const MOST_INDEPENDENT: f64 = 100.0;
/// Number of standard deviations from which on a residual counts as an outlier's: half as much as others at that distance.
const OUTLYING: f64 = 2.0;
/// Median of the absolute value of a standard normal variable.
const NORMAL_MEDIAN: f64 = 0.6745;
/// Largest distance of such a feature from its projection by the start, pixels.
const FARTHEST_PX: f64 = 12.0;

/// Motion of one camera's capture.
#[derive(Debug, Clone, Copy)]
pub struct CaptureMotion<'a> {
    /// Intrinsics as filmed.
    pub lens: &'a Intrinsics,
    /// Index of the reference frame.
    pub reference: usize,
    /// Pose of each frame; world = the reference frame's camera.
    pub camera_from_world: &'a [Option<Isometry3<f64>>],
    /// Sparse points.
    pub points: &'a [SparsePoint],
}

/// Feature of one capture in the reference picture of another camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SharedFeature {
    /// Capture that has the feature, and the feature's index among its points.
    pub(super) capture: usize,
    pub(super) feature: usize,
    /// The other camera, and the pixel in its pinhole picture.
    pub(super) camera: usize,
    pub(super) pixel: Point2<f64>,
    /// Number of independent observations as which it counts.
    pub(super) share: f64,
}

/// Result of the adjustment.
#[derive(Debug, Clone)]
pub(super) struct Adjusted {
    pub(super) common_from_camera: Vec<Similarity3<f64>>,
    /// Picked points, by their numbers.
    pub(super) picks: Vec<(usize, Point3<f64>)>,
    /// The first camera's unit in that of the bundle.
    pub(super) unit: f64,
    /// Relative standard deviation by which the adjustment changed each capture's depths beside their scale; `None` without
    /// features.
    pub(super) depth_sigma: Vec<Option<f64>>,
}

/// Searches the features of each capture's reference frame in the reference pictures of the others: those found, for each pair of
/// cameras in which they were searched.
///
/// # Errors
/// [`crate::error::Error::Calib`] when OpenCV refuses.
pub(super) fn shared_features(
    motions: &[CaptureMotion<'_>],
    surfaces: &[Surface],
    start: &[Similarity3<f64>],
) -> Result<BTreeMap<[usize; 2], Vec<SharedFeature>>> {
    let features: Vec<(Vec<usize>, Vec<Point2<f64>>)> =
        motions.iter().zip(surfaces).map(|(motion, surface)| motion.in_reference(surface)).collect();
    let mut shared = BTreeMap::new();
    for [a, b] in super::pairs(motions.len()) {
        let relative = start[a].inverse() * start[b];
        let pixels = [features[a].1.as_slice(), &features[b].1];
        let Some(found) = proposals::found_in_both([&surfaces[a], &surfaces[b]], &relative, pixels)? else {
            continue;
        };
        let of_pair: &mut Vec<SharedFeature> = shared.entry([a, b]).or_default();
        for (found, capture, camera) in [(&found[0], a, b), (&found[1], b, a)] {
            let share = (MOST_INDEPENDENT / found.len() as f64).min(1.0);
            of_pair.extend(found.iter().map(|(index, pixel)| SharedFeature {
                capture,
                feature: features[capture].0[*index],
                camera,
                pixel: *pixel,
                share,
            }));
        }
    }
    Ok(shared)
}

impl CaptureMotion<'_> {
    /// Indices of the points seen by the reference frame, and their pixels in the pinhole picture.
    pub(super) fn in_reference(&self, surface: &Surface) -> (Vec<usize>, Vec<Point2<f64>>) {
        let pixel = |(index, point): (usize, &SparsePoint)| {
            let (_, pixel) = point.observations.iter().find(|(frame, _)| *frame == self.reference)?;
            let pinhole = surface.intrinsics.project(&self.lens.unproject(pixel)?.into())?;
            surface.intrinsics.contains(&pinhole).then_some((index, pinhole))
        };
        self.points.iter().enumerate().filter_map(pixel).unzip()
    }

    /// Key frames: the reference, then others spread evenly over the path.
    fn key_frames(&self) -> Vec<usize> {
        let posed: Vec<usize> = (0..self.camera_from_world.len())
            .filter(|frame| self.camera_from_world[*frame].is_some() && *frame != self.reference)
            .collect();
        let count = posed.len().min(KEY_FRAMES);
        let spread = (0..count).map(|k| posed[(2 * k + 1) * posed.len() / (2 * count)]);
        std::iter::once(self.reference).chain(spread).collect()
    }

    /// Standard deviation of a coordinate of its features, pixels.
    fn noise_px(&self) -> f64 {
        let off = |position: &Point3<f64>, frame: usize, pixel: &Point2<f64>| {
            let expected = self.lens.project(&(self.camera_from_world[frame]? * position))?;
            Some((expected - pixel).norm_squared())
        };
        let mut squares: Vec<f64> = self
            .points
            .iter()
            .flat_map(|p| p.observations.iter().filter_map(|(frame, pixel)| off(&p.position, *frame, pixel)))
            .collect();
        squares.sort_by(f64::total_cmp);
        // The median of the square of a distance with two coordinates of deviation σ is 2 ln 2 σ².
        let median = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
        (median / (2.0 * std::f64::consts::LN_2)).sqrt().max(LEAST_NOISE_PX)
    }
}

/// All captures in one bundle.
pub(crate) struct JointBundle<'a> {
    pub(super) motions: &'a [CaptureMotion<'a>],
    /// Pinhole intrinsics of each reference picture.
    pinholes: Vec<&'a Intrinsics>,
    /// Standard deviation of each capture's features, pixels.
    pub(super) feature_sigma_px: Vec<f64>,
    pub(super) state: BundleState,
    pub(super) problem: BundleProblem,
    /// Index of the pose of each capture's reference frame.
    references: Vec<usize>,
    /// Scale of each capture at the start.
    start_scales: Vec<f64>,
    /// Index of the pose of each capture's frames.
    pose_of: Vec<Vec<Option<usize>>>,
    /// Index of the point of each capture's features.
    pub(super) point_of: Vec<Vec<Option<usize>>>,
    /// Number of each pick, and the index of its point.
    picks: Vec<(usize, usize)>,
}

/// Adjusts all captures from `start` on. The first camera keeps its frame and its scale. `pick_sigma_px`: standard deviation
/// of a pick by hand.
pub(super) fn adjust<'a>(
    motions: &'a [CaptureMotion<'a>],
    surfaces: &'a [Surface],
    start: &Merged,
    (picks, pick_sigma_px): (&[LiftedPick], f64),
    shared: &[SharedFeature],
) -> JointBundle<'a> {
    let pinholes = surfaces.iter().map(|surface| &surface.intrinsics).collect();
    let mut bundle = JointBundle::new(motions, pinholes, &start.common_from_camera);
    for feature in shared {
        bundle.share(feature);
    }
    bundle.pick(picks, start, pick_sigma_px);
    bundle.minimise();
    bundle
}

impl<'a> JointBundle<'a> {
    /// Captures with their own features, placed by `start`.
    fn new(
        motions: &'a [CaptureMotion<'a>],
        pinholes: Vec<&'a Intrinsics>,
        start: &[Similarity3<f64>],
    ) -> Self {
        let focal = motions[0].lens.fx;
        let intrinsics = Intrinsics { fx: focal, fy: focal, ..motions[0].lens.pinhole() };
        let feature_sigma_px: Vec<f64> =
            motions.iter().map(|motion| CORRELATED * motion.noise_px()).collect();
        let loss = Loss::Cauchy(OUTLYING * feature_sigma_px[0]);
        let state = BundleState { intrinsics, poses: Vec::new(), points: Vec::new() };
        let mut bundle = Self {
            motions,
            pinholes,
            feature_sigma_px,
            state,
            problem: BundleProblem {
                observations: Vec::new(),
                on_plane: Vec::new(),
                options: BundleOptions { loss, ..BundleOptions::default() },
            },
            references: Vec::new(),
            start_scales: start.iter().map(Similarity3::scaling).collect(),
            pose_of: Vec::new(),
            point_of: Vec::new(),
            picks: Vec::new(),
        };
        for (capture, (motion, common)) in motions.iter().zip(start).enumerate() {
            bundle.references.push(bundle.state.poses.len());
            let mut pose_of = vec![None; motion.camera_from_world.len()];
            for frame in motion.key_frames() {
                let Some(mut pose) = motion.camera_from_world[frame] else { continue };
                // A frame's own space is measured in the common unit, too, so its pose is rigid.
                pose.translation.vector *= common.scaling();
                pose_of[frame] = Some(bundle.state.poses.len());
                bundle.state.poses.push(pose * common.isometry.inverse());
            }
            bundle.pose_of.push(pose_of);
            let points = motion.points.iter().map(|point| {
                let seen = bundle.tracked(capture, &point.observations);
                (seen.len() >= LEAST_SEEN).then(|| (common * point.position, seen))
            });
            let points: Vec<_> = points.collect();
            let added = points.into_iter().map(|point| point.map(|(place, seen)| bundle.add(place, seen)));
            let added = added.collect();
            bundle.point_of.push(added);
        }
        bundle
    }

    /// Pose of a capture's reference frame.
    pub(super) fn reference_pose(&self, capture: usize) -> &Isometry3<f64> {
        &self.state.poses[self.references[capture]]
    }

    /// Minimises the residuals from the present state on.
    pub(super) fn minimise(&mut self) {
        let report = self.problem.adjust(&mut self.state);
        tracing::debug!(
            "{} key frames, {} points, noise {:.3?} px: {report:?}",
            self.state.poses.len(),
            self.state.points.len(),
            self.feature_sigma_px
        );
    }

    /// Cameras and picks as they are now.
    pub(super) fn adjusted(&self) -> Adjusted {
        let first = self.state.poses[self.references[0]];
        let stretched: Vec<Vec<f64>> =
            (0..self.motions.len()).map(|capture| self.stretched(capture)).collect();
        let camera = |(capture, stretched): (usize, &Vec<f64>)| {
            let scale = median(stretched.clone()).unwrap_or(self.start_scales[capture]);
            let back = first * self.reference_pose(capture).inverse();
            Similarity3::from_parts(back.translation, back.rotation, scale)
        };
        let moved: Vec<Similarity3<f64>> = stretched.iter().enumerate().map(camera).collect();
        let depth_sigma = stretched.iter().zip(&moved).map(|(stretched, camera)| {
            let off = stretched.iter().map(|stretch| (stretch / camera.scaling() - 1.0).abs());
            Some(median(off.collect())? / NORMAL_MEDIAN)
        });
        let depth_sigma = depth_sigma.collect();
        let unit = moved[0].scaling();
        let in_unit = |s: &Similarity3<f64>| {
            let shift = s.isometry.translation.vector / unit;
            Similarity3::from_parts(shift.into(), s.isometry.rotation, s.scaling() / unit)
        };
        let place = |point: usize| (first * self.state.points[point]) / unit;
        Adjusted {
            common_from_camera: moved.iter().map(in_unit).collect(),
            picks: self.picks.iter().map(|(number, point)| (*number, place(*point))).collect(),
            unit,
            depth_sigma,
        }
    }

    /// Depth of each feature of a capture over the depth that the capture alone gives it.
    fn stretched(&self, capture: usize) -> Vec<f64> {
        let pose = self.reference_pose(capture);
        let features = self.motions[capture].points.iter().zip(&self.point_of[capture]);
        let of_feature = |(feature, point): (&SparsePoint, &Option<usize>)| {
            let (now, before) = ((pose * self.state.points[(*point)?]).z, feature.position.z);
            (now > 0.0 && before > 0.0).then(|| now / before)
        };
        features.filter_map(of_feature).collect()
    }

    fn add(&mut self, place: Point3<f64>, seen: Vec<Observation>) -> usize {
        self.state.points.push(place);
        self.problem.observations.push(seen);
        self.state.points.len() - 1
    }

    /// Observations of a capture's own feature in its key frames.
    fn tracked(&self, capture: usize, seen: &[(usize, Point2<f64>)]) -> Vec<Observation> {
        let (lens, sigma_px) = (self.motions[capture].lens, self.feature_sigma_px[capture]);
        let in_key_frame = |(frame, pixel): &(usize, Point2<f64>)| {
            self.observation(self.pose_of[capture][*frame]?, lens, pixel, sigma_px)
        };
        seen.iter().filter_map(in_key_frame).collect()
    }

    /// Observation in a camera's reference picture, at a pixel of the pinhole.
    fn in_reference(&self, camera: usize, pixel: &Point2<f64>, sigma_px: f64) -> Option<Observation> {
        self.observation(self.references[camera], self.pinholes[camera], pixel, sigma_px)
    }

    /// Observation at a pixel of a lens, carried to the common pinhole with its standard deviation.
    fn observation(
        &self,
        pose: usize,
        lens: &Intrinsics,
        pixel: &Point2<f64>,
        sigma_px: f64,
    ) -> Option<Observation> {
        let common = &self.state.intrinsics;
        let carried = |pixel: Point2<f64>| common.project(&lens.unproject(&pixel)?.into());
        let at = carried(*pixel)?;
        let [right, below] = [Vector2::x(), Vector2::y()].map(|step| Some(carried(pixel + step)? - at));
        // Side of the square as large as a pixel there.
        let stretch = right?.perp(&below?).abs().sqrt();
        let precision = (self.feature_sigma_px[0] / (sigma_px * stretch)).powi(2);
        precision.is_finite().then_some(Observation { pose, pixel: at, precision })
    }

    /// Adds the observation of a feature in another camera's picture, unless the start puts it elsewhere.
    fn share(&mut self, shared: &SharedFeature) {
        let Some(point) = self.point_of[shared.capture][shared.feature] else { return };
        let sigma_px = FOUND_SIGMA_PX / shared.share.sqrt();
        let Some(seen) = self.in_reference(shared.camera, &shared.pixel, sigma_px) else { return };
        if self.state.error_px(point, &seen) < FARTHEST_PX {
            self.problem.observations[point].push(seen);
        }
    }

    /// Adds picks. Beside the point where the rays of a pick meet stand its patches, one for each camera in whose frames the
    /// patch was registered.
    fn pick(&mut self, picks: &[LiftedPick], start: &Merged, sigma_px: f64) {
        for (number, place) in start.points.iter().enumerate() {
            let of_point: Vec<&LiftedPick> = picks.iter().filter(|pick| pick.point == number).collect();
            let Some(place) = place.filter(|_| of_point.len() > 1) else { continue };
            let patches: Vec<(&LiftedPick, Point3<f64>, Vec<Observation>)> = of_point
                .iter()
                .filter_map(|pick| {
                    let seen = self.tracked(pick.camera, &pick.frames);
                    let place = start.common_from_camera[pick.camera] * pick.seen?;
                    (seen.len() >= LEAST_SEEN).then_some((*pick, place, seen))
                })
                .collect();
            // Both pixels of a pair err, and the pair counts once, however many of the two have a patch.
            let pair_px = sigma_px * (2.0 * patches.len().clamp(1, 2) as f64).sqrt();
            for (own, place, mut seen) in patches {
                for pick in &of_point {
                    // A patch is cut at the pixel in its own camera's picture, without error.
                    let is_own = pick.camera == own.camera;
                    let sigma_px = if is_own { self.feature_sigma_px[own.camera] } else { pair_px };
                    seen.extend(self.in_reference(pick.camera, &pick.pixel, sigma_px));
                }
                self.add(place, seen);
            }
            let rays = of_point.iter().filter_map(|p| self.in_reference(p.camera, &p.pixel, sigma_px));
            let rays = rays.collect();
            let point = self.add(place, rays);
            self.picks.push((number, point));
        }
    }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
