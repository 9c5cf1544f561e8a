//! One observation: its residual, in standard deviations, and its derivatives by cameras and points.
//!
//! All residuals are functions of a point's position in a camera's frame, `y = Rᵀ (X − t) / s`, so all derivatives are
//! products of one row with `Rᵀ / s`, that by the point, and with the point's own by a camera's parameters.

use calib::least_squares::{Loss, by_similarity};
use nalgebra::{Matrix3, Point3, RowVector3, SMatrix, Similarity3};

use super::state::{ByCamera, ByPoint, RefinementState};
use super::{LiftedPick, Refinement};

/// An observation that constrains a camera and a point.
pub(super) enum Term<'a> {
    Pixel(&'a LiftedPick),
    /// A depth and its relative standard deviation.
    Depth(&'a LiftedPick, (f64, f64)),
}

/// A residual (the second component is 0 except for pixels) and its derivatives.
#[derive(Default)]
pub(super) struct LinearisedTerm {
    pub(super) residual: [f64; 2],
    /// Derivative by a camera, with the camera's index; none for the fixed camera.
    pub(super) camera: Option<(usize, ByCamera)>,
    /// Derivative by a point, with the point's index.
    pub(super) point: Option<(usize, ByPoint)>,
}

/// Residual of a point behind a camera.
const BEHIND: [f64; 2] = [1e3, 1e3];

/// All observations.
pub(super) fn terms(picks: &[LiftedPick]) -> Vec<Term<'_>> {
    let depths = picks.iter().filter_map(|p| Some(Term::Depth(p, p.depth?)));
    picks.iter().map(Term::Pixel).chain(depths).collect()
}

impl Term<'_> {
    /// Cauchy's loss. Depths measured at corners often belong to another surface, so their influence falls earlier.
    pub(super) fn loss(&self) -> Loss {
        Loss::Cauchy(match self {
            Term::Pixel(_) => 3.0,
            Term::Depth(..) => 1.5,
        })
    }
}

impl Refinement<'_> {
    pub(super) fn residual(&self, state: &RefinementState, term: &Term<'_>) -> [f64; 2] {
        match term {
            Term::Pixel(pick) => {
                let Some(seen) = state.seen(pick) else { return [0.0; 2] };
                let Some(pixel) = self.surfaces[pick.camera].intrinsics.project(&seen) else { return BEHIND };
                let off = (pixel - pick.pixel) / self.pick_sigma_px();
                [off.x, off.y]
            }
            Term::Depth(pick, (depth, sigma)) => {
                let Some(seen) = state.seen(pick) else { return [0.0; 2] };
                if seen.z <= 0.0 {
                    return BEHIND;
                }
                [(seen.z / depth).ln() / (sigma * self.factors.depth[pick.camera]), 0.0]
            }
        }
    }

    /// The residual with its derivatives; without derivatives where it is constant, such as behind a camera.
    pub(super) fn linearised(&self, state: &RefinementState, term: &Term<'_>) -> LinearisedTerm {
        let mut told = LinearisedTerm { residual: self.residual(state, term), ..LinearisedTerm::default() };
        if told.residual == BEHIND {
            return told;
        }
        match term {
            Term::Pixel(pick) => {
                if let Some(seen) = state.seen(pick) {
                    let rows =
                        self.surfaces[pick.camera].intrinsics.project_jacobian(&seen) / self.pick_sigma_px();
                    told.seen_by(state, pick, &seen, &rows);
                }
            }
            Term::Depth(pick, (_, sigma)) => {
                if let Some(seen) = state.seen(pick) {
                    let sigma = sigma * self.factors.depth[pick.camera];
                    let by_depth = RowVector3::new(0.0, 0.0, 1.0 / (seen.z * sigma));
                    told.seen_by(state, pick, &seen, &alone(&by_depth));
                }
            }
        }
        told
    }
}

impl LinearisedTerm {
    /// Sets the derivatives by the pose of a pick's camera and by its point, at `seen` in the camera's frame; `rows`
    /// are derivatives by the latter.
    fn seen_by(
        &mut self,
        state: &RefinementState,
        pick: &LiftedPick,
        seen: &Point3<f64>,
        rows: &SMatrix<f64, 2, 3>,
    ) {
        let pose = &state.poses[pick.camera];
        let by_point = rows * turned_back(pose);
        // The first camera is fixed.
        let by_camera = || (pick.camera, -by_point * by_similarity(&(pose * seen)));
        self.camera = (pick.camera > 0).then(by_camera);
        self.point = Some((pick.point, by_point));
    }
}

/// Derivatives of a scalar residual.
fn alone(row: &RowVector3<f64>) -> SMatrix<f64, 2, 3> {
    SMatrix::from_rows(&[*row, RowVector3::zeros()])
}

impl RefinementState {
    /// Position of a pick's point in its camera's frame; `None` when the point was left out.
    fn seen(&self, pick: &LiftedPick) -> Option<Point3<f64>> {
        Some(self.poses[pick.camera].inverse() * self.points[pick.point]?)
    }
}

/// Derivative of a point in a camera's frame by the point in the common frame: `Rᵀ / s`.
fn turned_back(pose: &Similarity3<f64>) -> Matrix3<f64> {
    pose.isometry.rotation.inverse().to_rotation_matrix().into_inner() / pose.scaling()
}

pub(super) fn norm(residual: [f64; 2]) -> f64 {
    residual[0].hypot(residual[1])
}

#[cfg(test)]
mod tests {
    use nalgebra::{DVector, Point2, Vector3};

    use super::super::state::POSE;
    use super::super::variance::Factors;
    use super::*;
    use crate::merge::MergeOptions;
    use crate::merge::tests::surface;
    use crate::schur::SchurStep;

    fn pose(turn: [f64; 3], at: [f64; 3], scale: f64) -> Similarity3<f64> {
        Similarity3::new(at.into(), turn.into(), scale)
    }

    #[test]
    fn derivatives_are_those_of_central_differences() {
        const STEP: f64 = 1e-6;
        let surfaces = [0, 1, 0].map(surface);
        let options = MergeOptions::default();
        let scene = Refinement { surfaces: &surfaces, options: &options, factors: Factors::loose(3) };
        let state = RefinementState {
            poses: vec![
                Similarity3::identity(),
                pose([0.3, -0.5, 0.2], [1.0, -0.4, 0.3], 1.7),
                pose([-0.2, 0.4, 0.1], [-0.6, 0.2, -0.5], 0.6),
            ],
            points: vec![None, Some(Point3::new(0.4, -0.3, 5.0)), Some(Point3::new(0.2, 0.1, -30.0))],
        };
        let pick = |point: usize, camera: usize| LiftedPick {
            point,
            camera,
            pixel: Point2::new(300.0, 250.0),
            seen: None,
            depth: Some((4.0, 0.02)),
            frames: Vec::new(),
        };
        let picks: Vec<LiftedPick> =
            (0..3).flat_map(|point| (0..3).map(move |camera| pick(point, camera))).collect();
        let (cameras, size) = (3 * POSE, 3 * POSE + 3 * 3);
        let mut compared = 0;
        for term in terms(&picks) {
            let told = scene.linearised(&state, &term);
            let mut analytic = vec![[0.0; 2]; size];
            let by_cameras = told.camera.iter().flat_map(|(camera, by)| {
                (0..POSE).map(move |k| (POSE * camera + k, by.column(k).into_owned()))
            });
            let by_point = told.point.iter().flat_map(|(point, by)| {
                (0..3).map(move |k| (cameras + 3 * point + k, by.column(k).into_owned()))
            });
            for (at, by) in by_cameras.chain(by_point) {
                analytic[at] = by.into();
                compared += 1;
            }
            for (at, analytic) in analytic.iter().enumerate() {
                let nudged = |by: f64| {
                    let step = DVector::from_fn(size, |i, _| if i == at { by } else { 0.0 });
                    let points =
                        step.as_slice()[cameras..].chunks(3).map(Vector3::from_column_slice).collect();
                    let step = SchurStep { cameras: step.rows(0, cameras).into_owned(), points };
                    scene.residual(&state.moved(&step), &term)
                };
                let (plus, minus) = (nudged(STEP), nudged(-STEP));
                for side in 0..2 {
                    let difference = (plus[side] - minus[side]) / (2.0 * STEP);
                    let tolerance = 1e-5 * difference.abs().max(1.0);
                    assert!(
                        (difference - analytic[side]).abs() < tolerance,
                        "parameter {at}: {difference} by differences, {} told",
                        analytic[side]
                    );
                }
            }
        }
        // Of the second point, which is behind all cameras, nothing is seen.
        assert_eq!(compared, 2 * (2 * POSE + 3 * 3), "derivatives that are not zero by construction");
    }
}
