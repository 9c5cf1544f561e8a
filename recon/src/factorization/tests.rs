//! Factorization against known motion, and on the classical track file.

use std::path::Path;

use calib::Intrinsics;
use nalgebra::{Isometry3, Point2, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal, Uniform};
use rand_pcg::Pcg64Mcg;
use synthetic::tracks::TrackOptions;

use super::affine::{self, Measurements};
use super::metric::{self, AffineModel, MetricMotion};
use super::{perspective, windows};
use crate::features::FeatureTrack;

/// A cloud about the origin and cameras that look at it from an arc.
fn scene(frames: usize, points: usize, depth: f64) -> (Vec<Isometry3<f64>>, Vec<Vector3<f64>>) {
    let mut rng = Pcg64Mcg::seed_from_u64(21);
    let side = Uniform::new(-1.0, 1.0).unwrap();
    let points = (0..points).map(|_| Vector3::from_fn(|_, _| side.sample(&mut rng))).collect();
    let poses = (0..frames)
        .map(|f| {
            let s = f as f64 / frames as f64;
            let rotation = UnitQuaternion::from_euler_angles(0.25 * (5.0 * s).sin(), 0.7 * s - 0.3, 0.15 * s);
            let t = Vector3::new(0.3 * s - 0.1, 0.2 * (4.0 * s).cos(), depth * (1.0 + 0.1 * s));
            Isometry3::from_parts(Translation3::from(t), rotation)
        })
        .collect();
    (poses, points)
}

fn perspective_image(pose: &Isometry3<f64>, point: &Vector3<f64>) -> Vector2<f64> {
    let p = pose * Point3::from(*point);
    p.coords.xy() / p.z
}

/// Largest angle between estimated and true rotations, the world's frame being free.
fn worst_turn_deg(found: &MetricMotion, truth: &[Isometry3<f64>]) -> f64 {
    let world = found.poses[0].rotation.inverse() * truth[0].rotation;
    let turns = found.poses.iter().zip(truth).map(|(f, t)| (f.rotation * world).angle_to(&t.rotation));
    turns.fold(0.0, f64::max).to_degrees()
}

#[test]
fn orthographic_measurements_give_the_rotations_of_one_of_two_readings() {
    let (poses, points) = scene(15, 40, 5.0);
    let measured: Measurements = points
        .iter()
        .map(|s| poses.iter().map(|p| Some((p * Point3::from(*s)).coords.xy() / p.translation.z)).collect())
        .collect();
    let affine = affine::factorize(&measured).unwrap();
    let readings = metric::upgrade(&affine, AffineModel::Orthographic).unwrap();
    let turns = readings.map(|r| worst_turn_deg(&r, &poses));
    assert!(turns[0].min(turns[1]) < 1e-4, "{turns:?}");
    assert!(turns[0].max(turns[1]) > 5.0, "the mirror must be another motion: {turns:?}");
}

#[test]
fn paraperspective_is_nearer_to_perspective_than_orthographic() {
    let (poses, points) = scene(15, 60, 6.0);
    let measured: Measurements =
        points.iter().map(|s| poses.iter().map(|p| Some(perspective_image(p, s))).collect()).collect();
    let affine = affine::factorize(&measured).unwrap();
    let worst = |model| {
        let readings = metric::upgrade(&affine, model).unwrap();
        readings.map(|r| worst_turn_deg(&r, &poses)).into_iter().fold(f64::INFINITY, f64::min)
    };
    assert!(worst(AffineModel::Paraperspective) < worst(AffineModel::Orthographic));
}

#[test]
fn iteration_reaches_the_perspective_truth_and_drops_the_mirror() {
    for (missing, depth) in [(false, 5.0), (true, 5.0), (false, 3.5)] {
        let (poses, points) = scene(16, 50, depth);
        let measured: Measurements = points
            .iter()
            .enumerate()
            .map(|(i, s)| {
                let gone = |f: usize| missing && i >= 20 && (f < i % 5 || f + i % 4 >= 16);
                poses.iter().enumerate().map(|(f, p)| (!gone(f)).then(|| perspective_image(p, s))).collect()
            })
            .collect();
        let found = perspective::factorize(&measured);
        assert_eq!(found.len(), 2);
        assert!(found[0].1 < 1e-5 && found[1].1 > 10.0 * found[0].1, "{} {}", found[0].1, found[1].1);
        assert!(worst_turn_deg(&found[0].0, &poses) < 0.01);
    }
}

#[test]
fn windows_are_chained_over_a_long_noisy_sequence_with_gaps() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 55.0);
    // Sideways past a long wall of points: no point is observed throughout.
    let frames = 90;
    let truth: Vec<Isometry3<f64>> = (0..frames)
        .map(|f| {
            let s = f as f64 / 30.0;
            let center = Vector3::new(2.0 * s, 0.2 * (2.0 * s).sin(), 0.1 * s);
            let rotation =
                UnitQuaternion::from_euler_angles(0.05 * s.sin(), 0.12 * (1.5 * s).cos(), 0.02 * s);
            Isometry3::from_parts(Translation3::from(-(rotation * center)), rotation)
        })
        .collect();
    let (along, side) = (Uniform::new(-2.5, 8.5).unwrap(), Uniform::new(-1.0, 1.0).unwrap());
    let noise = Normal::new(0.0, 0.15).unwrap();
    let tracks: Vec<FeatureTrack> = (0..1200)
        .map(|_| {
            let p = Point3::new(
                along.sample(&mut rng),
                1.5 * side.sample(&mut rng),
                4.5 + 1.5 * side.sample(&mut rng),
            );
            let observations = truth.iter().enumerate().filter_map(|(f, pose)| {
                let pixel = intrinsics.project(&(pose * p)).filter(|q| intrinsics.contains(q))?;
                Some((f, pixel + Vector2::new(noise.sample(&mut rng), noise.sample(&mut rng))))
            });
            FeatureTrack { observations: observations.collect() }
        })
        .filter(|t| t.observations.len() >= 3)
        .collect();
    assert!(tracks.iter().all(|t| t.observations.len() < frames));
    let poses: Vec<Isometry3<f64>> =
        windows::reconstruct(&tracks, &intrinsics, frames).unwrap().into_iter().flatten().collect();
    assert_eq!(poses.len(), frames);
    let center = |pose: &Isometry3<f64>| pose.inverse() * Point3::origin();
    let (found, wanted): (Vec<_>, Vec<_>) =
        (poses.iter().map(center).collect(), truth.iter().map(center).collect());
    let aligned = calib::absolute_orientation::similarity(&found, &wanted).unwrap();
    for (f, w) in found.iter().zip(&wanted) {
        assert!((aligned * f - w).norm() < 0.03, "{}", (aligned * f - w).norm());
    }
}

#[test]
fn the_classical_tracks_of_shared_data_factorize() {
    let path =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/factorization_tracks/tracks.csv"));
    let Ok(text) = std::fs::read_to_string(path) else {
        eprintln!("skipped: {} is not here", path.display());
        return;
    };
    let mut tracks: Vec<FeatureTrack> = Vec::new();
    for line in text.lines().skip(1) {
        let field: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
        let (frame, point) = (field[0] as usize - 1, field[1] as usize - 1);
        tracks.resize_with(tracks.len().max(point + 1), FeatureTrack::default);
        tracks[point].observations.push((frame, Point2::new(field[2], field[3])));
    }
    // The lens is unknown; a usual one is assumed. The residuals tell whether the shape is rigid under it.
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 40.0);
    let measured: Measurements = tracks
        .iter()
        .map(|t| t.observations.iter().map(|(_, p)| Some(intrinsics.unproject(p).unwrap().xy())).collect())
        .collect();
    let affine = affine::factorize(&measured).unwrap();
    let affine_px = affine.residual(&measured) * intrinsics.fx;
    let found = perspective::factorize(&measured);
    let (best_px, mirror_px) = (found[0].1 * intrinsics.fx, found[1].1 * intrinsics.fx);
    eprintln!(
        "classical tracks: affine {affine_px:.3} px; perspective {best_px:.3} px, mirror {mirror_px:.3} px"
    );
    // The tracks are whole pixels and some slip; what counts is that a rigid scene explains them about as well as any
    // three dimensions can, and that the depth reversal does not.
    assert!(affine_px < 4.0 && best_px < 1.1 * affine_px && mirror_px > 1.1 * best_px);
}

#[test]
fn synthetic_tracks_with_noise_and_gaps_give_their_cameras() {
    for seed in 0..6 {
        let options = TrackOptions {
            seed,
            cameras: 20,
            points: 300,
            noise_px: 0.2,
            gaps: 0.15,
            ..TrackOptions::default()
        };
        let scene = options.build();
        let tracks: Vec<FeatureTrack> = scene
            .observations
            .iter()
            .map(|seen| FeatureTrack { observations: seen.iter().map(|o| (o.camera, o.pixel)).collect() })
            .collect();
        let found = windows::reconstruct(&tracks, &options.intrinsics, 20).unwrap();
        let found: Vec<Isometry3<f64>> = found.into_iter().map(|pose| pose.unwrap()).collect();
        let center = |pose: &Isometry3<f64>| pose.inverse() * Point3::origin();
        let [ours, truth] = [&found, &scene.camera_from_world]
            .map(|poses| poses.iter().map(center).collect::<Vec<Point3<f64>>>());
        let aligned = calib::absolute_orientation::similarity(&ours, &truth).unwrap();
        let (first, last) = (&scene.camera_from_world[0], &scene.camera_from_world[19]);
        let turn = found[19].rotation * found[0].rotation.inverse();
        let off_deg = turn.angle_to(&(last.rotation * first.rotation.inverse())).to_degrees();
        let worst_m = ours.iter().zip(&truth).map(|(o, t)| (aligned * o - t).norm()).fold(0.0, f64::max);
        // The arc is 0.8 m long. A start for bundle adjustment, not its end.
        assert!(worst_m < 0.03 && off_deg < 1.0, "seed {seed}: {worst_m} m, {off_deg}°");
    }
}
