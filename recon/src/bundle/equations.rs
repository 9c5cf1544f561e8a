//! Normal equations of a bundle problem at a state. The first pose is fixed: none of its derivatives enter, or those by its
//! rotation alone.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3, Vector6};
use rayon::prelude::*;

use super::residual::{self, LensJacobian, PoseMatrix};
use super::{BundleProblem, BundleState};
use crate::schur::{PointBlock, SchurEquations};

/// Number of parameters of a pose.
pub(super) const POSE: usize = 6;

type Block6x3 = SMatrix<f64, POSE, 3>;

/// One pose's part of the system.
#[derive(Clone, Default)]
struct PoseBlock {
    /// Upper triangle of U.
    u: SMatrix<f64, POSE, POSE>,
    right: Vector6<f64>,
    /// Block shared with the lens.
    border: Block6x3,
}

/// Number of points whose contributions to the cameras are summed together, so that sums do not depend on the number of
/// threads.
const CHUNK: usize = 128;

/// Contribution of a chunk of points.
struct Chunk {
    points: Vec<PointBlock<POSE>>,
    poses: Vec<PoseBlock>,
    lens: Matrix3<f64>,
    lens_right: Vector3<f64>,
}

impl Chunk {
    fn new(poses: usize) -> Self {
        Self {
            points: Vec::with_capacity(CHUNK),
            poses: vec![PoseBlock::default(); poses],
            lens: Matrix3::zeros(),
            lens_right: Vector3::zeros(),
        }
    }
}

/// Linearises a problem: poses are the cameras, the free lens their border.
pub(super) fn equations(problem: &BundleProblem, state: &BundleState) -> SchurEquations<POSE> {
    let poses = state.poses.len();
    let matrices = state.pose_matrices();
    let chunks: Vec<Chunk> = (0..state.points.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let last = ((chunk + 1) * CHUNK).min(state.points.len());
            let mut sums = Chunk::new(poses);
            for point in chunk * CHUNK..last {
                let block = point_block(problem, state, &matrices, point, &mut sums);
                sums.points.push(block);
            }
            sums
        })
        .collect();
    let free = problem.options.lens.count();
    let (border, size) = (POSE * poses, POSE * poses + free);
    let (mut u, mut right) = (DMatrix::zeros(size, size), DVector::zeros(size));
    let mut points = Vec::with_capacity(state.points.len());
    for chunk in chunks {
        for (pose, part) in chunk.poses.iter().enumerate() {
            let mut block = u.fixed_view_mut::<POSE, POSE>(POSE * pose, POSE * pose);
            block += part.u;
            let mut shared = u.view_mut((POSE * pose, border), (POSE, free));
            shared += part.border.columns(0, free);
            let mut of_pose = right.fixed_rows_mut::<POSE>(POSE * pose);
            of_pose += part.right;
        }
        let mut lens = u.view_mut((border, border), (free, free));
        lens += chunk.lens.view((0, 0), (free, free));
        let mut of_lens = right.rows_mut(border, free);
        of_lens += chunk.lens_right.rows(0, free);
        points.extend(chunk.points);
    }
    let ([k1, k2], prior) = (state.intrinsics.distortion.leading(), problem.options.lens.prior());
    for (k, (weight, off)) in prior.into_iter().zip([0.0, k1, k2]).enumerate().take(free) {
        u[(border + k, border + k)] += weight;
        right[border + k] -= weight * off;
    }
    SchurEquations::new(poses, u, right, points)
}

/// Block of a point; its observations' contributions to poses and lens are added to `sums`.
///
/// A pose's Jacobian is that by the point in camera coordinates times `[−[X_c]×, I]`, a point's the same times the
/// rotation: so all blocks come from `A = w Jᵀ J` of 3 × 3.
fn point_block(
    problem: &BundleProblem,
    state: &BundleState,
    poses: &[PoseMatrix],
    point: usize,
    sums: &mut Chunk,
) -> PointBlock<POSE> {
    let BundleProblem { observations, on_plane, options } = problem;
    let mut block = PointBlock::default();
    block.edges.reserve_exact(observations[point].len());
    for observation in &observations[point] {
        let pose = &poses[observation.pose];
        let Some(l) = residual::linearise(&state.intrinsics, pose, &state.points[point], &observation.pixel)
        else {
            continue;
        };
        let precision = observation.precision;
        let weight = precision * options.loss.weight(precision * l.residual.norm_squared());
        let (j, at) = (&l.by_camera_point, &l.camera_point.coords);
        let weighted = weight * j.transpose();
        let (a, gradient) = (weighted * j, weighted * l.residual);
        let by_point = a * pose.rotation;
        block.v += pose.rotation.tr_mul(&by_point);
        block.right -= pose.rotation.tr_mul(&gradient);
        let is_first = observation.pose == 0;
        let sum = (!is_first || !on_plane.is_empty()).then(|| &mut sums.poses[observation.pose]);
        let mut border = Block6x3::zeros();
        if options.lens.count() > 0 {
            let mut lens: LensJacobian = l.by_lens(&state.intrinsics);
            for k in options.lens.count()..3 {
                lens.column_mut(k).fill(0.0);
            }
            let by_lens = weighted * lens;
            block.border += by_lens.tr_mul(&pose.rotation);
            border = for_pose(at, &by_lens);
            sums.lens += weight * lens.transpose() * lens;
            sums.lens_right -= weight * lens.transpose() * l.residual;
        }
        if let Some(sum) = sum {
            let turned = crossed(at, &a);
            add(&mut sum.u, 0, 0, &crossed(at, &turned.transpose()));
            let (mut edge, mut by_shift) = (for_pose(at, &by_point), gradient);
            if is_first {
                edge.fixed_rows_mut::<3>(3).fill(0.0);
                border.fixed_rows_mut::<3>(3).fill(0.0);
                by_shift.fill(0.0);
            } else {
                add(&mut sum.u, 0, 3, &turned);
                add(&mut sum.u, 3, 3, &a);
            }
            block.edges.push((observation.pose, edge));
            sum.right -= Vector6::from_iterator(at.cross(&gradient).iter().chain(&by_shift).copied());
            sum.border += border;
        }
    }
    if let Some(precision) = on_plane.get(point) {
        let height = state.points[point].z;
        let weight = precision * options.loss.weight(precision * height * height);
        block.v[(2, 2)] += weight;
        block.right.z -= weight * height;
    }
    block
}

/// `[−[x]×, I]ᵀ m`: contribution of a point in camera coordinates to its camera's pose.
fn for_pose(x: &Vector3<f64>, m: &Matrix3<f64>) -> Block6x3 {
    let mut block = Block6x3::zeros();
    block.fixed_rows_mut::<3>(0).copy_from(&crossed(x, m));
    block.fixed_rows_mut::<3>(3).copy_from(m);
    block
}

/// `[x]× m`.
fn crossed(x: &Vector3<f64>, m: &Matrix3<f64>) -> Matrix3<f64> {
    let column = |k: usize| x.cross(&m.fixed_view::<3, 1>(0, k).into_owned());
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

fn add(sum: &mut SMatrix<f64, POSE, POSE>, row: usize, column: usize, m: &Matrix3<f64>) {
    let mut block = sum.fixed_view_mut::<3, 3>(row, column);
    block += m;
}
