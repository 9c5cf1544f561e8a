//! Precision of the picks and of each camera's depths at them, by variance components (F. R. Helmert, 1907; W.
//! Förstner, "Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten", 1979).
//!
//! The error of a pick by hand is known roughly. The error of depth is not: a capture with a short path, or a lens that
//! is slightly off, bends the space it reconstructs, all depths at once. It is estimated from the residuals of the
//! joint fit and their redundancy (the share of an observation that the others could predict).

use super::equations::{equations, variance};
use super::state::RefinementState;
use super::term::{Term, terms};
use super::{LiftedPick, Refinement};

/// Number of observations as which the claimed precision counts.
const PRIOR: f64 = 4.0;
/// Factor on the claimed deviation of depths below which the excess is attributed to chance.
const CHANCE: f64 = 1.5;
/// Bounds of the factors of picks and of depths.
const PICK_RANGE: (f64, f64) = (1.0, 3.0);
const DEPTH_RANGE: (f64, f64) = (0.5, 30.0);

/// Factors on the claimed standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Factors {
    /// Factor of all picks.
    pick: f64,
    /// Factor of the depths of each camera.
    pub(super) depth: Vec<f64>,
}

impl Factors {
    /// Initial factors: with so little weight of the depths that no bent one looks like an outlier.
    pub(super) fn loose(cameras: usize) -> Self {
        const DEPTH: f64 = 6.0;
        Self { pick: 1.0, depth: vec![DEPTH; cameras] }
    }

    /// Resets the factors of depths that exceed their claim by little, which is attributed to chance.
    pub(super) fn leave_chance(&mut self) {
        for depth in &mut self.depth {
            if *depth < CHANCE {
                *depth = 1.0;
            }
        }
    }
}

/// One group of observations.
#[derive(Default)]
struct Group {
    /// Residuals in units of the claim, each scaled to its size without the fit.
    scatter: Vec<f64>,
    redundancy: f64,
}

impl Group {
    fn add(&mut self, residual: f64, redundancy: f64) {
        /// Least redundancy: an observation that alone determines parameters has no residual.
        const LEAST: f64 = 0.1;
        if redundancy > LEAST {
            self.scatter.push(residual.abs() / redundancy.sqrt());
            self.redundancy += redundancy;
        }
    }

    /// Factor by the median, since a depth measured at an edge belongs to another surface.
    fn factor(&self) -> f64 {
        /// Median of the absolute value of a standard normal variable.
        const MEDIAN: f64 = 0.6745;
        let mut sorted = self.scatter.clone();
        sorted.sort_by(f64::total_cmp);
        let n = sorted.len();
        if n == 0 {
            return 1.0;
        }
        let middle = 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]) / MEDIAN;
        ((self.redundancy * middle * middle + PRIOR) / (self.redundancy + PRIOR)).sqrt()
    }
}

impl Refinement<'_> {
    /// Standard deviation of a coordinate of a pick.
    pub(super) fn pick_sigma_px(&self) -> f64 {
        self.options.pick_sigma_px * self.factors.pick
    }

    /// Factors estimated from the residuals of a minimum.
    pub(super) fn variance_factors(&self, state: &RefinementState, picks: &[LiftedPick]) -> Factors {
        let cameras = state.poses.len();
        let terms = terms(picks);
        let rows: Vec<_> = terms.iter().map(|term| self.linearised(state, term)).collect();
        let equations = equations(state, rows.iter().map(|row| (row, 1.0)));
        let Some(factored) = equations.factor(0.0) else { return self.factors.clone() };
        let mut of_picks = Group::default();
        let mut of_depths: Vec<Group> = (0..cameras).map(|_| Group::default()).collect();
        for (term, row) in terms.iter().zip(&rows) {
            let (group, factor, sides) = match term {
                Term::Pixel(_) => (&mut of_picks, self.factors.pick, 0..2),
                Term::Depth(pick, _) => (&mut of_depths[pick.camera], self.factors.depth[pick.camera], 0..1),
            };
            for side in sides {
                group.add(row.residual[side] * factor, 1.0 - variance(&factored, row, side));
            }
        }
        Factors {
            pick: of_picks.factor().clamp(PICK_RANGE.0, PICK_RANGE.1),
            depth: of_depths.iter().map(|g| g.factor().clamp(DEPTH_RANGE.0, DEPTH_RANGE.1)).collect(),
        }
    }

    /// Median relative standard deviation of the depths at each camera's picks; 0 without any.
    pub(super) fn depth_sigma(&self, picks: &[LiftedPick]) -> Vec<f64> {
        let of = |(camera, factor): (usize, &f64)| {
            let mut sigmas: Vec<f64> =
                picks.iter().filter(|p| p.camera == camera).filter_map(|p| Some(p.depth?.1)).collect();
            sigmas.sort_by(f64::total_cmp);
            sigmas.get(sigmas.len() / 2).map_or(0.0, |sigma| sigma * factor)
        };
        self.factors.depth.iter().enumerate().map(of).collect()
    }
}
