//! Minimisation of problems with known minima.

use std::cell::Cell;

use nalgebra::{Isometry3, Point3, SMatrix, SVector, Similarity3, Vector2, Vector3};
use proptest::prelude::*;

use super::*;

type Function<const N: usize, T> = Box<dyn Fn(&SVector<f64, N>) -> T>;

/// Problem of `N` unknowns by closures for `M` residuals and their derivatives.
struct Closures<const N: usize, const M: usize> {
    residuals: Function<N, SVector<f64, M>>,
    jacobian: Function<N, SMatrix<f64, M, N>>,
    linearised: Cell<usize>,
}

impl<const N: usize, const M: usize> Problem for Closures<N, M> {
    type State = SVector<f64, N>;
    type Equations = NormalEquations<N>;

    fn cost(&self, state: &Self::State) -> f64 {
        (self.residuals)(state).norm_squared()
    }

    fn linearise(&self, state: &Self::State) -> NormalEquations<N> {
        self.linearised.set(self.linearised.get() + 1);
        let mut equations = NormalEquations::default();
        equations.add(&(self.jacobian)(state), &(self.residuals)(state), 1.0);
        equations
    }

    fn moved(&self, state: &Self::State, step: &SVector<f64, N>) -> Self::State {
        state + step
    }
}

fn problem<const N: usize, const M: usize>(
    residuals: impl Fn(&SVector<f64, N>) -> SVector<f64, M> + 'static,
    jacobian: impl Fn(&SVector<f64, N>) -> SMatrix<f64, M, N> + 'static,
) -> Closures<N, M> {
    Closures { residuals: Box::new(residuals), jacobian: Box::new(jacobian), linearised: Cell::new(0) }
}

/// A line's four residuals `a + b x − y`, which no line makes zero.
fn line() -> (SMatrix<f64, 4, 2>, SVector<f64, 4>) {
    let [xs, ys] = [[0.0, 1.0, 2.0, 4.0], [1.0, 3.2, 4.8, 9.3]].map(SVector::<f64, 4>::from);
    (SMatrix::from_columns(&[SVector::repeat(1.0), xs]), ys)
}

#[test]
fn one_undamped_step_solves_a_linear_problem() {
    let (a, b) = line();
    let exact = (a.transpose() * a).try_inverse().unwrap() * a.transpose() * b;
    let mut state = Vector2::new(-50.0, 80.0);
    let undamped = Options { max_iterations: 1, initial_damping: 1e-12, ..Options::default() };
    let report = minimise(&problem(move |x| a * x - b, move |_| a), &mut state, &undamped);
    assert!((state - exact).norm() < 1e-9, "{state}");
    assert_eq!((report.iterations, report.termination), (1, Termination::IterationLimit));

    let report = minimise(&problem(move |x| a * x - b, move |_| a), &mut state, &Options::default());
    assert!(report.converged() && report.iterations <= 3, "{report:?}");
    assert!((report.final_cost - (a * exact - b).norm_squared()).abs() < 1e-12);
}

#[test]
fn the_predicted_decrease_of_a_linear_problem_is_exact() {
    let (a, b) = line();
    let start = Vector2::new(-2.0, 5.0);
    let linear = problem(move |x| a * x - b, move |_| a);
    for damping in [1e-6, 0.1, 30.0] {
        let DampedStep { step, predicted_decrease } = linear.linearise(&start).solve(damping).unwrap();
        let decrease = linear.cost(&start) - linear.cost(&(start + step));
        assert!(
            (predicted_decrease / decrease - 1.0).abs() < 1e-9,
            "{damping}: {predicted_decrease} {decrease}"
        );
    }
}

#[test]
fn rosenbrocks_valley_is_followed_to_its_end() {
    let rosenbrock = problem(
        |s: &Vector2<f64>| Vector2::new(1.0 - s.x, 10.0 * (s.y - s.x * s.x)),
        |s| SMatrix::<f64, 2, 2>::new(-1.0, 0.0, -20.0 * s.x, 10.0),
    );
    let mut state = Vector2::new(-1.2, 1.0);
    let report = minimise(&rosenbrock, &mut state, &Options::default());
    assert!((state - Vector2::new(1.0, 1.0)).norm() < 1e-9, "{state} {report:?}");
    assert!((report.initial_cost - 24.2).abs() < 1e-9 && report.converged());
    // A refused step is solved again with more damping, not linearised again.
    assert!(rosenbrock.linearised.get() < report.iterations, "{report:?}");
}

#[test]
fn unknowns_that_are_not_determined_stay_near_their_start() {
    // Only the sum of the first two is observed; the third is not at all.
    let sum = problem(
        |s: &Vector3<f64>| SVector::<f64, 1>::new(s.x + s.y - 4.0),
        |_| SMatrix::<f64, 1, 3>::new(1.0, 1.0, 0.0),
    );
    let mut state = Vector3::new(1.0, 2.0, 7.0);
    let report = minimise(&sum, &mut state, &Options::default());
    assert!(report.converged() && report.final_cost < 1e-12, "{report:?}");
    assert!((state - Vector3::new(1.5, 2.5, 7.0)).norm() < 1e-5, "{state}");

    let nothing = problem(|_: &Vector2<f64>| Vector2::new(1.0, 1.0), |_| SMatrix::<f64, 2, 2>::zeros());
    let mut state = Vector2::new(3.0, 4.0);
    let report = minimise(&nothing, &mut state, &Options::default());
    assert_eq!(state, Vector2::new(3.0, 4.0));
    assert!(report.converged(), "{report:?}");
}

#[test]
fn starts_without_residual_or_cost_are_left_alone() {
    let (a, _) = line();
    let exact = problem(move |x| a * x, move |_| a);
    let mut state = Vector2::zeros();
    let report = minimise(&exact, &mut state, &Options::default());
    assert_eq!((state, report.iterations, report.termination), (Vector2::zeros(), 0, Termination::Converged));

    for bad in [f64::NAN, f64::INFINITY] {
        let mut state = Vector2::new(bad, 1.0);
        let report = minimise(&exact, &mut state, &Options::default());
        assert_eq!((report.iterations, report.termination), (0, Termination::InvalidStart));
        assert_eq!(state.y.to_bits(), 1.0_f64.to_bits());
    }
}

#[test]
fn steps_into_states_without_a_cost_are_refused() {
    // √x = ½: an undamped step from 4 ends at −2, where there is no root.
    let root = problem(
        |s: &SVector<f64, 1>| SVector::<f64, 1>::new(s.x.sqrt() - 0.5),
        |s| SMatrix::<f64, 1, 1>::new(0.5 / s.x.sqrt()),
    );
    let mut state = SVector::<f64, 1>::new(4.0);
    let report = minimise(&root, &mut state, &Options::default());
    assert!((state.x - 0.25).abs() < 1e-6, "{state} {report:?}");

    // Derivatives of the wrong sign: no step goes down.
    let uphill = problem(|s: &SVector<f64, 1>| *s, |_| SMatrix::<f64, 1, 1>::new(-1.0));
    let mut state = SVector::<f64, 1>::new(1.0);
    let report = minimise(&uphill, &mut state, &Options::default());
    assert_eq!((state.x, report.termination), (1.0, Termination::NoDescent));
    assert_eq!(report.final_cost.to_bits(), report.initial_cost.to_bits());
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    assert!(Options::default().validate().is_ok());
    for (text, name) in [
        ("cost_tolerance = 1.5", "cost_tolerance"),
        ("cost_tolerance = nan", "cost_tolerance"),
        ("initial_damping = 0.0", "initial_damping"),
        ("initial_damping = inf", "initial_damping"),
    ] {
        let options: Options = toml::from_str(text).unwrap();
        assert!(options.validate().unwrap_err().to_string().contains(name), "{text}");
    }
    assert!(toml::from_str::<Options>("max_steps = 3").is_err());
}

proptest! {
    #[test]
    fn derivatives_of_poses_match_finite_differences(
        x in prop::array::uniform3(-2.0..2.0),
        shift in prop::array::uniform3(-1.0..1.0),
        turn in prop::array::uniform3(-3.0..3.0),
        scale in 0.3..3.0,
    ) {
        let (point, h) = (Point3::from(x), 1e-6);
        let similarity = Similarity3::new(Vector3::from(shift), Vector3::from(turn), scale);
        let pose: Isometry3<f64> = similarity.isometry;
        let (by_similarity, by_pose) = (by_similarity(&(similarity * point)), by_pose(&(pose * point)));
        for k in 0..7 {
            let [more, less] = [h, -h].map(|by| SVector::<f64, 7>::from_fn(|i, _| if i == k { by } else { 0.0 }));
            let moved = |step: &SVector<f64, 7>| moved_similarity(&similarity, step.as_slice()) * point;
            prop_assert!(((moved(&more) - moved(&less)) / (2.0 * h) - by_similarity.column(k)).norm() < 1e-7);
            if k < 6 {
                let moved = |step: &SVector<f64, 7>| moved_pose(&pose, &step.as_slice()[..6]) * point;
                prop_assert!(((moved(&more) - moved(&less)) / (2.0 * h) - by_pose.column(k)).norm() < 1e-7);
            }
        }
    }

    /// The rotation of a large step is that of its rotation vector, about the origin.
    #[test]
    fn a_step_multiplies_on_the_left(step in prop::array::uniform6(-2.0..2.0_f64), turn in prop::array::uniform3(-3.0..3.0)) {
        let pose = Isometry3::new(Vector3::new(0.4, -1.0, 2.0), Vector3::from(turn));
        let [omega, tau] = [0, 3].map(|k| Vector3::new(step[k], step[k + 1], step[k + 2]));
        let wanted = Isometry3::new(tau, omega) * pose;
        prop_assert!((moved_pose(&pose, &step).to_homogeneous() - wanted.to_homogeneous()).norm() < 1e-12);
    }
}
