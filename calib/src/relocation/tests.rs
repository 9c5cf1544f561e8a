//! Sightings of points in space, whose pose and depths are known.

use nalgebra::{Isometry3, Point2, Point3, Rotation3, Vector3};
use rand_free::Noise;

use super::{Doubt, KEYPOINT_SIGMA_PX, Relocation, Sighting, adjustment, consensus, refined};
use crate::Intrinsics;

/// Normally distributed numbers in a fixed order, without a dependency.
mod rand_free {
    pub(super) struct Noise(pub(super) u64);

    impl Noise {
        pub(super) fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        pub(super) fn normal(&mut self) -> f64 {
            let (a, b) = (self.uniform().max(1e-12), self.uniform());
            (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
        }
    }
}

fn lens() -> Intrinsics {
    let mut lens = Intrinsics::from_horizontal_fov(640, 480, 70.0);
    lens.distortion = [-0.1, 0.02, 0.0, 0.0, 0.0].into();
    lens
}

/// A camera that has turned by some degrees and moved by some decimetres from the world's frame.
fn pose(seed: u64) -> Isometry3<f64> {
    let mut noise = Noise(seed + 77);
    let mut direction = || Vector3::from_fn(|_, _| noise.normal()).normalize();
    let (axis, shift) = (direction(), direction());
    let turn = Rotation3::from_scaled_axis(axis * 0.15);
    Isometry3::from_parts((shift * 0.2).into(), turn.into())
}

/// Sightings of points 2 to 6 m before a reference camera at the world's origin; the pixels are wrong by `noise_px`, the depths by
/// `depth_error` of themselves, and of every ten, `wrong` are of other things.
fn noisy_sightings(seed: u64, count: usize, noise_px: f64, depth_error: f64, wrong: usize) -> Vec<Sighting> {
    let (lens, pose, mut noise) = (lens(), pose(seed), Noise(seed));
    let mut seen = Vec::new();
    while seen.len() < count {
        let reference = Point2::new(640.0 * noise.uniform(), 480.0 * noise.uniform());
        let Some(ray) = lens.unproject(&reference) else { continue };
        let z_m = 2.0 + 4.0 * noise.uniform();
        let Some(pixel) = lens.project(&(pose * Point3::from(ray * z_m))) else { continue };
        let is_wrong = seen.len() % 10 < wrong;
        let off = Vector3::new(noise.normal(), noise.normal(), 0.0) * if is_wrong { 60.0 } else { noise_px };
        let told_m = z_m * (1.0 + depth_error * noise.normal());
        seen.push(Sighting {
            world: Point3::from(ray * told_m),
            depth_step: ray * (0.012 * told_m),
            pixel: pixel + off.xy(),
            pixel_sigma_px: KEYPOINT_SIGMA_PX,
            cell: (reference.x / 107.0) as u32 + 6 * (reference.y / 96.0) as u32,
        });
    }
    seen
}

/// Sightings as noisy as those of keypoints.
fn sightings(seed: u64, count: usize, depth_error: f64, wrong: usize) -> Vec<Sighting> {
    noisy_sightings(seed, count, 0.4, depth_error, wrong)
}

fn found(seen: &[Sighting]) -> Result<Relocation, Doubt> {
    let lens = lens();
    let Some(start) = consensus::pose(&lens, seen) else {
        return Err(Doubt::Unrecognised { agreeing: 0, matches: seen.len() });
    };
    let factors = &adjustment::OF_KEYPOINTS;
    let (adjusted, weighted) = adjustment::adjusted_with_uncertainties(&lens, seen, &start, factors);
    let (found, distance_m) = adjustment::judged(&lens, &weighted, &adjusted, seen.len())?;
    found.certain(distance_m)
}

/// Distance of the centres, metres, and angle, degrees, from the true pose.
fn error(seed: u64, found: &Relocation) -> (f64, f64) {
    let (true_pose, pose) = (pose(seed), found.camera_from_world);
    let centre = |pose: &Isometry3<f64>| pose.inverse().translation.vector;
    ((centre(&true_pose) - centre(&pose)).norm(), true_pose.rotation.angle_to(&pose.rotation).to_degrees())
}

#[test]
fn the_pose_is_found_among_wrong_matches_with_an_honest_uncertainty() {
    for (depth_error, wrong) in [(0.0, 0), (0.01, 4), (0.04, 4)] {
        let (mut squared_m, mut squared_deg) = (0.0, 0.0);
        for seed in 0..12 {
            let found = found(&sightings(seed, 300, depth_error, wrong)).unwrap();
            let (off_m, off_deg) = error(seed, &found);
            assert!(off_m < 0.02 && off_deg < 0.15, "{depth_error} {wrong} {seed}: {off_m} m, {off_deg}°");
            squared_m += (off_m / found.sigma_m).powi(2) / 12.0;
            squared_deg += (off_deg / found.sigma_deg).powi(2) / 12.0;
        }
        // Errors are about one standard deviation; more than two would be a lie, far less a needless refusal.
        for ratio in [squared_m.sqrt(), squared_deg.sqrt()] {
            assert!((0.3..1.8).contains(&ratio), "{depth_error} {wrong}: {ratio}");
        }
    }
}

#[test]
fn the_precision_of_corners_is_estimated_and_used() {
    let mut errors_m = Vec::new();
    for noise_px in [0.05, 0.3] {
        let (mut squared_m, mut squared, seeds) = (0.0, [0.0; 2], 12);
        for seed in 0..seeds {
            let corners: Vec<Sighting> = noisy_sightings(seed, 400, noise_px, 0.02, 2)
                .into_iter()
                .map(|s| Sighting { pixel_sigma_px: 0.2, ..s })
                .collect();
            let (found, _) = refined(&lens(), &corners, &pose(seed), 400).unwrap();
            let (off_m, off_deg) = error(seed, &found);
            squared_m += off_m.powi(2) / seeds as f64;
            squared[0] += (off_m / found.sigma_m).powi(2) / seeds as f64;
            squared[1] += (off_deg / found.sigma_deg).powi(2) / seeds as f64;
        }
        for ratio in squared.map(f64::sqrt) {
            assert!((0.3..1.8).contains(&ratio), "{noise_px} px: {ratio}");
        }
        errors_m.push(squared_m.sqrt());
    }
    assert!(errors_m[0] < 0.5 * errors_m[1], "{errors_m:?}");
}

#[test]
fn matches_that_agree_on_nothing_are_refused() {
    for seed in 0..6 {
        let said = found(&sightings(seed, 150, 0.0, 10)).unwrap_err();
        assert!(matches!(said, Doubt::Unrecognised { agreeing, .. } if agreeing < 20), "{said:?}");
        assert!(said.to_string().contains("of 150 points"), "{said}");
    }
    let few = sightings(1, 12, 0.0, 0);
    assert!(matches!(found(&few), Err(Doubt::Unrecognised { agreeing: 12 | 11, .. })));
}

#[test]
fn matches_in_a_corner_of_the_picture_are_refused() {
    let mut seen = sightings(3, 2000, 0.0, 0);
    seen.retain(|s| s.cell % 6 < 2 && s.cell / 6 < 1);
    let said = found(&seen).unwrap_err();
    assert!(seen.len() > 40 && matches!(said, Doubt::Crowded { .. } | Doubt::Uncertain { .. }), "{said:?}");
}

#[test]
fn an_unknown_depth_leaves_the_part_of_the_residual_across_it() {
    let lens = lens();
    let pose = Isometry3::translation(-0.2, 0.0, 0.0);
    let known = Sighting {
        world: Point3::new(0.0, 0.0, 3.0),
        depth_step: Vector3::zeros(),
        pixel: lens.project(&Point3::new(-0.2, 0.0, 3.0)).unwrap(),
        pixel_sigma_px: KEYPOINT_SIGMA_PX,
        cell: 0,
    };
    let moved = |along: f64, across: f64, depth_step_m: f64| {
        let pixel = known.pixel + nalgebra::Vector2::new(along, across);
        let depth_step = Vector3::z() * depth_step_m;
        Sighting { depth_step, pixel, ..known }.squared(&lens, &pose).sqrt()
    };
    // The camera stands to the right of the reference: another depth moves the point along u.
    assert!(
        (moved(5.0, 0.0, 0.0) - 5.0 / 0.7).abs() < 1e-9 && (moved(0.0, 5.0, 0.0) - 5.0 / 0.7).abs() < 1e-9
    );
    assert!(moved(5.0, 0.0, 1.0) < 0.6 && (moved(0.0, 5.0, 1.0) - 5.0 / 0.7).abs() < 1e-6);
}
