//! How good the picks and each camera's depths at them are: variance components (F. R. Helmert 1907; W. Förstner 1979).
//!
//! A hand's error is known roughly. The error of depth is not: a capture with a short path, or a lens that is slightly
//! off, bends the space it reconstructs, all depths at once. What residuals the joint fit leaves, compared with
//! their redundancy (the share of an observation that the others could predict), tells.

use super::schur::NormalEquations;
use super::state::State;
use super::term::{Term, terms};
use super::{Pick, Scene};

/// A claim counts as much as this many observations.
const PRIOR: f64 = 4.0;
/// Depths that look worse than they claim by less than this do so by chance.
const CHANCE: f64 = 1.5;
/// Bounds of the factors of picks and of depths.
const PICK_RANGE: (f64, f64) = (1.0, 3.0);
const DEPTH_RANGE: (f64, f64) = (0.5, 30.0);

/// By how much standard deviations differ from what is claimed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Factors {
    /// Of all picks by hand.
    pick: f64,
    /// Of the depths of each camera.
    pub(super) depth: Vec<f64>,
}

impl Factors {
    /// Where estimation starts: with depths trusted so little that no bent one looks like an outlier.
    pub(super) fn loose(cameras: usize) -> Self {
        const DEPTH: f64 = 6.0;
        Self { pick: 1.0, depth: vec![DEPTH; cameras] }
    }

    /// Depths that look a little worse than they claim, or better, do so by chance.
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
    /// Residuals in units of the claim, each as large as it would be had it not been fitted.
    scatter: Vec<f64>,
    redundancy: f64,
}

impl Group {
    fn add(&mut self, residual: f64, redundancy: f64) {
        /// What the fit depends on alone has no residual to speak of.
        const LEAST: f64 = 0.1;
        if redundancy > LEAST {
            self.scatter.push(residual.abs() / redundancy.sqrt());
            self.redundancy += redundancy;
        }
    }

    /// From the median: a depth read at an edge is another surface's, and no scatter.
    fn factor(&self) -> f64 {
        /// Of the absolute value of a normal variable.
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

impl Scene<'_> {
    /// Standard deviation of a coordinate that a person picked.
    pub(super) fn pick_sigma_px(&self) -> f64 {
        self.options.pick_sigma_px * self.factors.pick
    }

    /// Standard deviation of a pick's coordinate, whoever picked it.
    pub(super) fn sigma_px(&self, pick: &Pick) -> f64 {
        if pick.by_hand { self.pick_sigma_px() } else { self.options.match_sigma_px }
    }

    /// The factors that the residuals of a minimum speak for.
    pub(super) fn variance_factors(&self, state: &State, picks: &[Pick]) -> Factors {
        let cameras = state.poses.len();
        let terms = terms(picks, &[], self.levels);
        let rows: Vec<_> = terms.iter().map(|term| self.linearised(state, term)).collect();
        let mut normal = NormalEquations::new(state);
        for row in &rows {
            normal.add(row, 1.0);
        }
        let Some(factored) = normal.factor(0.0) else { return self.factors.clone() };
        let mut of_picks = Group::default();
        let mut of_depths: Vec<Group> = (0..cameras).map(|_| Group::default()).collect();
        for (term, row) in terms.iter().zip(&rows) {
            let (group, factor, sides) = match term {
                Term::Pixel(pick) if !pick.by_hand => continue,
                Term::Pixel(_) => (&mut of_picks, self.factors.pick, 0..2),
                Term::Depth(pick, _) => (&mut of_depths[pick.camera], self.factors.depth[pick.camera], 0..1),
                Term::Surface(..) | Term::Level(_) => continue,
            };
            for side in sides {
                group.add(row.residual[side] * factor, 1.0 - factored.variance(row, side));
            }
        }
        Factors {
            pick: of_picks.factor().clamp(PICK_RANGE.0, PICK_RANGE.1),
            depth: of_depths.iter().map(|g| g.factor().clamp(DEPTH_RANGE.0, DEPTH_RANGE.1)).collect(),
        }
    }

    /// The depths' standard deviation as a share of them, in the median of each camera's picks; 0 without any.
    pub(super) fn depth_sigma(&self, picks: &[Pick]) -> Vec<f64> {
        let of = |(camera, factor): (usize, &f64)| {
            let mut sigmas: Vec<f64> =
                picks.iter().filter(|p| p.camera == camera).filter_map(|p| Some(p.depth?.1)).collect();
            sigmas.sort_by(f64::total_cmp);
            sigmas.get(sigmas.len() / 2).map_or(0.0, |sigma| sigma * factor)
        };
        self.factors.depth.iter().enumerate().map(of).collect()
    }
}
