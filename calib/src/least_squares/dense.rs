//! Normal equations of few unknowns, solved by Cholesky's factorisation.

use nalgebra::{SMatrix, SVector};

use super::{DampedStep, Equations};

/// Normal equations of `N` unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct NormalEquations<const N: usize> {
    /// `H = Jᵀ W J`.
    pub matrix: SMatrix<f64, N, N>,
    /// `g = −Jᵀ W r`.
    pub right: SVector<f64, N>,
}

impl<const N: usize> Default for NormalEquations<N> {
    fn default() -> Self {
        Self { matrix: SMatrix::zeros(), right: SVector::zeros() }
    }
}

impl<const N: usize> NormalEquations<N> {
    /// Adds residuals with their derivatives and their weight.
    pub fn add<const R: usize>(
        &mut self,
        jacobian: &SMatrix<f64, R, N>,
        residual: &SVector<f64, R>,
        weight: f64,
    ) {
        let weighted = weight * jacobian.transpose();
        self.matrix += weighted * jacobian;
        self.right -= weighted * residual;
    }
}

impl<const N: usize> Equations for NormalEquations<N> {
    type Step = SVector<f64, N>;

    fn solve(&self, damping: f64) -> Option<DampedStep<Self::Step>> {
        let diagonal = self.matrix.diagonal();
        let mut damped = self.matrix;
        for k in 0..N {
            damped[(k, k)] = damp(diagonal[k], diagonal.sum(), damping);
        }
        let step = damped.cholesky()?.solve(&self.right);
        let predicted_decrease = step.dot(&(damping * diagonal.component_mul(&step) + self.right));
        Some(DampedStep { step, predicted_decrease })
    }
}

/// An element of the diagonal, raised by the share `damping` of itself; of an unobserved unknown, by so little of the
/// block's `trace` that it stays where it is.
pub fn damp(diagonal: f64, trace: f64, damping: f64) -> f64 {
    diagonal + damping * diagonal + 1e-13 * trace.max(1e-9)
}
