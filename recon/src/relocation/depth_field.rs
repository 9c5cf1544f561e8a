//! Pose of a camera from corners of reference pictures whose depths are wrong together.
//!
//! Neighbouring points of a reconstructed surface have like errors of depth, and a thousand points of one wall tell the
//! pose no better than the wall's depth is known. So each reference picture has an unknown field beside the pose: the
//! logarithm of the factor by which its depths are wrong, bilinear between the nodes of a grid, and one factor for the
//! whole picture. What remains of a point's depth error is its own, and is taken out of its residual: the residual's
//! covariance is `σ² I + v vᵀ` with the projection's displacement `v` by one standard deviation of the depth. A picture of
//! another camera has an unknown pose as well, since the poses of a room are certain to a centimetre.
//!
//! The three deviations (pixels, single depths, the field) are those by which the residuals are most likely, after the
//! unknowns are integrated out about the best solution (Laplace's approximation, as D. MacKay, "Bayesian interpolation",
//! Neural Computation 4, 1992). The pose's covariance is that of the joint problem, so it holds what is not known of the
//! depths.

use calib::Intrinsics;
use calib::least_squares::{
    DampedStep, Equations, Loss, Options, Problem, by_pose, damp, minimise, moved_pose,
};
use calib::relocation::{Doubt, Relocation};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix2, Point3, SMatrix, Vector2, Vector3};

use super::registration::Correspondence;

/// Columns and rows of the field's grid.
const NODES: [usize; 2] = [6, 5];
/// Unknowns of a reference picture's field: its nodes and the common factor.
const FIELD: usize = NODES[0] * NODES[1] + 1;
/// Unknowns of the camera's pose, and of another camera's.
const POSE: usize = 6;
/// Standard deviations of another camera's pose in a room: of each axis of the rotation, radians, and of the position,
/// metres.
const OTHER_SIGMA_RAD: f64 = 0.002;
const OTHER_SIGMA_M: f64 = 0.01;
/// Weighted residual from which on a corner's influence falls, and beyond which it does not agree.
const LOSS: Loss = Loss::Cauchy(2.0);
const AGREES_SIGMAS: f64 = 3.5;
/// Deviations that are tried.
const PIXEL_SIGMAS_PX: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.8];
const DEPTH_FACTORS: [f64; 5] = [0.5, 1.0, 2.0, 4.0, 8.0];
const FIELD_SIGMAS: [f64; 5] = [0.003, 0.01, 0.03, 0.06, 0.12];
/// Deviations that the search begins with, as indices of the lists, and its number of rounds.
const FIRST: [usize; 3] = [2, 2, 2];
const SEARCH_ROUNDS: usize = 2;
/// Number of times that residuals are weighted anew, by the pose found last.
const WEIGHTINGS: usize = 3;
/// Fewest corners that must agree.
const LEAST_AGREEING: usize = 30;

/// Assumed deviations.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sigmas {
    pixel_px: f64,
    depth_factor: f64,
    field: f64,
}

impl Sigmas {
    fn of(indices: [usize; 3]) -> Self {
        let [pixel, depth, field] = indices;
        Self {
            pixel_px: PIXEL_SIGMAS_PX[pixel],
            depth_factor: DEPTH_FACTORS[depth],
            field: FIELD_SIGMAS[field],
        }
    }
}

/// The pose and what is not known of the reference pictures.
#[derive(Debug, Clone)]
struct State {
    pose: Isometry3<f64>,
    /// Fields, then poses of other cameras.
    others: DVector<f64>,
}

/// Weighted reprojection of corners, and how far the unknowns beside the pose are from what is expected.
struct JointReprojection<'a> {
    intrinsics: &'a Intrinsics,
    seen: &'a [Correspondence],
    whitening: Vec<Matrix2<f64>>,
    /// Inverse deviation of each unknown beside the pose.
    prior: DVector<f64>,
    /// First unknown of each reference picture's pose, counted from the first beside the pose; `None` of the camera's own.
    pose_at: Vec<Option<usize>>,
}

/// Derivatives of a corner's residual: a pose's, the field's at up to five unknowns, another pose's.
struct Derivatives {
    pose: SMatrix<f64, 2, 6>,
    field: [(usize, Vector2<f64>); 5],
    other: Option<(usize, SMatrix<f64, 2, 6>)>,
}

impl<'a> JointReprojection<'a> {
    /// Problem of corners; `is_own` tells for each reference picture whether it is the camera's.
    fn new(
        intrinsics: &'a Intrinsics,
        seen: &'a [Correspondence],
        is_own: &[bool],
        field_sigma: f64,
    ) -> Self {
        let mut next = FIELD * is_own.len();
        let pose_at: Vec<Option<usize>> = is_own
            .iter()
            .map(|own| {
                (!own).then(|| {
                    next += POSE;
                    next - POSE
                })
            })
            .collect();
        let prior = DVector::from_fn(next, |k, _| {
            let of_pose = k.checked_sub(FIELD * is_own.len());
            match of_pose {
                None => 1.0 / field_sigma,
                Some(k) if k % POSE < 3 => 1.0 / OTHER_SIGMA_RAD,
                Some(_) => 1.0 / OTHER_SIGMA_M,
            }
        });
        Self { intrinsics, seen, whitening: Vec::new(), prior, pose_at }
    }

    /// Weights the residuals by the uncertainty of pixels and single depths, seen from a state.
    fn weigh(&mut self, state: &State, sigmas: Sigmas) {
        let one = |seen: &Correspondence| {
            let place = state.pose * self.world(seen, state);
            let step = state.pose * seen.from_center * (sigmas.depth_factor * seen.depth_sigma);
            whitening(sigmas.pixel_px, &(self.intrinsics.project_jacobian(&place) * step))
        };
        self.whitening = self.seen.iter().map(one).collect();
    }

    /// Scene point of a corner, moved by the unknowns of its reference picture.
    fn world(&self, seen: &Correspondence, state: &State) -> Point3<f64> {
        let deeper: f64 = nodes(seen).iter().map(|(k, weight)| weight * state.others[*k]).sum();
        let moved = self.pose_at[seen.reference].map_or_else(Vector3::zeros, |at| {
            let step = state.others.fixed_rows::<POSE>(at);
            step.fixed_rows::<3>(0).cross(&seen.from_center) + step.fixed_rows::<3>(3)
        });
        seen.world + seen.from_center * deeper + moved
    }

    fn residual_px(&self, seen: &Correspondence, state: &State) -> Option<Vector2<f64>> {
        Some(self.intrinsics.project(&(state.pose * self.world(seen, state)))? - seen.pixel)
    }

    /// Squared weighted residual of each corner; infinite behind the camera.
    fn squares<'b>(&'b self, state: &'b State) -> impl Iterator<Item = f64> + 'b {
        self.seen.iter().zip(&self.whitening).map(|(seen, whitening)| {
            self.residual_px(seen, state).map_or(f64::INFINITY, |r| (whitening * r).norm_squared())
        })
    }

    fn derivatives(&self, seen: &Correspondence, whitening: &Matrix2<f64>, state: &State) -> Derivatives {
        let place = state.pose * self.world(seen, state);
        let by_place = whitening * self.intrinsics.project_jacobian(&place);
        let by_world = by_place * state.pose.rotation.to_rotation_matrix().matrix();
        let by_depth = by_world * seen.from_center;
        let other = self.pose_at[seen.reference].map(|at| {
            // The step turns about the reference camera's centre.
            (at, by_world * by_pose(&Point3::from(seen.from_center)))
        });
        let field = nodes(seen).map(|(k, weight)| (k, by_depth * weight));
        Derivatives { pose: by_place * by_pose(&place), field, other }
    }
}

/// Unknowns of the field that a corner depends on, with their weights: four nodes around it and the common factor.
fn nodes(seen: &Correspondence) -> [(usize, f64); 5] {
    let along = |place: f64, count: usize| {
        let at = place.clamp(0.0, 1.0) * (count - 1) as f64;
        let first = (at as usize).min(count - 2);
        (first, at - first as f64)
    };
    let (column, x) = along(seen.place.x, NODES[0]);
    let (row, y) = along(seen.place.y, NODES[1]);
    let first = FIELD * seen.reference;
    let node = |dx: usize, dy: usize| first + (row + dy) * NODES[0] + column + dx;
    [
        (node(0, 0), (1.0 - x) * (1.0 - y)),
        (node(1, 0), x * (1.0 - y)),
        (node(0, 1), (1.0 - x) * y),
        (node(1, 1), x * y),
        (first + FIELD - 1, 1.0),
    ]
}

/// Inverse square root of the covariance `σ² I + v vᵀ`.
fn whitening(sigma: f64, v: &Vector2<f64>) -> Matrix2<f64> {
    let squared = v.norm_squared();
    let plain = Matrix2::identity() / sigma;
    if !(squared.is_finite() && squared > f64::MIN_POSITIVE) {
        return plain;
    }
    let along = 1.0 - sigma / (sigma * sigma + squared).sqrt();
    plain - v * v.transpose() * (along / (squared * sigma))
}

/// Normal equations of a joint problem.
struct JointEquations {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl JointEquations {
    fn add(&mut self, derivatives: &Derivatives, residual: &Vector2<f64>, weight: f64) {
        let mut columns: Vec<(usize, Vector2<f64>)> = Vec::with_capacity(2 * POSE + 5);
        columns.extend((0..POSE).map(|k| (k, derivatives.pose.column(k).into_owned())));
        columns.extend(derivatives.field.iter().map(|(k, by)| (POSE + k, *by)));
        if let Some((at, by)) = &derivatives.other {
            columns.extend((0..POSE).map(|k| (POSE + at + k, by.column(k).into_owned())));
        }
        for (i, by_i) in &columns {
            self.right[*i] -= weight * by_i.dot(residual);
            for (j, by_j) in &columns {
                self.matrix[(*i, *j)] += weight * by_i.dot(by_j);
            }
        }
    }
}

impl Equations for JointEquations {
    type Step = DVector<f64>;

    fn solve(&self, damping: f64) -> Option<DampedStep<DVector<f64>>> {
        let (diagonal, trace) = (self.matrix.diagonal(), self.matrix.trace());
        let mut damped = self.matrix.clone();
        for k in 0..diagonal.len() {
            damped[(k, k)] = damp(diagonal[k], trace, damping);
        }
        let step = damped.cholesky()?.solve(&self.right);
        let predicted_decrease = step.dot(&(damping * diagonal.component_mul(&step) + &self.right));
        Some(DampedStep { step, predicted_decrease })
    }
}

impl Problem for JointReprojection<'_> {
    type State = State;
    type Equations = JointEquations;

    fn cost(&self, state: &State) -> f64 {
        let priors = state.others.component_mul(&self.prior).norm_squared();
        self.squares(state).map(|squared| LOSS.cost(squared)).sum::<f64>() + priors
    }

    fn linearise(&self, state: &State) -> JointEquations {
        let size = POSE + state.others.len();
        let mut equations =
            JointEquations { matrix: DMatrix::zeros(size, size), right: DVector::zeros(size) };
        for (seen, whitening) in self.seen.iter().zip(&self.whitening) {
            let Some(residual) = self.residual_px(seen, state) else { continue };
            let residual = whitening * residual;
            let weight = LOSS.weight(residual.norm_squared());
            equations.add(&self.derivatives(seen, whitening, state), &residual, weight);
        }
        for (k, inverse) in self.prior.iter().enumerate() {
            equations.matrix[(POSE + k, POSE + k)] += inverse * inverse;
            equations.right[POSE + k] -= inverse * inverse * state.others[k];
        }
        equations
    }

    fn moved(&self, state: &State, step: &DVector<f64>) -> State {
        State {
            pose: moved_pose(&state.pose, step.rows(0, POSE).as_slice()),
            others: &state.others + step.rows(POSE, state.others.len()),
        }
    }
}

/// Solution with some deviations.
struct Solution<'a> {
    problem: JointReprojection<'a>,
    state: State,
    /// −2 log of the residuals' probability, without what does not depend on the deviations.
    unlikeliness: f64,
}

fn solution<'a>(
    intrinsics: &'a Intrinsics,
    seen: &'a [Correspondence],
    is_own: &[bool],
    start: &Isometry3<f64>,
    sigmas: Sigmas,
) -> Solution<'a> {
    let mut problem = JointReprojection::new(intrinsics, seen, is_own, sigmas.field);
    let mut state = State { pose: *start, others: DVector::zeros(problem.prior.len()) };
    for _ in 0..WEIGHTINGS {
        problem.weigh(&state, sigmas);
        minimise(&problem, &mut state, &Options { cost_tolerance: 1e-8, ..Options::default() });
    }
    // Twice the logarithms of the deviations: of residuals, of expectations; then the volume of the solution.
    let residuals: f64 =
        problem.whitening.iter().map(|w| -2.0 * w.determinant().abs().max(f64::MIN_POSITIVE).ln()).sum();
    let expectations: f64 = problem.prior.iter().map(|inverse| -2.0 * inverse.ln()).sum();
    let cholesky = problem.linearise(&state).matrix.cholesky();
    let volume =
        cholesky.map_or(f64::INFINITY, |c| 2.0 * c.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>());
    let unlikeliness = problem.cost(&state) + residuals + expectations + volume;
    Solution { problem, state, unlikeliness }
}

/// Estimates the pose near `start`; `is_own` tells for each reference picture whether it is the camera's. `matches` is
/// the number of points that were recognised by their looks.
///
/// # Errors
/// [`Doubt`] where too few corners agree, or where the pose is not certain enough.
pub(super) fn pose(
    intrinsics: &Intrinsics,
    seen: &[Correspondence],
    is_own: &[bool],
    start: &Isometry3<f64>,
    matches: usize,
) -> Result<Relocation, Doubt> {
    if seen.len() < LEAST_AGREEING {
        return Err(Doubt::Unrecognised { agreeing: seen.len(), matches });
    }
    let mut indices = FIRST;
    let mut best = solution(intrinsics, seen, is_own, start, Sigmas::of(indices));
    for _ in 0..SEARCH_ROUNDS {
        let before = indices;
        for which in 0..indices.len() {
            for value in 0..PIXEL_SIGMAS_PX.len() {
                let mut tried = indices;
                tried[which] = value;
                if tried == indices {
                    continue;
                }
                let other = solution(intrinsics, seen, is_own, &best.state.pose, Sigmas::of(tried));
                if other.unlikeliness < best.unlikeliness {
                    (best, indices) = (other, tried);
                }
            }
        }
        if indices == before {
            break;
        }
    }
    tracing::debug!("deviations {:?}", Sigmas::of(indices));
    told(&best, matches)
}

/// The pose with its uncertainty.
fn told(best: &Solution<'_>, matches: usize) -> Result<Relocation, Doubt> {
    let Solution { problem, state, .. } = best;
    let squares: Vec<f64> = problem.squares(state).collect();
    let agreeing = squares.iter().filter(|s| **s < AGREES_SIGMAS * AGREES_SIGMAS).count();
    if agreeing < LEAST_AGREEING {
        return Err(Doubt::Unrecognised { agreeing, matches });
    }
    let Some(covariance) = problem.linearise(state).matrix.try_inverse() else {
        return Err(Doubt::Crowded { agreeing });
    };
    let weighted: f64 = squares.iter().filter(|s| s.is_finite()).map(|s| LOSS.weight(*s) * s).sum();
    let weights: f64 = squares.iter().filter(|s| s.is_finite()).map(|s| LOSS.weight(*s)).sum();
    let variance = (weighted / (2.0 * weights).max(1.0)).max(1.0);
    let sum = |first: usize| (first..first + 3).map(|k| covariance[(k, k)]).sum::<f64>() * variance;
    let (turn, shift) = (sum(0), sum(3));
    let (mut squared_px, mut distances_m) = (0.0, Vec::with_capacity(agreeing));
    for (seen, _) in problem.seen.iter().zip(&squares).filter(|(_, s)| **s < AGREES_SIGMAS * AGREES_SIGMAS) {
        squared_px += problem.residual_px(seen, state).map_or(0.0, |r| r.norm_squared());
        distances_m.push((state.pose * seen.world).coords.norm());
    }
    distances_m.sort_by(f64::total_cmp);
    let found = Relocation {
        camera_from_world: state.pose,
        sigma_m: shift.max(0.0).sqrt(),
        sigma_deg: turn.max(0.0).sqrt().to_degrees(),
        matches,
        agreeing,
        rms_px: (squared_px / agreeing as f64).sqrt(),
    };
    found.certain(distances_m[distances_m.len() / 2])
}
