//! Adjustment of scenes with known truth.

use super::*;
use calib::Distortion;
use calib::least_squares::Equations;
use nalgebra::{DMatrix, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use synthetic::tracks::{self, TrackOptions};

/// Synthetic tracks in the frame of their first camera: observations and truth.
fn scene(noise_px: f64, seed: u64) -> (Vec<Vec<Observation>>, BundleState) {
    let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 65.0);
    intrinsics.distortion = [-0.08, 0.02, 0.0, 0.0, 0.0].into();
    let options =
        TrackOptions { seed, cameras: 8, noise_px, gaps: 0.0, intrinsics, ..TrackOptions::default() };
    let tracks = options.build();
    let first_from_world = tracks.camera_from_world[0];
    let of_point = |seen: &Vec<tracks::PointObservation>| {
        seen.iter().map(|o| Observation::new(o.camera, o.pixel)).collect()
    };
    let truth = BundleState {
        intrinsics: options.intrinsics,
        poses: tracks.camera_from_world.iter().map(|pose| pose * first_from_world.inverse()).collect(),
        points: tracks.points.iter().map(|point| first_from_world * point).collect(),
    };
    (tracks.observations.iter().map(of_point).collect(), truth)
}

/// The same state with everything but the first pose disturbed.
fn disturbed(truth: &BundleState, seed: u64) -> BundleState {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, 0.02).unwrap();
    let mut start = truth.clone();
    for pose in start.poses.iter_mut().skip(1) {
        let step: Vec<f64> = (0..6).map(|_| normal.sample(&mut rng)).collect();
        *pose = moved_pose(pose, &step);
    }
    for point in &mut start.points {
        *point += Vector3::from_fn(|_, _| 5.0 * normal.sample(&mut rng));
    }
    start
}

/// Largest rotation (radians) and direction-of-translation error against the truth; the scale is free.
fn pose_errors(found: &BundleState, truth: &BundleState) -> (f64, f64) {
    let scale = found.poses[7].translation.vector.norm() / truth.poses[7].translation.vector.norm();
    let mut worst = (0.0_f64, 0.0_f64);
    for (f, t) in found.poses.iter().zip(&truth.poses) {
        worst.0 = worst.0.max(f.rotation.angle_to(&t.rotation));
        worst.1 = worst.1.max((f.translation.vector / scale - t.translation.vector).norm());
    }
    worst
}

/// Options for a loss without limits of time.
fn exactly(loss: Loss, lens: LensFreedom) -> BundleOptions {
    let solver = Options { max_iterations: 300, cost_tolerance: 1e-14, ..Options::default() };
    BundleOptions { loss, lens, solver }
}

#[test]
fn exact_measurements_give_the_exact_motion() {
    let (observations, truth) = scene(0.0, 1);
    let mut state = disturbed(&truth, 2);
    let problem = BundleProblem {
        observations,
        on_plane: Vec::new(),
        options: exactly(Loss::Squares, LensFreedom::Fixed),
    };
    let report = problem.adjust(&mut state);
    assert!((report.final_cost / problem.observation_count() as f64).sqrt() < 1e-6, "{report:?}");
    let (turn, shift) = pose_errors(&state, &truth);
    assert!(turn < 1e-7 && shift < 1e-7, "{turn} {shift}");
    assert_eq!(state.poses[0], truth.poses[0]);
}

#[test]
fn a_wrong_lens_is_found() {
    let (observations, truth) = scene(0.0, 3);
    let mut state = disturbed(&truth, 4);
    state.intrinsics.fx *= 1.15;
    state.intrinsics.fy *= 1.15;
    state.intrinsics.distortion = Distortion::NONE;
    let options = exactly(Loss::Squares, LensFreedom::FocalRadial);
    BundleProblem { observations, on_plane: Vec::new(), options }.adjust(&mut state);
    let (found, wanted) = (&state.intrinsics, &truth.intrinsics);
    assert!((found.fx / wanted.fx - 1.0).abs() < 1e-4, "{found:?}");
    assert!((found.distortion.leading()[0] - wanted.distortion.leading()[0]).abs() < 1e-3, "{found:?}");
}

#[test]
fn outliers_fade_under_cauchy() {
    let (mut observations, truth) = scene(0.2, 5);
    for (index, observation) in observations.iter_mut().flatten().enumerate() {
        if index % 10 == 3 {
            observation.pixel.x += 25.0;
        }
    }
    let mut problem = BundleProblem { observations, on_plane: Vec::new(), options: BundleOptions::default() };
    let mut robust = disturbed(&truth, 6);
    // Cauchy alone may settle on the wrong side from far away: Huber, which is convex, first.
    for loss in [Loss::Huber(1.0), Loss::Cauchy(1.0)] {
        problem.options.loss = loss;
        problem.adjust(&mut robust);
    }
    let (turn, shift) = pose_errors(&robust, &truth);
    assert!(turn < 4e-3 && shift < 8e-3, "{turn} {shift}");
    let mut plain = disturbed(&truth, 6);
    problem.options.loss = Loss::Squares;
    problem.adjust(&mut plain);
    assert!(pose_errors(&plain, &truth).0 > 2.0 * turn);
}

/// The reduced step must equal the step of the full dense normal equations.
#[test]
fn elimination_equals_the_dense_solution() {
    eliminated(Vec::new(), 0..6);
    // Points on a plane free the first rotation.
    eliminated((0..20).map(|k| if k % 3 == 0 { 40.0 } else { 0.0 }).collect(), 3..6);
}

/// `held`: parameters of the first pose that are fixed.
fn eliminated(on_plane: Vec<f64>, held: std::ops::Range<usize>) {
    let (mut observations, truth) = scene(0.3, 7);
    let mut state = disturbed(&truth, 8);
    state.points.truncate(20);
    observations.truncate(20);
    let problem = BundleProblem {
        observations,
        on_plane,
        options: exactly(Loss::Huber(1.0), LensFreedom::FocalRadial),
    };
    let (poses, points, damping) = (state.poses.len(), state.points.len(), 0.01);
    let size = 6 * poses + 3 + 3 * points;
    let (mut dense, mut right) = (DMatrix::<f64>::zeros(size, size), nalgebra::DVector::<f64>::zeros(size));
    for (index, observations) in problem.observations.iter().enumerate() {
        for o in observations {
            let (lens, pose) = (&state.intrinsics, PoseMatrix::new(&state.poses[o.pose]));
            let l = residual::linearise(lens, &pose, &state.points[index], &o.pixel).unwrap();
            let mut j = DMatrix::<f64>::zeros(2, size);
            j.fixed_view_mut::<2, 6>(0, 6 * o.pose).copy_from(&l.by_pose());
            j.fixed_view_mut::<2, 3>(0, 6 * poses).copy_from(&l.by_lens(lens));
            j.fixed_view_mut::<2, 3>(0, 6 * poses + 3 + 3 * index).copy_from(&l.by_point(&pose));
            let w = problem.options.loss.weight(l.residual.norm_squared());
            dense += w * j.transpose() * &j;
            right -= w * j.transpose() * l.residual;
        }
        if let Some(precision) = problem.on_plane.get(index) {
            let (k, height) = (6 * poses + 3 + 3 * index + 2, state.points[index].z);
            let w = precision * problem.options.loss.weight(precision * height * height);
            dense[(k, k)] += w;
            right[k] -= w * height;
        }
    }
    for k in 0..size {
        dense[(k, k)] *= 1.0 + damping;
    }
    for k in held {
        dense.row_mut(k).fill(0.0);
        dense.column_mut(k).fill(0.0);
        dense[(k, k)] = 1.0;
        right[k] = 0.0;
    }
    let expected = dense.lu().solve(&right).unwrap();
    let step = problem.linearise(&state).solve(damping).unwrap().step;
    for (found, wanted) in step.cameras.iter().zip(expected.iter()) {
        assert!((found - wanted).abs() < 1e-6 * (1.0 + wanted.abs()), "{found} {wanted}");
    }
    for (index, found) in step.points.iter().enumerate() {
        let wanted = expected.fixed_rows::<3>(6 * poses + 3 + 3 * index);
        assert!((found - wanted).norm() < 1e-6 * (1.0 + wanted.norm()));
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let (observations, truth) = scene(0.3, 9);
    let start = disturbed(&truth, 10);
    let problem = BundleProblem { observations, on_plane: Vec::new(), options: BundleOptions::default() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut state = start.clone();
        pool.install(|| problem.adjust(&mut state));
        state
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one.poses, three.poses);
    assert_eq!(one.points, three.points);
}

#[test]
fn nothing_to_adjust_is_no_accident() {
    let mut state = BundleState {
        intrinsics: Intrinsics::from_horizontal_fov(64, 48, 60.0),
        poses: vec![Isometry3::identity(); 2],
        points: vec![Point3::new(0.0, 0.0, -1.0)],
    };
    let behind = Observation::new(1, Point2::new(3.0, 4.0));
    let mut problem = BundleProblem {
        observations: vec![vec![behind]],
        on_plane: Vec::new(),
        options: BundleOptions::default(),
    };
    assert!(problem.adjust(&mut state).final_cost.is_finite());
    problem.observations.clear();
    state.points.clear();
    assert_eq!(problem.adjust(&mut state).iterations, 0);
}

/// Scatter of the focal length's logarithm over many repeats of `noise`, and the mean of its estimated deviation.
fn focal_scatter_and_sigma(mut noise: impl FnMut(&mut Vec<Vec<Observation>>, &mut Pcg64Mcg)) -> (f64, f64) {
    const REPEATS: u64 = 40;
    let (mut squares, mut said) = (0.0, 0.0);
    let (exact, truth) = scene(0.0, 11);
    for seed in 0..REPEATS {
        let (mut observations, mut state) = (exact.clone(), truth.clone());
        noise(&mut observations, &mut Pcg64Mcg::seed_from_u64(seed));
        let problem = BundleProblem {
            observations,
            on_plane: Vec::new(),
            options: exactly(Loss::Squares, LensFreedom::Focal),
        };
        problem.adjust(&mut state);
        squares += (state.intrinsics.fx / truth.intrinsics.fx).ln().powi(2);
        let evidence = problem.lens_evidence(&state).unwrap();
        assert!(evidence.step.x.abs() < 1e-2 * evidence.covariance[(0, 0)].sqrt(), "{evidence:?}");
        said += evidence.covariance[(0, 0)] / REPEATS as f64;
    }
    ((squares / REPEATS as f64).sqrt(), said.sqrt())
}

/// The predicted standard deviation equals the scatter of repeated measurements.
#[test]
fn the_focal_lengths_sigma_is_its_scatter() {
    let normal = Normal::new(0.0, 0.4).unwrap();
    let (scatter, said) = focal_scatter_and_sigma(|observations, rng| {
        for observation in observations.iter_mut().flatten() {
            observation.pixel.x += normal.sample(rng);
            observation.pixel.y += normal.sample(rng);
        }
    });
    // Forty repeats determine a standard deviation to 11 %.
    assert!((0.7..1.4).contains(&(said / scatter)), "said {said}, scatter {scatter}");
}

#[test]
fn observations_that_err_alike_say_no_more_than_one() {
    let normal = Normal::new(0.0, 0.4).unwrap();
    let (scatter, said) = focal_scatter_and_sigma(|observations, rng| {
        for observations in observations {
            for observation in observations.iter_mut() {
                observation.pixel.x += normal.sample(rng);
                observation.pixel.y += normal.sample(rng);
            }
            // If each were an independent measurement, the standard deviation would be a third.
            *observations = observations.iter().flat_map(|o| [*o; 9]).collect();
        }
    });
    assert!((0.7..1.4).contains(&(said / scatter)), "said {said}, scatter {scatter}");
}

#[test]
fn a_step_of_evidence_points_at_the_true_lens() {
    let (observations, truth) = scene(0.05, 12);
    let mut wrong = truth.clone();
    wrong.intrinsics.fx *= 1.01;
    wrong.intrinsics.fy *= 1.01;
    let mut problem = BundleProblem {
        observations,
        on_plane: Vec::new(),
        options: exactly(Loss::Squares, LensFreedom::Fixed),
    };
    problem.adjust(&mut wrong);
    assert_eq!(problem.lens_evidence(&truth), None);
    problem.options.lens = LensFreedom::FocalRadial;
    let evidence = problem.lens_evidence(&wrong).unwrap();
    let off = evidence.step.x + 1.01_f64.ln();
    assert!(off.abs() < 0.003 && evidence.covariance[(0, 0)].sqrt() < 0.006, "{evidence:?}");
}

/// Points on a level floor and above it, seen by cameras that look down on it; the first camera's pose is that in the floor's frame.
fn scene_on_floor(noise_px: f64, seed: u64) -> (BundleProblem, BundleState) {
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 70.0);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let (noise, spread) = (Normal::new(0.0, noise_px).unwrap(), Normal::new(0.0, 1.0).unwrap());
    let pose = |k: i32| {
        let eye = Point3::new(-3.0 + 0.1 * f64::from(k), 0.15 * f64::from(k % 3), 2.4);
        Isometry3::face_towards(&eye, &Point3::origin(), &-Vector3::z()).inverse()
    };
    let poses: Vec<Isometry3<f64>> = (0..6).map(pose).collect();
    let height = |k: usize| if k.is_multiple_of(3) { 0.3 } else { 0.0 };
    let points: Vec<Point3<f64>> = (0..90)
        .map(|k| Point3::new(0.7 * spread.sample(&mut rng), spread.sample(&mut rng), height(k)))
        .collect();
    let mut seen = |point: &Point3<f64>| {
        let observation = |(index, pose): (usize, &Isometry3<f64>)| {
            let slip = nalgebra::Vector2::from_fn(|_, _| noise.sample(&mut rng));
            Some(Observation::new(index, intrinsics.project(&(pose * point))? + slip))
        };
        poses.iter().enumerate().filter_map(observation).collect()
    };
    let observations = points.iter().map(&mut seen).collect();
    let on_plane = (0..points.len()).map(|k| if height(k) > 0.0 { 0.0 } else { 1e4 }).collect();
    let problem =
        BundleProblem { observations, on_plane, options: exactly(Loss::Squares, LensFreedom::Fixed) };
    (problem, BundleState { intrinsics, poses, points })
}

#[test]
fn points_on_a_plane_level_the_cameras_over_it() {
    let (problem, truth) = scene_on_floor(0.1, 5);
    let mut state = disturbed(&truth, 6);
    // The first camera leans, about its centre.
    state.poses[0] = moved_pose(&state.poses[0], &[0.02, -0.03, 0.01, 0.0, 0.0, 0.0]);
    problem.adjust(&mut state);
    let centre = |state: &BundleState| state.poses[0].inverse() * Point3::origin();
    assert!((centre(&state) - centre(&truth)).norm() < 1e-9, "the first centre is held");
    for (found, expected) in state.poses.iter().zip(&truth.poses) {
        let up = |pose: &Isometry3<f64>| pose.rotation * Vector3::z();
        assert!(up(found).angle(&up(expected)) < 2e-3, "{found} {expected}");
        let height = |pose: &Isometry3<f64>| (pose.inverse() * Point3::origin()).z;
        assert!((height(found) - height(expected)).abs() < 4e-3, "{found} {expected}");
    }
    // Its height over the plane is the unit of all lengths.
    let apart = |state: &BundleState| (state.poses[5].inverse() * Point3::origin() - centre(state)).norm();
    assert!((apart(&state) / apart(&truth) - 1.0).abs() < 5e-3, "{} {}", apart(&state), apart(&truth));
}
