//! Adjustment of scenes with known truth.

use super::*;
use calib::Distortion;
use nalgebra::{DMatrix, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64Mcg;
use synthetic::tracks::{self, TrackOptions};

/// Synthetic tracks in the frame of their first camera.
fn scene(noise_px: f64, seed: u64) -> BundleProblem {
    let mut intrinsics = Intrinsics::from_horizontal_fov(640, 480, 65.0);
    intrinsics.distortion = Distortion { k1: -0.08, k2: 0.02, ..Distortion::NONE };
    let options =
        TrackOptions { seed, cameras: 8, noise_px, gaps: 0.0, intrinsics, ..TrackOptions::default() };
    let tracks = options.build();
    let first_from_world = tracks.camera_from_world[0];
    let of_point = |seen: &Vec<tracks::PointObservation>| {
        seen.iter().map(|o| Observation { pose: o.camera, pixel: o.pixel }).collect()
    };
    BundleProblem {
        intrinsics: options.intrinsics,
        poses: tracks.camera_from_world.iter().map(|pose| pose * first_from_world.inverse()).collect(),
        points: tracks.points.iter().map(|point| first_from_world * point).collect(),
        observations: tracks.observations.iter().map(of_point).collect(),
    }
}

/// The same problem with everything but the first pose disturbed.
fn disturbed(truth: &BundleProblem, seed: u64) -> BundleProblem {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, 0.02).unwrap();
    let mut start = truth.clone();
    for pose in start.poses.iter_mut().skip(1) {
        let step: Vec<f64> = (0..6).map(|_| normal.sample(&mut rng)).collect();
        *pose = residual::moved_pose(pose, &step);
    }
    for point in &mut start.points {
        *point += Vector3::from_fn(|_, _| 5.0 * normal.sample(&mut rng));
    }
    start
}

/// Largest rotation (radians) and direction-of-translation error against the truth; the scale is free.
fn pose_errors(found: &BundleProblem, truth: &BundleProblem) -> (f64, f64) {
    let scale = found.poses[7].translation.vector.norm() / truth.poses[7].translation.vector.norm();
    let mut worst = (0.0_f64, 0.0_f64);
    for (f, t) in found.poses.iter().zip(&truth.poses) {
        worst.0 = worst.0.max(f.rotation.angle_to(&t.rotation));
        worst.1 = worst.1.max((f.translation.vector / scale - t.translation.vector).norm());
    }
    worst
}

#[test]
fn exact_measurements_give_the_exact_motion() {
    let truth = scene(0.0, 1);
    let mut problem = disturbed(&truth, 2);
    let options =
        BundleOptions { loss: Loss::Squares, max_steps: 100, cost_end: 1e-14, ..Default::default() };
    let report = adjust(&mut problem, &options);
    assert!(report.rms_px < 1e-6, "{report:?}");
    let (turn, shift) = pose_errors(&problem, &truth);
    assert!(turn < 1e-7 && shift < 1e-7, "{turn} {shift}");
    assert_eq!(problem.poses[0], truth.poses[0]);
}

#[test]
fn a_wrong_lens_is_found() {
    let truth = scene(0.0, 3);
    let mut problem = disturbed(&truth, 4);
    problem.intrinsics.fx *= 1.15;
    problem.intrinsics.fy *= 1.15;
    problem.intrinsics.distortion = Distortion::NONE;
    let options = BundleOptions {
        loss: Loss::Squares,
        lens: LensFreedom::FocalRadial,
        max_steps: 300,
        cost_end: 1e-14,
        ..Default::default()
    };
    adjust(&mut problem, &options);
    let (found, wanted) = (&problem.intrinsics, &truth.intrinsics);
    assert!((found.fx / wanted.fx - 1.0).abs() < 1e-4, "{found:?}");
    assert!((found.distortion.k1 - wanted.distortion.k1).abs() < 1e-3, "{found:?}");
}

#[test]
fn outliers_fade_under_cauchy() {
    let truth = scene(0.2, 5);
    let mut wild = truth.clone();
    for (index, observation) in wild.observations.iter_mut().flatten().enumerate() {
        if index % 10 == 3 {
            observation.pixel.x += 25.0;
        }
    }
    let mut robust = disturbed(&wild, 6);
    // Cauchy alone may settle on the wrong side from far away: Huber, which is convex, first.
    adjust(&mut robust, &BundleOptions { loss: Loss::Huber(1.0), ..Default::default() });
    adjust(&mut robust, &BundleOptions::default());
    let (turn, shift) = pose_errors(&robust, &truth);
    assert!(turn < 4e-3 && shift < 8e-3, "{turn} {shift}");
    let mut plain = disturbed(&wild, 6);
    adjust(&mut plain, &BundleOptions { loss: Loss::Squares, ..Default::default() });
    assert!(pose_errors(&plain, &truth).0 > 2.0 * turn);
}

/// The reduced step must equal the step of the full dense normal equations.
#[test]
fn elimination_equals_the_dense_solution() {
    let mut problem = disturbed(&scene(0.3, 7), 8);
    problem.points.truncate(20);
    problem.observations.truncate(20);
    let options =
        BundleOptions { lens: LensFreedom::FocalRadial, loss: Loss::Huber(1.0), ..Default::default() };
    let (poses, points, damping) = (problem.poses.len(), problem.points.len(), 0.01);
    let size = 6 * poses + 3 + 3 * points;
    let (mut dense, mut right) = (DMatrix::<f64>::zeros(size, size), nalgebra::DVector::<f64>::zeros(size));
    for (index, observations) in problem.observations.iter().enumerate() {
        for o in observations {
            let (lens, pose) = (&problem.intrinsics, PoseMatrix::new(&problem.poses[o.pose]));
            let l = residual::linearise(lens, &pose, &problem.points[index], &o.pixel).unwrap();
            let mut j = DMatrix::<f64>::zeros(2, size);
            j.fixed_view_mut::<2, 6>(0, 6 * o.pose).copy_from(&l.by_pose());
            j.fixed_view_mut::<2, 3>(0, 6 * poses).copy_from(&l.by_lens(lens));
            j.fixed_view_mut::<2, 3>(0, 6 * poses + 3 + 3 * index).copy_from(&l.by_point(&pose));
            let w = options.loss.weight(l.residual.norm_squared());
            dense += w * j.transpose() * &j;
            right -= w * j.transpose() * l.residual;
        }
    }
    for k in 0..size {
        dense[(k, k)] *= 1.0 + damping;
    }
    for k in 0..6 {
        dense.row_mut(k).fill(0.0);
        dense.column_mut(k).fill(0.0);
        dense[(k, k)] = 1.0;
        right[k] = 0.0;
    }
    let expected = dense.lu().solve(&right).unwrap();
    let step = NormalEquations::build(&problem, &options).solve(damping, 0).unwrap();
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
    let start = disturbed(&scene(0.3, 9), 10);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut problem = start.clone();
        pool.install(|| adjust(&mut problem, &BundleOptions::default()));
        problem
    };
    let (one, three) = (run(1), run(3));
    assert_eq!(one.poses, three.poses);
    assert_eq!(one.points, three.points);
}

#[test]
fn nothing_to_adjust_is_no_accident() {
    let empty = BundleProblem {
        intrinsics: Intrinsics::from_horizontal_fov(64, 48, 60.0),
        poses: vec![Isometry3::identity(); 2],
        points: vec![Point3::new(0.0, 0.0, -1.0)],
        observations: vec![vec![Observation { pose: 1, pixel: Point2::new(3.0, 4.0) }]],
    };
    let mut problem = empty.clone();
    assert!(adjust(&mut problem, &BundleOptions::default()).final_cost.is_finite());
    problem = BundleProblem { points: vec![], observations: vec![], ..empty };
    assert_eq!(adjust(&mut problem, &BundleOptions::default()).steps, 0);
}

/// Scatter of the focal length's logarithm over many repeats of `noise`, and the mean of its estimated deviation.
fn focal_scatter_and_sigma(mut noise: impl FnMut(&mut BundleProblem, &mut Pcg64Mcg)) -> (f64, f64) {
    const REPEATS: u64 = 40;
    let options = BundleOptions {
        loss: Loss::Squares,
        lens: LensFreedom::Focal,
        max_steps: 100,
        cost_end: 1e-12,
        ..Default::default()
    };
    let (mut squares, mut said) = (0.0, 0.0);
    let exact = scene(0.0, 11);
    for seed in 0..REPEATS {
        let mut problem = exact.clone();
        noise(&mut problem, &mut Pcg64Mcg::seed_from_u64(seed));
        adjust(&mut problem, &options);
        squares += (problem.intrinsics.fx / exact.intrinsics.fx).ln().powi(2);
        let evidence = lens_evidence(&problem, &options).unwrap();
        assert!(evidence.step.x.abs() < 1e-2 * evidence.covariance[(0, 0)].sqrt(), "{evidence:?}");
        said += evidence.covariance[(0, 0)] / REPEATS as f64;
    }
    ((squares / REPEATS as f64).sqrt(), said.sqrt())
}

/// The predicted standard deviation equals the scatter of repeated measurements.
#[test]
fn the_focal_lengths_sigma_is_its_scatter() {
    let normal = Normal::new(0.0, 0.4).unwrap();
    let (scatter, said) = focal_scatter_and_sigma(|problem, rng| {
        for observation in problem.observations.iter_mut().flatten() {
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
    let (scatter, said) = focal_scatter_and_sigma(|problem, rng| {
        for observations in &mut problem.observations {
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
    let truth = scene(0.05, 12);
    let mut wrong = truth.clone();
    wrong.intrinsics.fx *= 1.01;
    wrong.intrinsics.fy *= 1.01;
    let options = BundleOptions { loss: Loss::Squares, max_steps: 100, ..Default::default() };
    adjust(&mut wrong, &options);
    let free = BundleOptions { lens: LensFreedom::FocalRadial, ..options };
    let evidence = lens_evidence(&wrong, &free).unwrap();
    let off = evidence.step.x + 1.01_f64.ln();
    assert!(off.abs() < 0.003 && evidence.covariance[(0, 0)].sqrt() < 0.006, "{evidence:?}");
    assert_eq!(lens_evidence(&truth, &options), None);
}
