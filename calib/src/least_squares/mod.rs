//! Damped nonlinear least squares: Levenberg–Marquardt, with the damping schedule of H. B. Nielsen, "Damping parameter
//! in Marquardt's method" (IMM-REP-1999-05, Technical University of Denmark, 1999).
//!
//! With residuals `r`, their derivatives `J` and robust weights `W`, a step `δ` solves
//!
//! ```text
//! (H + λ diag H) δ = g      H = Jᵀ W J,  g = −Jᵀ W r
//! ```
//!
//! and is taken if it lowers the cost. A [`Problem`] supplies cost, linearisation and step; its [`Equations`] solve for
//! the step, so that a problem with structure can eliminate unknowns first. [`NormalEquations`] are those of few
//! unknowns; [`Loss`] makes a problem robust.
//!
//! # Order of a pose's parameters
//!
//! Rotation vector `ω`, translation `τ`, and for a similarity the logarithm `σ` of its scale. The step multiplies on
//! the left: `x ← e^σ exp(ω) x + τ` for the transformed point `x`, whose derivative [`by_similarity`] is
//! `[−[x]×, I, x]`.
//!
//! # Example
//!
//! ```
//! use calib::least_squares::{NormalEquations, Options, Problem, minimise};
//! use nalgebra::{SMatrix, SVector, Vector2};
//!
//! /// Parameters a and b of the curve a exp(b x) through points.
//! struct Curve(Vec<(f64, f64)>);
//!
//! impl Problem for Curve {
//!     type State = Vector2<f64>;
//!     type Equations = NormalEquations<2>;
//!
//!     fn cost(&self, s: &Vector2<f64>) -> f64 {
//!         self.0.iter().map(|(x, y)| (s[0] * (s[1] * x).exp() - y).powi(2)).sum()
//!     }
//!
//!     fn linearise(&self, s: &Vector2<f64>) -> NormalEquations<2> {
//!         let mut equations = NormalEquations::default();
//!         for (x, y) in &self.0 {
//!             let e = (s[1] * x).exp();
//!             equations.add(&SMatrix::<f64, 1, 2>::new(e, s[0] * x * e), &SVector::from([s[0] * e - y]), 1.0);
//!         }
//!         equations
//!     }
//!
//!     fn moved(&self, s: &Vector2<f64>, step: &SVector<f64, 2>) -> Vector2<f64> {
//!         s + step
//!     }
//! }
//!
//! let points = (0..5).map(|i| f64::from(i) * 0.5).map(|x| (x, 2.0 * (-0.7 * x).exp())).collect();
//! let mut state = Vector2::new(1.0, 0.0);
//! let report = minimise(&Curve(points), &mut state, &Options::default());
//! assert!((state - Vector2::new(2.0, -0.7)).norm() < 1e-6 && report.converged());
//! ```

mod dense;
mod loss;
mod pose;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

pub use dense::{NormalEquations, damp};
pub use loss::Loss;
pub use pose::{by_pose, by_similarity, moved_pose, moved_similarity};

use crate::{Error, Result};

/// Bounds of the damping: below the lower one it has no effect, above the upper one steps no longer move anything.
const DAMPING_RANGE: (f64, f64) = (1e-12, 1e12);

/// Problem of nonlinear least squares.
pub trait Problem {
    /// Unknowns.
    type State;
    /// Linearised problem.
    type Equations: Equations;

    /// Sum of the (robust) squared residuals. States without a cost have an infinite one.
    fn cost(&self, state: &Self::State) -> f64;

    /// Problem linearised at a state.
    fn linearise(&self, state: &Self::State) -> Self::Equations;

    /// State after a step.
    fn moved(&self, state: &Self::State, step: &<Self::Equations as Equations>::Step) -> Self::State;
}

/// Linearised problem, which is solved for several dampings.
pub trait Equations {
    /// Step of all unknowns.
    type Step;

    /// Solves for the step with the diagonal raised by the share `damping`; `None` if the equations have no solution.
    fn solve(&self, damping: f64) -> Option<DampedStep<Self::Step>>;
}

/// Solution of damped equations.
#[derive(Debug, Clone, PartialEq)]
pub struct DampedStep<S> {
    /// Step of all unknowns.
    pub step: S,
    /// Decrease of the linearised cost, `δᵀ (λ diag H δ + g)`: the cost is the sum of squares without the half.
    pub predicted_decrease: f64,
}

/// Options of a minimisation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Largest number of steps, taken or refused. Default 100.
    pub max_iterations: usize,
    /// Relative decrease of the cost by a step below which the minimisation ends. Default 1e-12.
    pub cost_tolerance: f64,
    /// Damping of the first step, relative to the diagonal. Default 1e-4: starts are near the minimum.
    pub initial_damping: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self { max_iterations: 100, cost_tolerance: 1e-12, initial_damping: 1e-4 }
    }
}

impl Options {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a tolerance outside 0 to 1, or a damping that is not positive and finite.
    pub fn validate(&self) -> Result<()> {
        if !(0.0..1.0).contains(&self.cost_tolerance) {
            let tolerance = self.cost_tolerance;
            return Err(Error::Invalid(format!(
                "cost_tolerance is {tolerance}; give a share from 0 to below 1"
            )));
        }
        if !(self.initial_damping > 0.0 && self.initial_damping.is_finite()) {
            let damping = self.initial_damping;
            return Err(Error::Invalid(format!("initial_damping is {damping}; give a positive number")));
        }
        Ok(())
    }
}

/// Reason for which a minimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// The cost is zero, or steps lower it by less than the tolerance.
    Converged,
    /// The number of iterations is used up.
    IterationLimit,
    /// No step lowers the cost at any damping.
    NoDescent,
    /// The cost of the start is not finite.
    InvalidStart,
}

/// Report of a minimisation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Number of steps, taken or refused.
    pub iterations: usize,
    /// Cost of the start.
    pub initial_cost: f64,
    /// Cost of the result, never above that of the start.
    pub final_cost: f64,
    /// Reason for which it ended.
    pub termination: Termination,
}

impl Report {
    /// Tells whether the result is a minimum, to the tolerance.
    pub fn converged(&self) -> bool {
        self.termination == Termination::Converged
    }
}

/// Minimises the cost from `state` on, in place; the cost never increases.
///
/// A problem that does not determine its unknowns is damped, not refused.
pub fn minimise<P: Problem>(problem: &P, state: &mut P::State, options: &Options) -> Report {
    let initial_cost = problem.cost(state);
    let (mut cost, mut iterations) = (initial_cost, 0);
    let end =
        |iterations, final_cost, termination| Report { iterations, initial_cost, final_cost, termination };
    if !cost.is_finite() {
        return end(0, cost, Termination::InvalidStart);
    }
    let (mut damping, mut growth) = (options.initial_damping, 2.0);
    let mut equations = None;
    loop {
        if cost <= 0.0 {
            return end(iterations, cost, Termination::Converged);
        }
        if iterations == options.max_iterations {
            return end(iterations, cost, Termination::IterationLimit);
        }
        iterations += 1;
        let solved = equations.get_or_insert_with(|| problem.linearise(state)).solve(damping);
        if let Some(DampedStep { step, predicted_decrease }) = solved {
            let candidate = problem.moved(state, &step);
            let new_cost = problem.cost(&candidate);
            if new_cost < cost {
                let decrease = cost - new_cost;
                let converged = decrease <= options.cost_tolerance * cost;
                (*state, cost) = (candidate, new_cost);
                if converged {
                    return end(iterations, cost, Termination::Converged);
                }
                // Section 3, equation 3.5: the better the prediction, the less damping.
                let gain = decrease / predicted_decrease.max(f64::MIN_POSITIVE);
                damping *= (1.0 - (2.0 * gain - 1.0).powi(3)).clamp(1.0 / 3.0, 2.0);
                damping = damping.max(DAMPING_RANGE.0);
                growth = 2.0;
                equations = None;
                continue;
            }
            // Nothing is left to gain, and rounding hides the little there is.
            if predicted_decrease <= 1e-2 * options.cost_tolerance * cost {
                return end(iterations, cost, Termination::Converged);
            }
        }
        damping *= growth;
        growth *= 2.0;
        if damping > DAMPING_RANGE.1 {
            return end(iterations, cost, Termination::NoDescent);
        }
    }
}
