//! Normal equations of cameras and points. No observation ties two points, so points are eliminated first (Schur
//! complement) and the factored matrix has the cameras' size.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, MatrixXx3, Vector2, Vector3};

use super::state::{POINT, POSE, RefinementState};
use super::term::LinearisedTerm;

/// `JᵀWJ` in blocks, and `JᵀWr`.
pub(super) struct RefinementEquations {
    cameras: DMatrix<f64>,
    points: Vec<Matrix3<f64>>,
    /// Blocks between the cameras' rows and one point's columns.
    across: Vec<MatrixXx3<f64>>,
    gradient: DVector<f64>,
}

/// Damped normal equations, factored for solving.
pub(super) struct Factored {
    /// Factor of the reduced camera block.
    cameras: Cholesky<f64, Dyn>,
    points: Vec<Point>,
}

/// Back-substitution data of one point.
struct Point {
    /// Inverse of the point's own block.
    inverse: Matrix3<f64>,
    /// The block across times that inverse.
    follows: MatrixXx3<f64>,
}

impl RefinementEquations {
    /// Normal equations without observations.
    pub(super) fn new(state: &RefinementState) -> Self {
        let (cameras, points) = (state.point_at(0), state.points.len());
        Self {
            cameras: DMatrix::zeros(cameras, cameras),
            points: vec![Matrix3::zeros(); points],
            across: vec![MatrixXx3::zeros(cameras); points],
            gradient: DVector::zeros(state.parameters()),
        }
    }

    /// Adds an observation with this weight.
    pub(super) fn add(&mut self, told: &LinearisedTerm, weight: f64) {
        let residual = Vector2::from(told.residual);
        for (a, by_a) in told.cameras() {
            let weighted = by_a.transpose() * weight;
            let mut gradient = self.gradient.fixed_rows_mut::<POSE>(*a);
            gradient += weighted * residual;
            for (b, by_b) in told.cameras() {
                let mut block = self.cameras.fixed_view_mut::<POSE, POSE>(*a, *b);
                block += weighted * by_b;
            }
            if let Some((point, by_point)) = &told.point {
                let mut block = self.across[*point].fixed_rows_mut::<POSE>(*a);
                block += weighted * by_point;
            }
        }
        if let Some((point, by)) = &told.point {
            let weighted = by.transpose() * weight;
            let mut gradient = self.gradient.fixed_rows_mut::<POINT>(self.cameras.nrows() + POINT * point);
            gradient += weighted * residual;
            self.points[*point] += weighted * by;
        }
    }

    /// Adds `damping` times the diagonal and factors; `None` if the matrix is not positive definite.
    pub(super) fn factor(&self, damping: f64) -> Option<Factored> {
        /// Diagonal of unobserved parameters, such as a left-out point, so that they do not move.
        const STILL: f64 = 1e-9;
        let damp = |value: &mut f64| *value += damping * *value + STILL;
        let mut cameras = self.cameras.clone();
        (0..cameras.nrows()).for_each(|i| damp(&mut cameras[(i, i)]));
        let points: Option<Vec<Point>> = self
            .points
            .iter()
            .zip(&self.across)
            .map(|(block, across)| {
                let mut block = *block;
                (0..POINT).for_each(|i| damp(&mut block[(i, i)]));
                let inverse = block.cholesky()?.inverse();
                let follows = across * inverse;
                cameras.gemm(-1.0, &follows, &across.transpose(), 1.0);
                Some(Point { inverse, follows })
            })
            .collect();
        Some(Factored { points: points?, cameras: cameras.cholesky()? })
    }

    /// Half the gradient of the sum of squared residuals.
    pub(super) fn gradient(&self) -> &DVector<f64> {
        &self.gradient
    }
}

impl Factored {
    /// Solves for the parameters with this right side.
    pub(super) fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let cameras = self.cameras.l_dirty().nrows();
        let of_point = |values: &DVector<f64>, i: usize| -> Vector3<f64> {
            values.fixed_rows::<POINT>(cameras + POINT * i).into_owned()
        };
        let mut reduced = right.rows(0, cameras).into_owned();
        for (i, point) in self.points.iter().enumerate() {
            reduced.gemv(-1.0, &point.follows, &of_point(right, i), 1.0);
        }
        let moved = self.cameras.solve(&reduced);
        let mut solved = right.clone();
        solved.rows_mut(0, cameras).copy_from(&moved);
        for (i, point) in self.points.iter().enumerate() {
            let own = point.inverse * of_point(right, i) - point.follows.tr_mul(&moved);
            solved.fixed_rows_mut::<POINT>(cameras + POINT * i).copy_from(&own);
        }
        solved
    }

    /// Variance of one component of an observation: its derivatives around the inverse.
    pub(super) fn variance(&self, told: &LinearisedTerm, side: usize) -> f64 {
        let mut by_cameras = DVector::zeros(self.cameras.l_dirty().nrows());
        for (at, by) in told.cameras() {
            let mut of_camera = by_cameras.fixed_rows_mut::<POSE>(*at);
            of_camera += by.row(side).transpose();
        }
        let mut own = 0.0;
        if let Some((i, by)) = &told.point {
            let by_point = by.row(side).transpose();
            own = by_point.dot(&(self.points[*i].inverse * by_point));
            by_cameras.gemv(-1.0, &self.points[*i].follows, &by_point, 1.0);
        }
        own + by_cameras.dot(&self.cameras.solve(&by_cameras))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Similarity3;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::super::state::{ByCamera, ByPoint};
    use super::*;

    const CAMERAS: usize = 4;
    const POINTS: usize = 9;

    fn none_moved() -> RefinementState {
        RefinementState { poses: vec![Similarity3::identity(); CAMERAS], points: vec![None; POINTS] }
    }

    /// Observations as in a merge: a point from a camera, or from the fixed one, or a camera from another. The last
    /// point is never observed.
    fn observed(rng: &mut Pcg64Mcg) -> Vec<LinearisedTerm> {
        let mut rows = Vec::new();
        for camera in 0..CAMERAS - 1 {
            for point in 0..POINTS - 1 {
                rows.push(random(rng, &[camera], Some(point)));
                rows.push(random(rng, &[], Some(point)));
            }
            rows.push(random(rng, &[camera, (camera + 1) % (CAMERAS - 1)], None));
        }
        rows
    }

    fn random(rng: &mut Pcg64Mcg, cameras: &[usize], point: Option<usize>) -> LinearisedTerm {
        let mut number = |_, _| rng.random_range(-1.0..1.0);
        let cameras: Vec<_> = cameras.iter().map(|c| (c * POSE, ByCamera::from_fn(&mut number))).collect();
        let point = point.map(|p| (p, ByPoint::from_fn(&mut number)));
        LinearisedTerm::of([number(0, 0), number(0, 0)], &cameras, point)
    }

    /// Derivatives of one component by all parameters.
    fn jacobian(state: &RefinementState, told: &LinearisedTerm, side: usize) -> DVector<f64> {
        let mut dense = DVector::zeros(state.parameters());
        for (at, by) in told.cameras() {
            dense.fixed_rows_mut::<POSE>(*at).copy_from(&by.row(side).transpose());
        }
        if let Some((point, by)) = &told.point {
            dense.fixed_rows_mut::<POINT>(state.point_at(*point)).copy_from(&by.row(side).transpose());
        }
        dense
    }

    #[test]
    fn eliminating_points_first_is_solving_all_at_once() {
        let rng = &mut Pcg64Mcg::seed_from_u64(1);
        let state = none_moved();
        let rows = observed(rng);
        for damping in [0.0, 1e-3, 2.0] {
            let mut blocks = RefinementEquations::new(&state);
            let size = state.parameters();
            let (mut dense, mut gradient) = (DMatrix::<f64>::zeros(size, size), DVector::<f64>::zeros(size));
            for row in &rows {
                let weight = rng.random_range(0.1..2.0);
                blocks.add(row, weight);
                for side in 0..2 {
                    let by = jacobian(&state, row, side);
                    gradient += weight * row.residual[side] * &by;
                    dense += weight * &by * by.transpose();
                }
            }
            for i in 0..size {
                dense[(i, i)] += damping * dense[(i, i)] + 1e-9;
            }
            let dense = dense.cholesky().unwrap();
            let factored = blocks.factor(damping).unwrap();
            let off = (factored.solve(blocks.gradient()) - dense.solve(&gradient)).amax();
            assert!(off < 1e-9, "damping {damping}: {off}");
            for row in &rows {
                for side in 0..2 {
                    let by = jacobian(&state, row, side);
                    let expected = by.dot(&dense.solve(&by));
                    let variance = factored.variance(row, side);
                    assert!((variance - expected).abs() < 1e-9, "{variance} instead of {expected}");
                }
            }
        }
    }

    #[test]
    fn infinite_equations_give_no_step() {
        let state = none_moved();
        let mut blocks = RefinementEquations::new(&state);
        let nothing = ByCamera::repeat(f64::NAN);
        blocks.add(&LinearisedTerm::of([1.0, 0.0], &[(0, nothing)], None), 1.0);
        assert!(blocks.factor(1.0).is_none());
    }
}
