//! Competing starts of a reconstruction: by factorization and by two views, from each lens that may be the capture's. The one
//! with the smallest robust reprojection error is kept.

use calib::Intrinsics;
use calib::least_squares::Loss;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::incremental::{self, FrameObservations};
use super::partial_reconstruction::{Adjustment, PASSING, PartialReconstruction, passing};
use super::triangulation::TriangulationLimits;
use crate::bundle::LensFreedom;
use crate::factorization::windows;
use crate::features::FeatureTrack;

/// Rounds of polish before the competing starts are compared.
const START_ROUNDS: usize = 2;

/// Robust reprojection error of each start after adjustment, pixels: outliers and unexplained observations count with a
/// fixed distance. Infinite where a start failed. The smaller one was kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Starts {
    /// Factorization of windows, chained.
    pub factorization_px: f64,
    /// Essential matrix of two views, then frame after frame.
    pub two_views_px: f64,
}

impl Starts {
    /// Tells whether factorization's reconstruction was kept; it is when both are equally good.
    pub fn factorization_won(&self) -> bool {
        self.factorization_px <= self.two_views_px
    }

    /// Error of the better one.
    fn least_px(&self) -> f64 {
        self.factorization_px.min(self.two_views_px)
    }
}

/// Result of the starts.
pub(super) struct Started<'a> {
    /// Errors of both starts from the lens that was kept.
    pub(super) errors: Starts,
    /// The better of them …
    pub(super) best: PartialReconstruction<'a>,
    /// … and the other, if it did not fail.
    pub(super) other: Option<PartialReconstruction<'a>>,
}

/// Starts from each lens, and keeps the better ones; `None` where all fail.
pub(super) fn best<'a>(
    tracks: &'a [FeatureTrack],
    lenses: &[Intrinsics],
    seen: &FrameObservations,
    lens: LensFreedom,
    seed: u64,
) -> Option<Started<'a>> {
    let from_lens = |intrinsics: &Intrinsics| {
        let blank = PartialReconstruction::new(tracks, intrinsics.clone(), seen.len());
        CompetingStarts::new(blank, seen, lens, seed)
    };
    let started: Vec<CompetingStarts<'_>> = lenses.par_iter().with_max_len(1).map(from_lens).collect();
    let best = started.into_iter().min_by(|a, b| a.errors.least_px().total_cmp(&b.errors.least_px()))?;
    let (errors, best, other) = best.ranked();
    Some(Started { errors, best: best?, other })
}

/// Both starts from one lens.
struct CompetingStarts<'a> {
    errors: Starts,
    by_factorization: Option<PartialReconstruction<'a>>,
    by_two_views: Option<PartialReconstruction<'a>>,
}

impl<'a> CompetingStarts<'a> {
    fn new(blank: PartialReconstruction<'a>, seen: &FrameObservations, lens: LensFreedom, seed: u64) -> Self {
        let by_factorization = start_by_factorization(blank.clone(), seen, lens);
        let by_two_views = start_by_two_views(blank, seen, lens, &mut Pcg64Mcg::seed_from_u64(seed));
        let error = |partial: &Option<PartialReconstruction<'_>>| {
            partial.as_ref().map_or(f64::INFINITY, PartialReconstruction::robust_error_px)
        };
        let errors =
            Starts { factorization_px: error(&by_factorization), two_views_px: error(&by_two_views) };
        Self { errors, by_factorization, by_two_views }
    }

    /// The better reconstruction, and the other.
    fn ranked(self) -> (Starts, Option<PartialReconstruction<'a>>, Option<PartialReconstruction<'a>>) {
        let Self { errors, by_factorization, by_two_views } = self;
        if errors.factorization_won() {
            (errors, by_factorization, by_two_views)
        } else {
            (errors, by_two_views, by_factorization)
        }
    }
}

/// Start by factorization: poses from factorized windows; the remaining frames are resected.
fn start_by_factorization<'a>(
    mut partial: PartialReconstruction<'a>,
    seen: &FrameObservations,
    lens: LensFreedom,
) -> Option<PartialReconstruction<'a>> {
    partial.poses = windows::reconstruct(&partial.tracks, &partial.intrinsics, partial.poses.len())?;
    // The chain of windows may be off by more than a track's noise, so bounds begin wide.
    for (max_error_px, scale_px) in [(16.0, 4.0), (8.0, 2.0), (4.0, 1.0)] {
        let accept = TriangulationLimits { max_error_px, min_angle: 0.5_f64.to_radians(), min_sightings: 3 };
        partial.triangulate(&accept, false);
        let how = Adjustment {
            gate_px: 2.0 * max_error_px,
            loss: Loss::Cauchy(scale_px),
            lens,
            solver: passing(15),
        };
        partial.adjust(&how)?;
    }
    incremental::grow(&mut partial, seen, lens);
    partial.polish(lens, START_ROUNDS, PASSING);
    Some(partial)
}

/// Start by two views: the best pair of frames, and growth from it.
fn start_by_two_views<'a>(
    mut partial: PartialReconstruction<'a>,
    seen: &FrameObservations,
    lens: LensFreedom,
    rng: &mut Pcg64Mcg,
) -> Option<PartialReconstruction<'a>> {
    if !incremental::reconstruct(&mut partial, seen, lens, rng) {
        return None;
    }
    partial.polish(lens, START_ROUNDS, PASSING);
    // Frames that were refused during growth may fit the polished points.
    let registered = partial.registered();
    incremental::grow(&mut partial, seen, lens);
    if partial.registered() > registered {
        partial.polish(lens, START_ROUNDS, PASSING);
    }
    Some(partial)
}

/// Observations of each frame, in the order of tracks.
pub(super) fn seen_by_frame(tracks: &[FeatureTrack], frames: usize) -> FrameObservations {
    let mut seen = vec![Vec::new(); frames];
    for (index, track) in tracks.iter().enumerate() {
        for (frame, pixel) in &track.observations {
            seen[*frame].push((index, *pixel));
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use calib::Distortion;
    use nalgebra::{Isometry3, Point3, Vector2, Vector3};
    use rand::RngExt;
    use rand_distr::{Distribution, Normal};

    use super::*;
    use crate::capture::ASSUMED_FOV_DEG;

    const FRAMES: usize = 24;
    const NOISE_PX: f64 = 0.2;

    /// Tracks of a film by a lens that a hand moves through half a metre in a room of six.
    fn film(lens: &Intrinsics) -> Vec<FeatureTrack> {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let noise = Normal::new(0.0, NOISE_PX).unwrap();
        let pose = |frame: usize| {
            let time = frame as f64 * 0.25;
            let moved = Vector3::new(0.3 * time.sin(), 0.2 * (1.3 * time).cos(), 0.1 * time);
            Isometry3::new(moved, Vector3::new(0.1 * (0.7 * time).sin(), 0.15 * time.cos(), 0.05 * time))
        };
        let track = |_| {
            let mut between = |low: f64, high: f64| rng.random_range(low..high);
            let place = Point3::new(between(-3.5, 3.5), between(-2.5, 2.5), between(1.5, 6.0));
            let observations = (0..FRAMES).filter_map(|frame| {
                let pixel = lens.project(&(pose(frame) * place)).filter(|pixel| lens.contains(pixel))?;
                Some((frame, pixel + Vector2::new(noise.sample(&mut rng), noise.sample(&mut rng))))
            });
            FeatureTrack { observations: observations.collect() }
        };
        (0..500).map(track).filter(|track| track.observations.len() > 3).collect()
    }

    /// Lens that the starts find in a film by `lens` of which they know nothing.
    fn found(lens: &Intrinsics) -> Intrinsics {
        let tracks = film(lens);
        let seen = seen_by_frame(&tracks, FRAMES);
        let lenses = ASSUMED_FOV_DEG.map(|deg| Intrinsics::from_horizontal_fov(lens.width, lens.height, deg));
        best(&tracks, &lenses, &seen, LensFreedom::Unknown, 1).unwrap().best.intrinsics
    }

    #[test]
    fn the_lens_of_a_film_is_found_whatever_its_angle_and_bends() {
        let barrel = [-0.35, 0.12, 0.0, 0.0, 0.0].into();
        for (fov_deg, distortion) in
            [(45.0, Distortion::NONE), (70.0, barrel), (95.0, barrel), (85.0, Distortion::NONE)]
        {
            let lens = Intrinsics { distortion, ..Intrinsics::from_horizontal_fov(640, 480, fov_deg) };
            let found = found(&lens);
            let off = found.fx / lens.fx - 1.0;
            assert!(off.abs() < 0.02, "{fov_deg}°, {distortion:?}: focal length off by {off}");
            let [k1, k2] = found.distortion.leading();
            let [true_k1, true_k2] = lens.distortion.leading();
            assert!((k1 - true_k1).abs() < 0.05 && (k2 - true_k2).abs() < 0.06, "{fov_deg}°: {k1} {k2}");
        }
    }
}
