//! Least squares over the pose, its covariance, and the judgement whether it is certain enough.
//!
//! The covariance is the larger one of two. The model's, `H⁻¹` times the residuals' variance, takes the sightings for
//! independent. The sandwich `H⁻¹ (Σ g gᵀ) H⁻¹` sums the gradients `g` over the sightings of a cell first (K.-Y. Liang &
//! S. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986), so that a cell whose
//! depth is wrong as a whole counts once.
//!
//! Registered corners are so many and so precise that what limits the pose is the depth of surfaces; there the jackknife
//! over the cells joins the two ([`left_out_sigmas`]).

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Isometry3, Matrix2, Matrix6, SMatrix, SVector, Vector6};

use super::sighting::{AGREES_SIGMAS, Sighting};
use super::{Doubt, LEAST_AGREEING, LEAST_CELLS, Relocation};
use crate::Intrinsics;
use crate::least_squares::{Loss, NormalEquations, Options, Problem, by_pose, minimise, moved_pose};

/// Number of times that the residuals are weighted anew, by the pose found last.
const ROUNDS: usize = 4;
/// Weighted residual from which on a sighting's influence falls.
const LOSS: Loss = Loss::Cauchy(2.0);
/// Weighted residual beyond which a sighting has no part, first and last.
const REACH_SIGMAS: [f64; 2] = [4.0 * AGREES_SIGMAS, 2.0 * AGREES_SIGMAS];

/// Factors of the sightings' uncertainty among which the likeliest are chosen, ascending.
pub(super) struct UncertaintyFactors {
    /// Of [`Sighting::pixel_sigma_px`].
    pub(super) pixel: &'static [f64],
    /// Of [`Sighting::depth_step`].
    pub(super) depth: &'static [f64],
}

/// Factors for matched keypoints, whose pixels are as precise in one picture as in another.
pub(super) const OF_KEYPOINTS: UncertaintyFactors =
    UncertaintyFactors { pixel: &[1.0], depth: &[0.5, 1.0, 2.0, 4.0, 8.0] };
/// Factors for registered corners: how precise they are depends on the noise and the sharpness of both pictures. Were a corner
/// allowed to be much less precise, many of another room's would agree on a pose by chance.
pub(super) const OF_CORNERS: UncertaintyFactors =
    UncertaintyFactors { pixel: &[0.25, 0.5, 1.0, 1.5], depth: &[0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0] };

/// Weighted reprojection of sightings.
struct WeightedReprojection<'a> {
    intrinsics: &'a Intrinsics,
    sightings: Vec<(&'a Sighting, Matrix2<f64>)>,
}

impl<'a> WeightedReprojection<'a> {
    /// Problem of the sightings within `reach` standard deviations of their pixels, weighted at a pose.
    fn at(intrinsics: &'a Intrinsics, sightings: &'a [Sighting], pose: &Isometry3<f64>, reach: f64) -> Self {
        let near = sightings.iter().filter(|s| s.squared(intrinsics, pose) < reach * reach);
        let weighted = near.map(|s| (s, s.whitening(intrinsics, pose)));
        Self { intrinsics, sightings: weighted.collect() }
    }

    /// Weighted residual of a sighting, and its derivative by the pose.
    fn residual(
        &self,
        sighting: &Sighting,
        whitening: &Matrix2<f64>,
        pose: &Isometry3<f64>,
    ) -> Option<(SVector<f64, 2>, SMatrix<f64, 2, 6>)> {
        let residual = sighting.residual_px(self.intrinsics, pose)?;
        let place = pose * sighting.world;
        let jacobian = self.intrinsics.project_jacobian(&place) * by_pose(&place);
        Some((whitening * residual, whitening * jacobian))
    }
}

impl Problem for WeightedReprojection<'_> {
    type State = Isometry3<f64>;
    type Equations = NormalEquations<6>;

    fn cost(&self, pose: &Isometry3<f64>) -> f64 {
        let squared = |(sighting, whitening): &(&Sighting, Matrix2<f64>)| {
            let residual = sighting.residual_px(self.intrinsics, pose);
            residual.map_or(f64::INFINITY, |residual| LOSS.cost((whitening * residual).norm_squared()))
        };
        self.sightings.iter().map(squared).sum()
    }

    fn linearise(&self, pose: &Isometry3<f64>) -> NormalEquations<6> {
        let mut equations = NormalEquations::default();
        for (sighting, whitening) in &self.sightings {
            let Some((residual, jacobian)) = self.residual(sighting, whitening, pose) else { continue };
            equations.add(&jacobian, &residual, LOSS.weight(residual.norm_squared()));
        }
        equations
    }

    fn moved(&self, pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
        moved_pose(pose, step.as_slice())
    }
}

/// The pose of least weighted residuals near `start`.
pub(super) fn adjusted(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    start: &Isometry3<f64>,
) -> Isometry3<f64> {
    let mut pose = *start;
    for round in 0..ROUNDS {
        let reach = REACH_SIGMAS[usize::from(round > 0)];
        let problem = WeightedReprojection::at(intrinsics, sightings, &pose, reach);
        minimise(&problem, &mut pose, &Options::default());
    }
    pose
}

/// The adjusted pose, and the sightings with the uncertainty of their pixels and depths by which their residuals are most
/// likely: how good a room's surfaces are differs from room to room, how sharp a picture is from picture to picture.
pub(super) fn adjusted_with_uncertainties(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    start: &Isometry3<f64>,
    factors: &UncertaintyFactors,
) -> (Isometry3<f64>, Vec<Sighting>) {
    let widest = |factors: &[f64]| factors.last().copied().unwrap_or(1.0);
    let (widest_pixel, widest_depth) = (widest(factors.pixel), widest(factors.depth));
    let near: Vec<Sighting> = {
        let is_near = |s: &&Sighting| {
            let wide = s.with_uncertainty(widest_pixel, widest_depth);
            wide.squared(intrinsics, start) < REACH_SIGMAS[1] * REACH_SIGMAS[1]
        };
        sightings.iter().filter(is_near).copied().collect()
    };
    let pairs =
        factors.pixel.iter().flat_map(|pixel| factors.depth.iter().map(move |depth| (*pixel, *depth)));
    let tried = pairs.map(|(pixel, depth)| {
        let scaled: Vec<Sighting> = near.iter().map(|s| s.with_uncertainty(pixel, depth)).collect();
        let pose = adjusted(intrinsics, &scaled, start);
        let unlikeliness = |s: &Sighting| {
            let squared = s.squared(intrinsics, &pose).min(1e6);
            LOSS.cost(squared) + s.log_determinant(intrinsics, &pose)
        };
        (scaled.iter().map(unlikeliness).sum::<f64>(), pose, scaled)
    });
    // The start is for a sum that is no number.
    let best = tried.min_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or_else(|| (*start, near), |(_, pose, scaled)| (pose, scaled))
}

/// Number of sightings that agree with a pose.
pub(super) fn agreeing(intrinsics: &Intrinsics, sightings: &[Sighting], pose: &Isometry3<f64>) -> usize {
    sightings.iter().filter(|s| s.squared(intrinsics, pose) < AGREES_SIGMAS * AGREES_SIGMAS).count()
}

/// The pose with its uncertainty, and the median distance of the sightings that agree; or the reason for which it is not to
/// be trusted. `matches` is the number of sightings by looks alone.
pub(super) fn judged(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    pose: &Isometry3<f64>,
    matches: usize,
) -> Result<(Relocation, f64), Doubt> {
    let problem = WeightedReprojection::at(intrinsics, sightings, pose, AGREES_SIGMAS);
    let agreeing = problem.sightings.len();
    if agreeing < LEAST_AGREEING {
        return Err(Doubt::Unrecognised { agreeing, matches });
    }
    let mut matrix = Matrix6::zeros();
    let (mut squared, mut squared_px) = (0.0, 0.0);
    let mut gradients: BTreeMap<u32, Vector6<f64>> = BTreeMap::new();
    let mut distances_m = Vec::with_capacity(agreeing);
    for (sighting, whitening) in &problem.sightings {
        let Some((residual, jacobian)) = problem.residual(sighting, whitening, pose) else { continue };
        let weight = LOSS.weight(residual.norm_squared());
        matrix += weight * jacobian.transpose() * jacobian;
        *gradients.entry(sighting.cell).or_default() += weight * jacobian.transpose() * residual;
        squared += weight * residual.norm_squared();
        squared_px += sighting.residual_px(intrinsics, pose).map_or(0.0, |r| r.norm_squared());
        distances_m.push((pose * sighting.world).coords.norm());
    }
    let cells = gradients.len();
    if cells < LEAST_CELLS {
        return Err(Doubt::Crowded { agreeing });
    }
    let Some(inverse) = matrix.try_inverse() else { return Err(Doubt::Crowded { agreeing }) };
    // Two residuals a sighting, less the six unknowns.
    let variance = (squared / (2.0 * agreeing as f64 - 6.0)).max(1.0);
    let meat: Matrix6<f64> = gradients.values().map(|g| g * g.transpose()).sum();
    // Cells, less the six unknowns that fit them.
    let cells = cells as f64;
    let sandwich = inverse * meat * inverse * (cells / (cells - 6.0));
    let [model, sandwich] = [inverse * variance, sandwich].map(|covariance| sigmas(&covariance));
    distances_m.sort_by(f64::total_cmp);
    let found = Relocation {
        camera_from_world: *pose,
        sigma_m: model.0.max(sandwich.0),
        sigma_deg: model.1.max(sandwich.1),
        matches,
        agreeing,
        rms_px: (squared_px / agreeing as f64).sqrt(),
    };
    Ok((found, distances_m[distances_m.len() / 2]))
}

/// Standard deviations of a pose without the sightings of one cell at a time (M. Quenouille, Biometrika 43, 1956): metres,
/// degrees. What the sightings of one cell decide shows here even where the residuals fit; an error that many cells share
/// does not.
pub(super) fn left_out_sigmas(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    pose: &Isometry3<f64>,
) -> (f64, f64) {
    let cells: BTreeSet<u32> = sightings.iter().map(|s| s.cell).collect();
    let change = |cell: &u32| {
        let others: Vec<Sighting> = sightings.iter().filter(|s| s.cell != *cell).copied().collect();
        let step = adjusted(intrinsics, &others, pose) * pose.inverse();
        let mut change = Vector6::zeros();
        change.fixed_rows_mut::<3>(0).copy_from(&step.rotation.scaled_axis());
        change.fixed_rows_mut::<3>(3).copy_from(&step.translation.vector);
        change * change.transpose()
    };
    let count = cells.len().max(1) as f64;
    let covariance: Matrix6<f64> = cells.iter().map(change).sum();
    sigmas(&(covariance * ((count - 1.0) / count)))
}

/// Standard deviations of position, metres, and orientation, degrees, of a pose's covariance.
fn sigmas(covariance: &Matrix6<f64>) -> (f64, f64) {
    let turn = covariance.fixed_view::<3, 3>(0, 0).trace();
    // The camera's centre is −Rᵀ t: a step (ω, τ) moves it by −Rᵀ τ, since ω turns about the camera itself.
    let shift = covariance.fixed_view::<3, 3>(3, 3).trace();
    (shift.max(0.0).sqrt(), turn.max(0.0).sqrt().to_degrees())
}
