//! The normal equations of one step, points eliminated.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3, Vector6};
use rayon::prelude::*;

use super::residual::{self, LensJacobian, PoseMatrix};
use super::{BundleOptions, BundleProblem};

type Block6x3 = SMatrix<f64, 6, 3>;

/// One observation's part of W.
struct PoseEdge {
    pose: usize,
    /// `J_poseᵀ w J_point`.
    w: Block6x3,
}

/// One point's part of the system.
struct PointBlock {
    /// V before damping.
    v: Matrix3<f64>,
    gradient: Vector3<f64>,
    edges: Vec<PoseEdge>,
    /// `J_lensᵀ w J_point`, summed over the point's observations.
    lens: Matrix3<f64>,
}

/// One pose's part of the system.
#[derive(Clone)]
struct PoseBlock {
    /// Upper triangle of U.
    u: SMatrix<f64, 6, 6>,
    gradient: Vector6<f64>,
    /// Block shared with the lens.
    border: Block6x3,
}

impl PoseBlock {
    fn zero() -> Self {
        Self { u: SMatrix::zeros(), gradient: Vector6::zeros(), border: Block6x3::zeros() }
    }
}

/// Number of points whose contributions to the cameras are summed together, so that sums do not depend on the number of
/// threads.
const CHUNK: usize = 128;

/// Contribution of a chunk of points.
struct Chunk {
    points: Vec<PointBlock>,
    poses: Vec<PoseBlock>,
    lens: Matrix3<f64>,
    lens_gradient: Vector3<f64>,
}

impl Chunk {
    fn new(poses: usize) -> Self {
        Self {
            points: Vec::with_capacity(CHUNK),
            poses: vec![PoseBlock::zero(); poses],
            lens: Matrix3::zeros(),
            lens_gradient: Vector3::zeros(),
        }
    }
}

/// Normal equations of one linearisation; solved for several dampings.
pub(super) struct NormalEquations {
    poses: usize,
    lens_count: usize,
    pose_blocks: Vec<PoseBlock>,
    lens_block: Matrix3<f64>,
    lens_gradient: Vector3<f64>,
    points: Vec<PointBlock>,
    /// For each pose: (point, edge within the point).
    seen: Vec<Vec<(usize, usize)>>,
}

/// Solution of the normal equations.
pub(super) struct BundleStep {
    /// Six numbers a pose, then the lens's.
    pub(super) cameras: Vec<f64>,
    pub(super) points: Vec<Vector3<f64>>,
    /// Predicted decrease of the linearised cost.
    pub(super) predicted_gain: f64,
}

/// A column of the inverse matrix.
pub(super) struct Column {
    /// Six numbers a pose, then the lens's.
    pub(super) cameras: Vec<f64>,
    /// Lens's entries again, 0 where it is fixed.
    pub(super) lens: Vector3<f64>,
    pub(super) points: Vec<Vector3<f64>>,
}

impl NormalEquations {
    pub(super) fn build(problem: &BundleProblem, options: &BundleOptions) -> Self {
        let poses = problem.poses.len();
        let matrices = problem.pose_matrices();
        let chunks: Vec<Chunk> = (0..problem.points.len().div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let last = ((chunk + 1) * CHUNK).min(problem.points.len());
                let mut sums = Chunk::new(poses);
                for point in chunk * CHUNK..last {
                    let block = point_block(problem, &matrices, options, point, &mut sums);
                    sums.points.push(block);
                }
                sums
            })
            .collect();
        let mut pose_blocks = vec![PoseBlock::zero(); poses];
        let (mut lens_block, mut lens_gradient) = (Matrix3::zeros(), Vector3::zeros());
        let mut seen = vec![Vec::new(); poses];
        let mut points = Vec::with_capacity(problem.points.len());
        for chunk in chunks {
            for (sum, part) in pose_blocks.iter_mut().zip(&chunk.poses) {
                sum.u += part.u;
                sum.gradient += part.gradient;
                sum.border += part.border;
            }
            lens_block += chunk.lens;
            lens_gradient += chunk.lens_gradient;
            for block in chunk.points {
                for (edge, of) in block.edges.iter().enumerate() {
                    seen[of.pose].push((points.len(), edge));
                }
                points.push(block);
            }
        }
        let lens_count = options.lens.count();
        Self { poses, lens_count, pose_blocks, lens_block, lens_gradient, points, seen }
    }

    /// Solves for the step of one damping (relative to the diagonal); `None` when the reduced matrix is not positive
    /// definite.
    pub(super) fn solve(&self, damping: f64, fixed_pose: usize) -> Option<BundleStep> {
        let inverses = self.inverses(damping)?;
        let (matrix, right) = self.reduced(&inverses, damping, fixed_pose);
        let cameras = matrix.cholesky()?.solve(&right);
        let lens_step = self.lens_step(&cameras);
        let points = self.points_for(&cameras, &inverses, |block| block.gradient);
        let predicted_gain = self.predicted_gain(&cameras, &lens_step, &points, damping);
        Some(BundleStep { cameras: cameras.as_slice().to_vec(), points, predicted_gain })
    }

    fn inverses(&self, damping: f64) -> Option<Vec<Matrix3<f64>>> {
        self.points.iter().map(|p| damped(&p.v, damping).try_inverse()).collect()
    }

    /// Reduced matrix and its right side, the fixed pose's step held at zero.
    fn reduced(
        &self,
        inverses: &[Matrix3<f64>],
        damping: f64,
        fixed_pose: usize,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let size = 6 * self.poses + self.lens_count;
        let rows: Vec<(DMatrix<f64>, Vector6<f64>)> =
            (0..self.poses).into_par_iter().map(|pose| self.reduced_row(pose, damping, inverses)).collect();
        let mut matrix = DMatrix::zeros(size, size);
        let mut right = DVector::zeros(size);
        for (pose, (row, gradient)) in rows.iter().enumerate() {
            matrix.view_mut((6 * pose, 0), (6, size)).copy_from(row);
            right.rows_mut(6 * pose, 6).copy_from(gradient);
        }
        self.add_lens(&mut matrix, &mut right, damping, inverses);
        // Only the upper triangle was summed.
        matrix.fill_lower_triangle_with_upper_triangle();
        // The fixed pose: its rows and columns become the identity's, its step zero.
        for k in 6 * fixed_pose..6 * fixed_pose + 6 {
            matrix.row_mut(k).fill(0.0);
            matrix.column_mut(k).fill(0.0);
            matrix[(k, k)] = 1.0;
            right[k] = 0.0;
        }
        (matrix, right)
    }

    /// Points' part of a solution: `V⁻¹ (right − Wᵀ cameras)`.
    fn points_for(
        &self,
        cameras: &DVector<f64>,
        inverses: &[Matrix3<f64>],
        right: impl Fn(&PointBlock) -> Vector3<f64> + Sync,
    ) -> Vec<Vector3<f64>> {
        let lens_step = self.lens_step(cameras);
        let of_point = |(block, inverse): (&PointBlock, &Matrix3<f64>)| {
            let mut rest = right(block) - block.lens.transpose() * lens_step;
            for edge in &block.edges {
                rest -= edge.w.transpose() * cameras.fixed_rows::<6>(6 * edge.pose);
            }
            inverse * rest
        };
        self.points.par_iter().with_min_len(64).zip(inverses).map(of_point).collect()
    }

    /// Lens's columns of the inverse of the whole matrix. `None` where the lens is fixed or nothing is determined.
    pub(super) fn lens_columns(&self, fixed_pose: usize) -> Option<Vec<Column>> {
        /// Damping that makes the matrix, singular by the free scale, invertible; it does not affect the lens.
        const DAMPING: f64 = 1e-10;
        if self.lens_count == 0 {
            return None;
        }
        let inverses = self.inverses(DAMPING)?;
        let (matrix, _) = self.reduced(&inverses, DAMPING, fixed_pose);
        let factors = matrix.cholesky()?;
        let column = |k: usize| {
            let mut unit = DVector::zeros(6 * self.poses + self.lens_count);
            unit[6 * self.poses + k] = 1.0;
            let cameras = factors.solve(&unit);
            let points = self.points_for(&cameras, &inverses, |_| Vector3::zeros());
            let lens = self.lens_step(&cameras);
            Column { cameras: cameras.as_slice().to_vec(), lens, points }
        };
        Some((0..self.lens_count).map(column).collect())
    }

    fn lens_step(&self, cameras: &DVector<f64>) -> Vector3<f64> {
        Vector3::from_fn(|k, _| if k < self.lens_count { cameras[6 * self.poses + k] } else { 0.0 })
    }

    /// One pose's six rows of the reduced matrix (upper triangle and the lens's border) and its right side.
    fn reduced_row(
        &self,
        pose: usize,
        damping: f64,
        inverses: &[Matrix3<f64>],
    ) -> (DMatrix<f64>, Vector6<f64>) {
        let size = 6 * self.poses + self.lens_count;
        let mut row = DMatrix::zeros(6, size);
        let PoseBlock { u, gradient, border } = &self.pose_blocks[pose];
        let mut right = *gradient;
        let mut lens = *border;
        let mut diagonal = *u;
        for k in 0..6 {
            diagonal[(k, k)] += damping * u[(k, k)].max(1e-9);
        }
        let mut blocks = vec![SMatrix::<f64, 6, 6>::zeros(); self.poses - pose];
        blocks[0] = diagonal;
        for &(point, edge) in &self.seen[pose] {
            let block = &self.points[point];
            let y = block.edges[edge].w * inverses[point];
            right -= y * block.gradient;
            if self.lens_count > 0 {
                lens -= y * block.lens.transpose();
            }
            // Edges are in the order of poses.
            let first =
                block.edges[..edge].iter().rposition(|o| o.pose < pose).map_or(0, |before| before + 1);
            for other in &block.edges[first..] {
                subtract_product(&mut blocks[other.pose - pose], &y, &other.w);
            }
        }
        for (block, other) in blocks.iter().zip(pose..) {
            row.fixed_columns_mut::<6>(6 * other).copy_from(block);
        }
        for k in 0..self.lens_count {
            row.set_column(6 * self.poses + k, &lens.column(k));
        }
        (row, right)
    }

    fn add_lens(
        &self,
        matrix: &mut DMatrix<f64>,
        right: &mut DVector<f64>,
        damping: f64,
        inverses: &[Matrix3<f64>],
    ) {
        if self.lens_count == 0 {
            return;
        }
        let mut block = damped(&self.lens_block, damping);
        let mut gradient = self.lens_gradient;
        for (point, inverse) in self.points.iter().zip(inverses) {
            let y = point.lens * inverse;
            block -= y * point.lens.transpose();
            gradient -= y * point.gradient;
        }
        let start = 6 * self.poses;
        for row in 0..self.lens_count {
            right[start + row] = gradient[row];
            for column in row..self.lens_count {
                matrix[(start + row, start + column)] = block[(row, column)];
            }
        }
    }

    /// `½ δᵀ (damping D δ + g)` doubled, as the cost is Σ ρ without the half.
    fn predicted_gain(
        &self,
        cameras: &DVector<f64>,
        lens_step: &Vector3<f64>,
        points: &[Vector3<f64>],
        damping: f64,
    ) -> f64 {
        let mut gain = 0.0;
        for (pose, PoseBlock { u, gradient, .. }) in self.pose_blocks.iter().enumerate() {
            for k in 0..6 {
                let step = cameras[6 * pose + k];
                gain += step * (damping * u[(k, k)] * step + gradient[k]);
            }
        }
        for k in 0..self.lens_count {
            let step = lens_step[k];
            gain += step * (damping * self.lens_block[(k, k)] * step + self.lens_gradient[k]);
        }
        for (block, step) in self.points.iter().zip(points) {
            for k in 0..3 {
                gain += step[k] * (damping * block.v[(k, k)] * step[k] + block.gradient[k]);
            }
        }
        gain
    }
}

/// `block −= y wᵀ`, column by column: most of the time of a step is spent here.
fn subtract_product(block: &mut SMatrix<f64, 6, 6>, y: &Block6x3, w: &Block6x3) {
    for column in 0..6 {
        for row in 0..6 {
            block[(row, column)] -=
                y[(row, 0)] * w[(column, 0)] + y[(row, 1)] * w[(column, 1)] + y[(row, 2)] * w[(column, 2)];
        }
    }
}

/// Block of a point, its edges by pose; its observations' contributions to poses and lens are added to `sums`.
///
/// A pose's Jacobian is that by the point in camera coordinates times `[I, −[X_c]×]`, a point's the same times the
/// rotation: so all blocks come from `A = w Jᵀ J` of 3 × 3.
fn point_block(
    problem: &BundleProblem,
    poses: &[PoseMatrix],
    options: &BundleOptions,
    point: usize,
    sums: &mut Chunk,
) -> PointBlock {
    let observations = &problem.observations[point];
    let mut block = PointBlock {
        v: Matrix3::zeros(),
        gradient: Vector3::zeros(),
        edges: Vec::with_capacity(observations.len()),
        lens: Matrix3::zeros(),
    };
    for observation in observations {
        let pose = &poses[observation.pose];
        let Some(l) =
            residual::linearise(&problem.intrinsics, pose, &problem.points[point], &observation.pixel)
        else {
            continue;
        };
        let weight = options.loss.weight(l.residual.norm_squared());
        let (j, at) = (&l.by_camera_point, &l.camera_point.coords);
        let weighted = weight * j.transpose();
        let (a, gradient) = (weighted * j, weighted * l.residual);
        let by_point = a * pose.rotation;
        block.v += pose.rotation.tr_mul(&by_point);
        block.gradient -= pose.rotation.tr_mul(&gradient);
        block.edges.push(PoseEdge { pose: observation.pose, w: for_pose(at, &by_point) });
        let sum = &mut sums.poses[observation.pose];
        let turned = crossed(at, &a).transpose();
        add(&mut sum.u, 0, 0, &a);
        add(&mut sum.u, 0, 3, &turned);
        add(&mut sum.u, 3, 3, &crossed(at, &turned));
        sum.gradient -= Vector6::from_iterator(gradient.iter().chain(&at.cross(&gradient)).copied());
        if options.lens.count() > 0 {
            let mut lens: LensJacobian = l.by_lens(&problem.intrinsics);
            for k in options.lens.count()..3 {
                lens.column_mut(k).fill(0.0);
            }
            let by_lens = weighted * lens;
            block.lens += by_lens.tr_mul(&pose.rotation);
            sum.border += for_pose(at, &by_lens);
            sums.lens += weight * lens.transpose() * lens;
            sums.lens_gradient -= weight * lens.transpose() * l.residual;
        }
    }
    block.edges.sort_by_key(|edge| edge.pose);
    block
}

/// `[I, −[x]×]ᵀ m`: contribution of a point in camera coordinates to its camera's pose.
fn for_pose(x: &Vector3<f64>, m: &Matrix3<f64>) -> Block6x3 {
    let mut block = Block6x3::zeros();
    block.fixed_rows_mut::<3>(0).copy_from(m);
    block.fixed_rows_mut::<3>(3).copy_from(&crossed(x, m));
    block
}

/// `[x]× m`.
fn crossed(x: &Vector3<f64>, m: &Matrix3<f64>) -> Matrix3<f64> {
    let column = |k: usize| x.cross(&m.fixed_view::<3, 1>(0, k).into_owned());
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

fn add(sum: &mut SMatrix<f64, 6, 6>, row: usize, column: usize, m: &Matrix3<f64>) {
    let mut block = sum.fixed_view_mut::<3, 3>(row, column);
    block += m;
}

/// A 3 × 3 block with its diagonal raised; the identity for a point without observations.
fn damped(block: &Matrix3<f64>, damping: f64) -> Matrix3<f64> {
    let mut raised = *block;
    let floor = 1e-13 * block.trace().max(1e-9);
    for k in 0..3 {
        raised[(k, k)] += damping * block[(k, k)] + floor;
    }
    raised
}
