//! Start of the joint adjustment: cameras and picked points move until picks and the depths measured at them fit best.
//!
//! Least squares over seven numbers a camera (rotation, translation, log scale; the first camera is fixed) and three a
//! point. Residuals, each in standard deviations: a pick's pixel; the depth measured at a pick, as a logarithm. Both are
//! robust (Cauchy), iteratively reweighted. The precision of the depths is estimated along with them ([`variance`]), since a
//! capture's motion may bend its whole space. [`term`] has the residuals and their derivatives,
//! [`equations`](mod@equations) the normal equations.

mod equations;
mod first_points;
mod state;
mod term;
mod variance;

use calib::least_squares::{Options, Problem, minimise};
use nalgebra::Similarity3;

use super::{LiftedPick, MergeOptions, MergeReport, Merged};
use crate::schur::{SchurEquations, SchurStep};
use crate::surface::Surface;
use equations::equations;
use first_points::first_points;
use state::{POSE, RefinementState};
use term::{LinearisedTerm, Term, norm, terms};
use variance::Factors;

/// Largest number of rounds of minimising and re-estimating the precision of depths and picks.
const VARIANCE_ROUNDS: usize = 8;
/// Difference (logarithm) between a depth and the intersection of both cameras' rays beyond which the depth belongs to
/// another surface …
const DEPTH_MISMATCH: f64 = 0.1;
/// … if it is also that many standard deviations of the depth, which beside an edge is as uncertain as the step there.
const MISMATCH_SIGMAS: f64 = 3.0;

struct Refinement<'a> {
    surfaces: &'a [Surface],
    options: &'a MergeOptions,
    /// Estimated factors on the claimed standard deviations of depths and picks.
    factors: Factors,
}

/// Observations whose robust cost is minimised.
struct Observations<'a> {
    refinement: &'a Refinement<'a>,
    terms: Vec<Term<'a>>,
}

impl Problem for Observations<'_> {
    type State = RefinementState;
    type Equations = SchurEquations<POSE>;

    fn cost(&self, state: &RefinementState) -> f64 {
        self.refinement.cost(state, &self.terms)
    }

    fn linearise(&self, state: &RefinementState) -> SchurEquations<POSE> {
        let rows: Vec<_> = self.terms.iter().map(|term| self.refinement.linearised(state, term)).collect();
        let weight = |row: &LinearisedTerm, term: &Term<'_>| term.loss().weight(norm(row.residual).powi(2));
        equations(state, rows.iter().zip(&self.terms).map(|(row, term)| (row, weight(row, term))))
    }

    fn moved(&self, state: &RefinementState, step: &SchurStep) -> RefinementState {
        state.moved(step)
    }
}

/// Refines `start`; outliers among the picks are left out and reported.
pub(super) fn refine(
    picks: &[LiftedPick],
    start: &[Similarity3<f64>],
    surfaces: &[Surface],
    options: &MergeOptions,
) -> (Merged, MergeReport) {
    let mut scene = Refinement { surfaces, options, factors: Factors::loose(start.len()) };
    let mut report = MergeReport::default();
    let points = first_points(picks, start, surfaces);
    // Picks of a point without a position give no constraint.
    let mut kept: Vec<LiftedPick> = picks.iter().filter(|p| points[p.point].is_some()).cloned().collect();
    let mut state = RefinementState { poses: start.to_vec(), points };
    // Each round leaves out the worst point only, since it may have pulled others off.
    loop {
        scene.factors = Factors::loose(start.len());
        for _ in 0..VARIANCE_ROUNDS {
            scene.minimise(&mut state, &kept);
            scene.factors = scene.variance_factors(&state, &kept);
        }
        scene.factors.leave_chance();
        scene.minimise(&mut state, &kept);
        let worst = kept
            .iter()
            .map(|p| (p, scene.misfit_px(&state, p, &kept)))
            .filter(|(_, off)| *off > options.outlier_px)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((pick, off)) = worst else { break };
        let point = pick.point;
        report.outliers.push((point + 1, pick.camera, off));
        kept.retain(|p| p.point != point);
        state.points[point] = None;
    }
    report.pick_rms_px = scene.pick_rms(&state, &kept);
    report.misfits_px = scene.misfits_px(&state, &kept);
    report.depth_sigma = scene.depth_sigma(&kept);
    (Merged { common_from_camera: state.poses, points: state.points }, report)
}

impl Refinement<'_> {
    /// Robust cost of observations.
    fn cost(&self, state: &RefinementState, terms: &[Term<'_>]) -> f64 {
        terms.iter().map(|t| t.loss().cost(norm(self.residual(state, t)).powi(2))).sum()
    }

    fn minimise(&self, state: &mut RefinementState, picks: &[LiftedPick]) {
        const SOLVER: Options = Options { max_iterations: 120, cost_tolerance: 1e-9, initial_damping: 1e-3 };
        minimise(&Observations { refinement: self, terms: terms(picks) }, state, &SOLVER);
    }

    /// Distance of a pick from the projection of its point by the others. When its depths contradict each other
    /// although the rays meet, it is the distance between the pick and the points by the other cameras' depths, in this
    /// picture.
    fn misfit_px(&self, state: &RefinementState, pick: &LiftedPick, picks: &[LiftedPick]) -> f64 {
        let off = norm(self.residual(state, &Term::Pixel(pick))) * self.pick_sigma_px();
        let mut of_point = picks.iter().filter(|p| p.point == pick.point);
        let contradicted = of_point.all(|p| {
            p.seen.zip(p.depth).is_some_and(|(seen, (depth, sigma))| {
                let z = (state.poses[p.camera].inverse() * state.points[p.point].unwrap_or(seen)).z;
                let log = if z > 0.0 { (z / depth).ln() } else { f64::INFINITY };
                log.abs() > DEPTH_MISMATCH.max(MISMATCH_SIGMAS * sigma)
            })
        });
        if !contradicted {
            return off;
        }
        let camera = &self.surfaces[pick.camera].intrinsics;
        let from_others = picks
            .iter()
            .filter(|p| p.point == pick.point && p.camera != pick.camera)
            .filter_map(|p| {
                let there = state.poses[p.camera] * p.seen?;
                let pixel = camera.project(&(state.poses[pick.camera].inverse() * there))?;
                Some((pixel - pick.pixel).norm())
            })
            .fold(0.0, f64::max);
        off.max(from_others)
    }

    /// Distance of each pick from the projection of its point, with the point's number and its camera.
    fn misfits_px(&self, state: &RefinementState, picks: &[LiftedPick]) -> Vec<(usize, usize, f64)> {
        let off = |p: &LiftedPick| norm(self.residual(state, &Term::Pixel(p))) * self.pick_sigma_px();
        picks.iter().map(|p| (p.point + 1, p.camera, off(p))).collect()
    }

    fn pick_rms(&self, state: &RefinementState, picks: &[LiftedPick]) -> f64 {
        let squares: f64 = picks.iter().map(|p| norm(self.residual(state, &Term::Pixel(p))).powi(2)).sum();
        // The sum over no picks is −0.
        self.pick_sigma_px() * (squares.abs() / picks.len().max(1) as f64).sqrt()
    }
}
