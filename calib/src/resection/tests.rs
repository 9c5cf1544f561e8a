use super::*;
use approx::assert_relative_eq;
use nalgebra::Vector3;
use proptest::prelude::*;

fn lens() -> Intrinsics {
    let mut k = Intrinsics::from_horizontal_fov(640, 480, 75.0);
    k.distortion = [-0.2, 0.05, 0.001, -0.001, 0.0].into();
    k
}

/// A camera about 4 m from the origin that looks at it, turned about its axis.
fn pose(azimuth: f64, elevation: f64, roll: f64) -> Isometry3<f64> {
    let eye =
        Point3::new(azimuth.cos() * elevation.cos(), azimuth.sin() * elevation.cos(), elevation.sin()) * 4.0;
    Isometry3::rotation(Vector3::z() * roll) * Isometry3::look_at_rh(&eye, &Point3::origin(), &Vector3::z())
}

fn facing(pose: Isometry3<f64>) -> Isometry3<f64> {
    // look_at_rh looks along −z; a camera here looks along +z with y down.
    Isometry3::rotation(Vector3::x() * std::f64::consts::PI) * pose
}

fn picks(camera: &Camera, points: &[[f64; 3]]) -> Vec<Pick> {
    let world = points.iter().map(|p| Point3::from(*p));
    world.map(|w| Pick { world: w, pixel: camera.project(&w).unwrap() }).collect()
}

const SPACE: [[f64; 3]; 7] = [
    [0.8, 0.1, 0.0],
    [-0.7, 0.4, 0.3],
    [0.2, -0.9, 0.5],
    [0.5, 0.6, -0.4],
    [-0.3, -0.5, -0.6],
    [0.0, 0.2, 0.9],
    [0.9, -0.6, 0.2],
];
const PLANE: [[f64; 3]; 5] =
    [[0.9, 0.8, 0.2], [-0.8, 0.7, 0.2], [-0.9, -0.6, 0.2], [0.7, -0.9, 0.2], [0.1, 0.3, 0.2]];

/// A table's corners and two marks on it, 1.2 × 0.8 m, as a tape measures them: to 2 mm.
const NEARLY_PLANE: [[f64; 3]; 6] = [
    [-0.601, -0.4, 0.702],
    [0.6, -0.401, 0.698],
    [0.602, 0.4, 0.701],
    [-0.6, 0.399, 0.699],
    [0.1, -0.2, 0.702],
    [-0.3, 0.2, 0.698],
];

proptest! {
    #[test]
    fn exact_picks_give_the_exact_pose(azimuth in 0.0..6.2, elevation in 0.3..1.2, roll in -3.0..3.0) {
        let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(azimuth, elevation, roll)) };
        for points in [&SPACE[..], &SPACE[..6], &SPACE[..5], &PLANE[..], &PLANE[..4], &NEARLY_PLANE[..4], &NEARLY_PLANE[..]] {
            let found = resect(&camera.intrinsics, &picks(&camera, points)).unwrap();
            prop_assert!(found.rms_px() < 1e-6, "{} px from {} points", found.rms_px(), points.len());
            let off = found.camera.camera_from_world * camera.camera_from_world.inverse();
            prop_assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6);
        }
    }
}

#[test]
fn a_bad_pick_stands_out_in_its_residual() {
    let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(1.0, 0.7, 0.2)) };
    let mut seen = picks(&camera, &SPACE);
    seen[3].pixel.x += 25.0;
    let found = resect(&camera.intrinsics, &seen).unwrap();
    let mut order: Vec<usize> = (0..seen.len()).collect();
    order.sort_by(|a, b| found.residuals_px[*b].total_cmp(&found.residuals_px[*a]));
    assert_eq!(order[0], 3);
    assert!(found.residuals_px[3] > 1.8 * found.residuals_px[order[1]], "{:?}", found.residuals_px);
    // The other picks are exact, and so is the pose without the bad one.
    seen.remove(3);
    let without = resect(&camera.intrinsics, &seen).unwrap();
    assert!(without.rms_px() < 1e-6, "{} px", without.rms_px());
    assert_relative_eq!(without.camera.center(), camera.center(), epsilon = 1e-6);
}

#[test]
fn degenerate_picks_are_refused() {
    let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(1.0, 0.7, 0.2)) };
    let line = [
        [0.0, 0.0, 0.0],
        [0.1, 0.1, 0.1],
        [0.2, 0.2, 0.2],
        [0.3, 0.3, 0.3],
        [-0.1, -0.1, -0.1],
        [-0.2, -0.2, -0.2],
    ];
    let mut nan = picks(&camera, &SPACE);
    nan[0].world.x = f64::NAN;
    for bad in [picks(&camera, &line), picks(&camera, &SPACE[..3]), picks(&camera, &PLANE[..3]), vec![], nan]
    {
        assert!(matches!(resect(&camera.intrinsics, &bad), Err(Error::Degenerate(_))), "{} picks", bad.len());
    }
}

/// A grid on the floor far away, seen at a tilt, its pixels disturbed by half a pixel.
fn far_plane(seed: u32, tilt_deg: f64) -> (Camera, Vec<Pick>) {
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 40.0);
    let turn = UnitQuaternion::from_euler_angles(tilt_deg.to_radians(), 0.0, 0.3 * f64::from(seed));
    let camera = Camera {
        intrinsics,
        camera_from_world: Isometry3::from_parts(Translation3::new(0.3, -0.2, 30.0), turn),
    };
    let mut state = seed;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(state >> 8) / f64::from(1 << 24) - 0.5) * 3.0_f64.sqrt()
    };
    let seen = (0..9).map(|i| {
        let world = Point3::new(f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0, 0.0);
        let exact = camera.project(&world).unwrap();
        Pick { world, pixel: Point2::new(exact.x + noise(), exact.y + noise()) }
    });
    let seen = seen.collect();
    (camera, seen)
}

#[test]
fn of_a_planes_two_poses_the_better_one_is_taken() {
    let (mut doubtful, mut turned_over) = (0, 0);
    for seed in 0..60 {
        let (truth, seen) = far_plane(seed, 25.0);
        let found = resect(&truth.intrinsics, &seen).unwrap();
        // The refinement of the true pose ends at a local minimum; the answer must not be a worse one.
        let pose = refine_pose(
            &truth.intrinsics,
            &seen,
            &truth.camera_from_world,
            Loss::Squares,
            &Options::default(),
        );
        let near = Camera { camera_from_world: pose, ..truth.clone() };
        let least = rms(&residuals_px(&near, &seen).unwrap());
        assert!(found.rms_px() <= least * (1.0 + 1e-6), "seed {seed}: {} > {least} px", found.rms_px());
        if let Some(alternative) = &found.alternative {
            doubtful += 1;
            assert!(alternative.rms_px >= found.rms_px());
            // One of the two poses is the truth.
            let off = |c: &Camera| {
                c.camera_from_world.rotation.angle_to(&truth.camera_from_world.rotation).to_degrees()
            };
            assert!(off(&found.camera).min(off(&alternative.camera)) < 15.0, "seed {seed}");
            turned_over += i32::from(off(&found.camera) > 25.0);
        }
    }
    assert!(doubtful > 40, "{doubtful} of 60 are told to be in doubt");
    assert!(turned_over < 20, "{turned_over} of 60 lean the wrong way");
}

#[test]
fn well_determined_poses_have_no_alternative() {
    let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(1.0, 0.7, 0.2)) };
    for points in [&SPACE[..], &SPACE[..5], &PLANE[..], &NEARLY_PLANE[..]] {
        let found = resect(&camera.intrinsics, &picks(&camera, points)).unwrap();
        assert!(found.alternative.is_none(), "{} px", found.alternative.unwrap().rms_px);
    }
}

#[test]
fn millimetres_beside_the_plane_move_the_camera_by_as_little() {
    let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(1.0, 0.7, 0.2)) };
    for count in [4, 5, 6] {
        let mut seen = picks(&camera, &NEARLY_PLANE[..count]);
        // The pixels are of the true corners; the tape's errors have the opposite sign.
        for pick in &mut seen {
            pick.world.z = 1.4 - pick.world.z;
        }
        let found = resect(&camera.intrinsics, &seen).unwrap();
        let off = (found.camera.center() - camera.center()).norm();
        assert!(found.rms_px() < 1.0 && off < 0.1, "{count}: {} px, {off} m", found.rms_px());
    }
}

/// Two shelves and the floor before them, from 4 m.
fn shelves() -> Vec<[f64; 3]> {
    let mut points: Vec<[f64; 3]> = SPACE.to_vec();
    points.extend(PLANE);
    points
}

proptest! {
    #[test]
    fn exact_picks_give_the_exact_lens(azimuth in 0.0..6.2, elevation in 0.3..1.2, roll in -3.0..3.0) {
        let intrinsics =
            Intrinsics { fx: 520.0, fy: 500.0, cx: 331.0, cy: 228.0, ..Intrinsics::from_horizontal_fov(640, 480, 60.0) };
        let camera = Camera { intrinsics, camera_from_world: facing(pose(azimuth, elevation, roll)) };
        let found = resect_with_lens((640, 480), &picks(&camera, &shelves())).unwrap();
        let (k, expected) = (&found.resection.camera.intrinsics, &camera.intrinsics);
        prop_assert!((k.matrix() - expected.matrix()).norm() < 1e-4, "{k:?}");
        prop_assert_eq!((k.width, k.height), (640, 480));
        let off = found.resection.camera.camera_from_world * camera.camera_from_world.inverse();
        prop_assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-6);
        prop_assert!(found.resection.rms_px() < 1e-6);
    }
}

#[test]
fn a_lens_is_as_well_known_as_it_says() {
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 60.0);
    let camera = Camera { intrinsics, camera_from_world: facing(pose(1.0, 0.5, 0.2)) };
    let exact = picks(&camera, &shelves());
    let mut rng = 7_u32;
    let mut noise = || {
        rng = rng.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(rng >> 8) / f64::from(1 << 24) - 0.5) * 12.0_f64.sqrt() * PICK_SIGMA_PX
    };
    let (mut squares, mut count) = (0.0, 0.0);
    for _ in 0..200 {
        let seen: Vec<Pick> = exact
            .iter()
            .map(|p| Pick { pixel: Point2::new(p.pixel.x + noise(), p.pixel.y + noise()), ..*p })
            .collect();
        let found = resect_with_lens((640, 480), &seen).unwrap();
        let (k, s) = (&found.resection.camera.intrinsics, found.sigma_px);
        let truth = &camera.intrinsics;
        for (value, expected, sigma) in
            [(k.fx, truth.fx, s[0]), (k.fy, truth.fy, s[1]), (k.cx, truth.cx, s[2]), (k.cy, truth.cy, s[3])]
        {
            squares += ((value - expected) / sigma).powi(2);
            count += 1.0;
        }
    }
    let spread = f64::sqrt(squares / count);
    assert!((0.7..1.2).contains(&spread), "errors are {spread} standard deviations");
}

#[test]
fn points_that_tell_no_lens_are_refused() {
    let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 60.0);
    let camera = Camera { intrinsics, camera_from_world: facing(pose(1.0, 0.5, 0.2)) };
    let grid: Vec<[f64; 3]> = (0..9).map(|i| [f64::from(i % 3) - 1.0, f64::from(i / 3) - 1.0, 0.2]).collect();
    let said = |picks: &[Pick]| resect_with_lens((640, 480), picks).unwrap_err().to_string();
    for points in [&grid[..], &NEARLY_PLANE[..]] {
        let said = said(&picks(&camera, points));
        assert!(said.contains("focal length") && said.contains("calib intrinsics"), "{said}");
    }
    assert!(said(&picks(&camera, &SPACE[..5])).contains("at least 6"));
    assert!(said(&picks(&camera, &[[0.0; 3]; 6])).contains("one line"));
    let mut nan = picks(&camera, &SPACE);
    nan[2].pixel.y = f64::NAN;
    assert!(said(&nan).contains("pick 3"));
    assert!(resect_with_lens((0, 480), &picks(&camera, &SPACE)).is_err());
}

proptest! {
    #[test]
    fn the_true_pose_is_among_those_of_three_points(
        azimuth in 0.0..6.2, elevation in 0.3..1.2, roll in -3.0..3.0, first in 0_usize..5
    ) {
        let camera = Camera { intrinsics: lens(), camera_from_world: facing(pose(azimuth, elevation, roll)) };
        let seen = picks(&camera, &SPACE[first..first + 3]);
        let rays: Vec<_> = seen.iter().map(|p| lens().unproject(&p.pixel).unwrap().xy()).collect();
        let off = three_points::from_triples(&seen, &rays)
            .iter()
            .map(|found| (found * camera.camera_from_world.inverse()).rotation.angle())
            .fold(f64::INFINITY, f64::min);
        prop_assert!(off < 1e-3, "{off}");
    }
}

#[test]
fn an_equilateral_triangle_seen_head_on_has_its_pose() {
    let world = [0.0_f64, 120.0, 240.0].map(|a| Point3::new(a.to_radians().cos(), a.to_radians().sin(), 0.0));
    let camera =
        Camera { intrinsics: lens().pinhole(), camera_from_world: Isometry3::translation(0.0, 0.0, 3.0) };
    let seen = world.map(|w| Pick { world: w, pixel: camera.project(&w).unwrap() });
    let rays = seen.map(|p| camera.intrinsics.unproject(&p.pixel).unwrap().xy());
    let found = three_points::from_triples(&seen, &rays);
    assert!(found.iter().any(|p| (p.translation.vector - Vector3::z() * 3.0).norm() < 0.05), "{found:?}");
}

#[test]
fn any_four_points_in_space_give_the_exact_pose() {
    for turn in 0..6 {
        let azimuth = f64::from(turn);
        let camera =
            Camera { intrinsics: lens(), camera_from_world: facing(pose(azimuth, 0.6, 0.5 * azimuth)) };
        for left_out in 0..SPACE.len() {
            let four: Vec<[f64; 3]> = (1..5).map(|i| SPACE[(left_out + i) % SPACE.len()]).collect();
            let found = resect(&camera.intrinsics, &picks(&camera, &four)).unwrap();
            let off = (found.camera.center() - camera.center()).norm();
            assert!(off < 1e-4, "turn {turn}, without {left_out}: {off} m, {} px", found.rms_px());
        }
    }
}
