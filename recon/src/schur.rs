//! Normal equations of cameras and points. No residual ties two points, so the points are eliminated first (B. Triggs,
//! P. `McLauchlan`, R. Hartley, A. Fitzgibbon, "Bundle adjustment — a modern synthesis", 2000, section 6.1):
//!
//! ```text
//! ┌          ┐ ┌    ┐   ┌    ┐      U: cameras, and a border of up to three parameters that they share
//! │ U     W  │ │ δc │   │ gc │      V: one 3×3 block a point
//! │ Wᵀ    V  │ │ δp │ = │ gp │      W: one N×3 block an observation
//! └          ┘ └    ┘   └    ┘
//!
//! (U − W V⁻¹ Wᵀ) δc = gc − W V⁻¹ gp        the reduced system
//! δp = V⁻¹ (gp − Wᵀ δc)
//! ```
//!
//! Made for up to a few hundred cameras and some ten thousand points: the reduced matrix is dense. All sums run in a
//! fixed order, so the result does not depend on the number of threads. A camera or point without residuals stays where
//! it is.

use calib::least_squares::{DampedStep, Equations, damp};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, SMatrix, SVector, Vector3};
use rayon::prelude::*;

/// One point's part of the equations.
pub struct PointBlock<const N: usize> {
    /// V.
    pub v: Matrix3<f64>,
    /// gp.
    pub right: Vector3<f64>,
    /// W: index of the camera and block of each observation.
    pub edges: Vec<(usize, SMatrix<f64, N, 3>)>,
    /// W of the border: its parameters in rows.
    pub border: Matrix3<f64>,
}

impl<const N: usize> Default for PointBlock<N> {
    fn default() -> Self {
        Self { v: Matrix3::zeros(), right: Vector3::zeros(), edges: Vec::new(), border: Matrix3::zeros() }
    }
}

/// Normal equations of cameras of `N` parameters, their border, and points.
pub struct SchurEquations<const N: usize> {
    /// Upper triangle of U: the cameras, then the border.
    u: DMatrix<f64>,
    /// gc.
    right: DVector<f64>,
    points: Vec<PointBlock<N>>,
    /// Observations of each camera: (point, edge within the point).
    seen: Vec<Vec<(usize, usize)>>,
}

/// Step, or right side, of all unknowns.
#[derive(Debug, Clone, PartialEq)]
pub struct SchurStep {
    /// `N` numbers a camera, then the border's.
    pub cameras: DVector<f64>,
    /// Three numbers a point.
    pub points: Vec<Vector3<f64>>,
}

/// Damped equations, factored.
pub struct Factored<'a, const N: usize> {
    equations: &'a SchurEquations<N>,
    /// Factor of the reduced matrix.
    reduced: Cholesky<f64, Dyn>,
    /// V⁻¹.
    inverses: Vec<Matrix3<f64>>,
}

impl<const N: usize> SchurEquations<N> {
    /// Equations from U (its upper triangle is read), gc and the points' parts.
    pub fn new(cameras: usize, u: DMatrix<f64>, right: DVector<f64>, mut points: Vec<PointBlock<N>>) -> Self {
        let mut seen = vec![Vec::new(); cameras];
        for (index, point) in points.iter_mut().enumerate() {
            point.edges.sort_by_key(|(camera, _)| *camera);
            for (edge, (camera, _)) in point.edges.iter().enumerate() {
                seen[*camera].push((index, edge));
            }
        }
        Self { u, right, points, seen }
    }

    /// Raises the diagonal by the share `damping` and factors; `None` if a matrix is not positive definite.
    pub fn factor(&self, damping: f64) -> Option<Factored<'_, N>> {
        let inverse = |point: &PointBlock<N>| {
            let mut v = point.v;
            v.set_diagonal(&v.diagonal().map(|d| damp(d, v.trace(), damping)));
            v.try_inverse()
        };
        let inverses = self.points.iter().map(inverse).collect::<Option<Vec<_>>>()?;
        let reduced = self.reduced(&inverses, damping).cholesky()?;
        Some(Factored { equations: self, reduced, inverses })
    }

    /// `U − W V⁻¹ Wᵀ`.
    fn reduced(&self, inverses: &[Matrix3<f64>], damping: f64) -> DMatrix<f64> {
        let cameras = self.seen.len();
        let (border, size) = (N * cameras, self.u.nrows());
        let mut matrix = self.u.clone();
        let blocks = (0..cameras).map(|camera| (N * camera, N)).chain([(border, size - border)]);
        for (first, count) in blocks {
            let trace = (first..first + count).map(|k| self.u[(k, k)]).sum();
            (first..first + count).for_each(|k| matrix[(k, k)] = damp(matrix[(k, k)], trace, damping));
        }
        let rows: Vec<DMatrix<f64>> =
            (0..cameras).into_par_iter().map(|camera| self.eliminated_row(camera, inverses)).collect();
        for (camera, row) in rows.iter().enumerate() {
            let mut from_diagonal = matrix.view_mut((N * camera, N * camera), row.shape());
            from_diagonal -= row;
        }
        if size > border {
            let product =
                |(p, inverse): (&PointBlock<N>, &Matrix3<f64>)| p.border * inverse * p.border.transpose();
            let sum: Matrix3<f64> = self.points.iter().zip(inverses).map(product).sum();
            let mut corner = matrix.view_mut((border, border), (size - border, size - border));
            corner -= sum.view((0, 0), (size - border, size - border));
        }
        matrix.fill_lower_triangle_with_upper_triangle();
        matrix
    }

    /// One camera's rows of `W V⁻¹ Wᵀ`, from the diagonal on.
    fn eliminated_row(&self, camera: usize, inverses: &[Matrix3<f64>]) -> DMatrix<f64> {
        let mut blocks = vec![SMatrix::<f64, N, N>::zeros(); self.seen.len() - camera];
        let mut border = SMatrix::<f64, N, 3>::zeros();
        for &(point, edge) in &self.seen[camera] {
            let PointBlock { edges, border: of_point, .. } = &self.points[point];
            let y = edges[edge].1 * inverses[point];
            border += y * of_point.transpose();
            // Edges are in the order of cameras.
            let first =
                edges[..edge].iter().rposition(|(other, _)| *other < camera).map_or(0, |before| before + 1);
            for (other, w) in &edges[first..] {
                add_product(&mut blocks[other - camera], &y, w);
            }
        }
        let mut row = DMatrix::zeros(N, self.u.nrows() - N * camera);
        for (index, block) in blocks.iter().enumerate() {
            row.fixed_columns_mut::<N>(N * index).copy_from(block);
        }
        let shared = row.ncols() - N * blocks.len();
        row.columns_mut(N * blocks.len(), shared).copy_from(&border.columns(0, shared));
        row
    }
}

impl<const N: usize> Equations for SchurEquations<N> {
    type Step = SchurStep;

    fn solve(&self, damping: f64) -> Option<DampedStep<SchurStep>> {
        let right = SchurStep {
            cameras: self.right.clone(),
            points: self.points.iter().map(|point| point.right).collect(),
        };
        let step = self.factor(damping)?.solve(&right);
        let raised = self.u.diagonal().component_mul(&step.cameras) * damping;
        let of_points = self.points.iter().zip(&step.points);
        let predicted_decrease = step.cameras.dot(&(raised + &self.right))
            + of_points
                .map(|(p, step)| step.dot(&(damping * p.v.diagonal().component_mul(step) + p.right)))
                .sum::<f64>();
        Some(DampedStep { step, predicted_decrease })
    }
}

impl<const N: usize> Factored<'_, N> {
    /// Solves for the unknowns with this right side.
    pub fn solve(&self, right: &SchurStep) -> SchurStep {
        let points = &self.equations.points;
        let mut cameras = right.cameras.clone();
        for ((point, inverse), right) in points.iter().zip(&self.inverses).zip(&right.points) {
            eliminate(point, &(inverse * right), &mut cameras);
        }
        self.reduced.solve_mut(&mut cameras);
        let border = N * self.equations.seen.len();
        let shared = Vector3::from_fn(|k, _| cameras.get(border + k).copied().unwrap_or(0.0));
        let of_point = |((point, inverse), right): ((&PointBlock<N>, &Matrix3<f64>), &Vector3<f64>)| {
            let mut rest = right - point.border.tr_mul(&shared);
            for (camera, w) in &point.edges {
                rest -= w.tr_mul(&cameras.fixed_rows::<N>(N * camera));
            }
            inverse * rest
        };
        let moved =
            points.par_iter().with_min_len(64).zip(&self.inverses).zip(&right.points).map(of_point).collect();
        SchurStep { cameras, points: moved }
    }

    /// Variance of a linear function of the unknowns, by its derivatives.
    pub fn variance(
        &self,
        by_cameras: impl Iterator<Item = (usize, SVector<f64, N>)>,
        by_point: Option<(usize, Vector3<f64>)>,
    ) -> f64 {
        let mut cameras = DVector::zeros(self.equations.right.len());
        for (camera, by) in by_cameras {
            let mut of_camera = cameras.fixed_rows_mut::<N>(N * camera);
            of_camera += by;
        }
        let mut own = 0.0;
        if let Some((point, by)) = by_point {
            let solved = self.inverses[point] * by;
            own = by.dot(&solved);
            eliminate(&self.equations.points[point], &solved, &mut cameras);
        }
        own + cameras.dot(&self.reduced.solve(&cameras))
    }
}

/// `cameras −= W solved`, for one point.
fn eliminate<const N: usize>(point: &PointBlock<N>, solved: &Vector3<f64>, cameras: &mut DVector<f64>) {
    for (camera, w) in &point.edges {
        let mut of_camera = cameras.fixed_rows_mut::<N>(N * camera);
        of_camera -= w * solved;
    }
    let of_border = point.border * solved;
    let shared = cameras.len() % N;
    for k in 0..shared {
        let row = cameras.len() - shared + k;
        cameras[row] -= of_border[k];
    }
}

/// `block += y wᵀ`, column by column: most of the time of a step is spent here.
fn add_product<const N: usize>(
    block: &mut SMatrix<f64, N, N>,
    y: &SMatrix<f64, N, 3>,
    w: &SMatrix<f64, N, 3>,
) {
    for column in 0..N {
        for row in 0..N {
            block[(row, column)] +=
                y[(row, 0)] * w[(column, 0)] + y[(row, 1)] * w[(column, 1)] + y[(row, 2)] * w[(column, 2)];
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const N: usize = 7;
    const CAMERAS: usize = 5;
    const POINTS: usize = 9;
    const BORDER: usize = 2;
    const SIZE: usize = N * CAMERAS + BORDER + 3 * POINTS;

    /// Derivatives of one residual: of cameras, the border, and a point.
    struct Row {
        cameras: Vec<(usize, SVector<f64, N>)>,
        border: [f64; BORDER],
        point: Option<(usize, Vector3<f64>)>,
        residual: f64,
    }

    impl Row {
        fn random(rng: &mut Pcg64Mcg, cameras: &[usize], point: Option<usize>) -> Self {
            let mut number = |_, _| rng.random_range(-1.0..1.0);
            Self {
                cameras: cameras.iter().map(|c| (*c, SVector::from_fn(&mut number))).collect(),
                border: [number(0, 0), number(0, 0)],
                point: point.map(|p| (p, Vector3::from_fn(&mut number))),
                residual: number(0, 0),
            }
        }

        fn dense(&self) -> DVector<f64> {
            let mut dense = DVector::zeros(SIZE);
            for (camera, by) in &self.cameras {
                dense.fixed_rows_mut::<N>(N * camera).copy_from(by);
            }
            dense.fixed_rows_mut::<BORDER>(N * CAMERAS).copy_from(&SVector::from(self.border));
            if let Some((point, by)) = &self.point {
                dense.fixed_rows_mut::<3>(N * CAMERAS + BORDER + 3 * point).copy_from(by);
            }
            dense
        }
    }

    /// Residuals of a point and a camera, of a point alone, of two cameras. The last camera and the last point have
    /// none.
    fn rows(rng: &mut Pcg64Mcg) -> Vec<Row> {
        let mut rows = Vec::new();
        for camera in 0..CAMERAS - 1 {
            for point in 0..POINTS - 1 {
                rows.extend([0, 1].map(|_| Row::random(rng, &[camera], Some(point))));
                rows.push(Row::random(rng, &[], Some(point)));
            }
            rows.push(Row::random(rng, &[camera, (camera + 1) % (CAMERAS - 1)], None));
        }
        rows
    }

    fn equations(rows: &[Row]) -> SchurEquations<N> {
        let size = N * CAMERAS + BORDER;
        let (mut u, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
        let mut points: Vec<PointBlock<N>> = (0..POINTS).map(|_| PointBlock::default()).collect();
        for row in rows {
            let of_cameras = row.dense().rows(0, size).into_owned();
            u += &of_cameras * of_cameras.transpose();
            right -= &of_cameras * row.residual;
            if let Some((point, by)) = &row.point {
                let point = &mut points[*point];
                point.v += by * by.transpose();
                point.right -= by * row.residual;
                point.edges.extend(row.cameras.iter().map(|(c, by_camera)| (*c, by_camera * by.transpose())));
                for (k, by_border) in row.border.iter().enumerate() {
                    let mut border = point.border.row_mut(k);
                    border += *by_border * by.transpose();
                }
            }
        }
        SchurEquations::new(CAMERAS, u, right, points)
    }

    #[test]
    fn eliminating_points_first_is_solving_all_at_once() {
        let rng = &mut Pcg64Mcg::seed_from_u64(1);
        let rows = rows(rng);
        let equations = equations(&rows);
        for damping in [1e-9, 1e-3, 2.0] {
            let (mut dense, mut right) = (DMatrix::<f64>::zeros(SIZE, SIZE), DVector::<f64>::zeros(SIZE));
            for row in &rows {
                let by = row.dense();
                right -= &by * row.residual;
                dense += &by * by.transpose();
            }
            for i in 0..SIZE {
                dense[(i, i)] *= 1.0 + damping;
                dense[(i, i)] += 1e-20;
            }
            let cost = |step: &DVector<f64>| -> f64 {
                rows.iter().map(|row| (row.residual + row.dense().dot(step)).powi(2)).sum()
            };
            let dense = dense.cholesky().unwrap();
            let DampedStep { step, predicted_decrease } = equations.solve(damping).unwrap();
            let points = step.points.iter().flat_map(|p| p.iter()).copied();
            let found = DVector::from_iterator(SIZE, step.cameras.iter().copied().chain(points));
            assert!((&found - dense.solve(&right)).amax() < 1e-9, "damping {damping}");
            assert!((predicted_decrease - (cost(&DVector::zeros(SIZE)) - cost(&found))).abs() < 1e-9);
            assert_eq!(step.points[POINTS - 1], Vector3::zeros());
            assert!(step.cameras.rows(N * (CAMERAS - 1), N).iter().all(|v| *v == 0.0));
        }
    }

    #[test]
    fn variances_are_those_of_the_whole_inverse() {
        let rng = &mut Pcg64Mcg::seed_from_u64(2);
        let rows = rows(rng);
        let mut dense = DMatrix::<f64>::zeros(SIZE, SIZE);
        rows.iter().map(Row::dense).for_each(|by| dense += &by * by.transpose());
        for i in 0..SIZE {
            dense[(i, i)] = 1.01 * dense[(i, i)] + 1e-20;
        }
        let (dense, equations) = (dense.cholesky().unwrap(), equations(&rows));
        let factored = equations.factor(0.01).unwrap();
        for (cameras, point) in [(&[1][..], Some(2)), (&[0, 3], None), (&[], Some(4)), (&[2, 1], Some(7))] {
            let row = Row { border: [0.0; BORDER], ..Row::random(rng, cameras, point) };
            let expected = row.dense().dot(&dense.solve(&row.dense()));
            let variance = factored.variance(row.cameras.iter().copied(), row.point);
            assert!((variance - expected).abs() < 1e-9 * expected, "{variance} instead of {expected}");
        }
    }

    #[test]
    fn infinite_equations_give_no_step() {
        let rng = &mut Pcg64Mcg::seed_from_u64(3);
        let mut rows = rows(rng);
        rows[0].cameras[0].1[2] = f64::NAN;
        assert!(equations(&rows).solve(1.0).is_none());
    }
}
