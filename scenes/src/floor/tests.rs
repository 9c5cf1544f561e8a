//! Rooms with a known floor.

use super::*;
use approx::assert_relative_eq;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

/// A room of four walls, a ceiling, a floor seen in part and a table, in its own frame with the floor at z = 0;
/// sampled unevenly (`density` times as many points as a camera would give), with noise, and moved by `pose`.
fn room(seed: u64, density: f64, pose: &Similarity3<f64>) -> (Vec<SurfacePoint>, Vec<Isometry3<f64>>) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let (w, d, h) =
        (4.0 + rng.random::<f64>() * 4.0, 3.0 + rng.random::<f64>() * 3.0, 2.3 + rng.random::<f64>());
    let table = (0.3 * w, 0.3 * d, 0.75);
    // Floors from open to mostly covered; cameras that look level, or steeply down.
    let open = rng.random_range(0.25..0.9);
    let aim_m: f64 = rng.random_range(0.0..1.9);
    // Origin, two edges, normal, density (points a square metre).
    let v = Vector3::new;
    let patches = [
        (v(0.0, 0.0, 0.0), v(w, 0.0, 0.0), v(0.0, open * d, 0.0), Vector3::z(), 40.0),
        (v(0.0, 0.0, h), v(w, 0.0, 0.0), v(0.0, d, 0.0), -Vector3::z(), 30.0),
        (v(0.0, 0.0, 0.0), v(w, 0.0, 0.0), v(0.0, 0.0, h), Vector3::y(), 90.0),
        (v(0.0, d, 0.0), v(w, 0.0, 0.0), v(0.0, 0.0, h), -Vector3::y(), 150.0),
        (v(0.0, 0.0, 0.0), v(0.0, d, 0.0), v(0.0, 0.0, h), Vector3::x(), 60.0),
        (v(w, 0.0, 0.0), v(0.0, d, 0.0), v(0.0, 0.0, h), -Vector3::x(), 60.0),
        (v(table.0, table.1, table.2), v(1.6, 0.0, 0.0), v(0.0, 1.0, 0.0), Vector3::z(), 800.0),
    ];
    let scale = pose.scaling();
    let mut points = Vec::new();
    for (origin, a, b, normal, dense) in patches {
        let area: f64 = a.cross(&b).norm();
        let count = (area * dense * density) as usize;
        for _ in 0..count {
            let (s, t): (f64, f64) = (rng.random(), rng.random());
            let mut gauss = || -> f64 { StandardNormal.sample(&mut rng) };
            let noise = 0.01 * gauss();
            let tilt = Vector3::new(gauss(), gauss(), gauss()) * 0.1;
            let local = Point3::from(origin + a * s + b * t + normal * noise);
            points.push(SurfacePoint {
                position: pose * local,
                normal: pose.isometry.rotation * (normal + tilt).normalize(),
                area: area / count as f64 * scale * scale,
                sigma: 0.01 * scale,
            });
        }
    }
    // In two corners, looking at the room's middle, slightly rolled.
    let cameras = [(v(0.3, 0.3, 2.1), 0.1), (v(w - 0.4, d - 0.3, 1.9), -0.15)].map(|(eye, roll)| {
        let ahead = v(0.5 * w, 0.5 * d, aim_m) - eye;
        let world_from_camera = UnitQuaternion::face_towards(&ahead, &-Vector3::z())
            * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
        let rotation = pose.isometry.rotation * world_from_camera;
        let centre = pose * Point3::from(eye);
        Isometry3::from_parts(Translation3::from(centre.coords), rotation).inverse()
    });
    (points, cameras.to_vec())
}

#[test]
fn the_floors_of_a_thousand_rooms_are_found() {
    for seed in 0..1000 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut angle = || rng.random_range(-3.0..3.0);
        let rotation = UnitQuaternion::from_euler_angles(angle(), angle(), angle());
        let shift = Vector3::new(angle(), angle(), angle());
        let scale = f64::exp(angle());
        let pose = Similarity3::from_parts(Translation3::from(shift), rotation, scale);
        let (points, cameras) = room(seed, 0.15, &pose);
        let (plane, report) = find(&points, &cameras, &[], &FloorOptions::default())
            .unwrap_or_else(|line| panic!("room {seed}: {line}"));
        // Upside down would be 180°; some 60 points a centimetre off, on a strip a metre wide, leave a fraction of a
        // degree.
        let tilt_deg = plane.normal.angle(&(rotation * Vector3::z())).to_degrees();
        let height = plane.height(&(pose * Point3::new(1.0, 0.4, 0.0))) / scale;
        assert!(tilt_deg < 1.5 && height.abs() < 0.015, "room {seed}: {tilt_deg}°, {height} m, {report:?}");
        // The world frame is a rotation without mirroring, and the room stands in it as before.
        let world = metric(&world_frame(&plane, &cameras[0]), 1.0 / scale);
        let corner = |x, y, z| world * (pose * Point3::new(x, y, z));
        let [o, x, y, z] =
            [corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), corner(0.0, 1.0, 0.0), corner(0.0, 0.0, 1.0)];
        assert!((x - o).cross(&(y - o)).dot(&(z - o)) > 0.99 && z.z > 0.98, "room {seed}");
    }
}

#[test]
fn of_a_floor_hardly_seen_the_table_says_which_way_is_up() {
    // Where a capture's space is bent, a narrow strip of floor seems to slope; the table is long.
    let slope = 2f64.to_radians();
    let mut points = Vec::new();
    let mut cells = |x: [f64; 2], y: [f64; 2], z: f64, slope: f64| {
        let mut rng = Pcg64Mcg::seed_from_u64(2);
        for _ in 0..800 {
            let (x, y) = (rng.random_range(x[0]..x[1]), rng.random_range(y[0]..y[1]));
            let noise: f64 = StandardNormal.sample(&mut rng);
            points.push(SurfacePoint {
                position: Point3::new(x, y, z + slope * (x - 0.4) + 0.01 * noise),
                normal: Vector3::z(),
                area: 0.001,
                sigma: 0.01,
            });
        }
    };
    cells([0.0, 0.8], [0.0, 1.4], 0.0, slope);
    cells([1.0, 3.0], [0.0, 1.4], 0.75, 0.0);
    let look = UnitQuaternion::face_towards(&Vector3::new(1.0, 0.3, -1.0), &-Vector3::z());
    let camera = Isometry3::from_parts(Translation3::new(0.0, 0.0, 1.8), look).inverse();
    let (plane, report) = find(&points, &[camera], &[], &FloorOptions::default()).unwrap();
    let tilt_deg = plane.normal.angle(&Vector3::z()).to_degrees();
    assert!(report.level_planes == 2 && tilt_deg < 0.6, "{tilt_deg}, {report:?}");
    // The height of the floor comes from its own points.
    assert_relative_eq!(plane.height(&Point3::new(0.4, 0.7, 0.0)), 0.0, epsilon = 0.003);
}

#[test]
fn of_a_sloping_strip_of_floor_plumb_lines_say_which_way_is_up() {
    let mut rng = Pcg64Mcg::seed_from_u64(4);
    let slope = 2f64.to_radians();
    let points: Vec<SurfacePoint> = (0..800)
        .map(|_| {
            let (x, y) = (rng.random_range(0.0..0.8), rng.random_range(0.0..1.4));
            let noise: f64 = StandardNormal.sample(&mut rng);
            SurfacePoint {
                position: Point3::new(x, y, slope * (x - 0.4) + 0.01 * noise),
                normal: Vector3::z(),
                area: 0.001,
                sigma: 0.01,
            }
        })
        .collect();
    let look = UnitQuaternion::face_towards(&Vector3::new(1.0, 0.3, -1.0), &-Vector3::z());
    let camera = Isometry3::from_parts(Translation3::new(0.0, 0.0, 1.8), look).inverse();
    let with = |up: Vector3<f64>, sigma_deg: f64| {
        let across = Matrix3::identity() - up * up.transpose();
        let plumb = Plumb { up, covariance: across * sigma_deg.to_radians().powi(2) };
        let (plane, report) = find(&points, &[camera], &[plumb], &FloorOptions::default()).unwrap();
        (plane.normal.angle(&Vector3::z()).to_degrees(), report.plumb_captures)
    };
    let (alone_deg, _) = with(Vector3::x(), 0.3);
    assert!(alone_deg > 1.5, "{alone_deg}");
    let (tilt_deg, captures) = with(Vector3::z(), 0.3);
    assert!(tilt_deg < 0.6 && captures == 1, "{tilt_deg} {captures}");
    // Lines with large uncertainty, and lines in another direction, change little, or nothing.
    let (vague_deg, _) = with(Vector3::z(), 20.0);
    assert!(vague_deg > 1.4, "{vague_deg}");
    let aslant = Vector3::new(0.3, 0.2, 1.0).normalize();
    assert_relative_eq!(with(aslant, 0.3).0, alone_deg);
    assert_eq!(with(aslant, 0.3).1, 0);
}

#[test]
fn a_little_floor_with_something_else_makes_no_larger_floor() {
    let mut points = Vec::new();
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    // Ranges of x and y, height in the middle, slope along x.
    let mut cells = |x: [f64; 2], y: [f64; 2], z: f64, slope_deg: f64| {
        let slope = slope_deg.to_radians();
        let normal = Vector3::new(-slope.sin(), 0.0, slope.cos());
        for _ in 0..(2000.0 * (x[1] - x[0]) * (y[1] - y[0])) as usize {
            let (across, y) =
                (rng.random_range(x[0]..x[1]) - 0.5 * (x[0] + x[1]), rng.random_range(y[0]..y[1]));
            let noise: f64 = StandardNormal.sample(&mut rng);
            points.push(SurfacePoint {
                position: Point3::new(
                    0.5 * (x[0] + x[1]) + across,
                    y,
                    z + slope.tan() * across + 0.01 * noise,
                ),
                normal,
                area: 0.0005,
                sigma: 0.01,
            });
        }
    };
    cells([0.6, 1.1], [0.0, 1.0], 0.0, 0.0);
    cells([1.0, 2.2], [1.0, 2.5], 0.75, 0.0);
    // Far away, a heap of bags that slopes: with the floor before it, it makes a plane of 5°.
    cells([3.6, 4.4], [0.0, 1.0], 0.28, 7.0);
    let look = UnitQuaternion::face_towards(&Vector3::new(1.0, 0.3, -0.6), &-Vector3::z());
    let camera = Isometry3::from_parts(Translation3::new(0.0, 0.0, 1.8), look).inverse();
    let (plane, report) = find(&points, &[camera], &[], &FloorOptions::default()).unwrap();
    let tilt_deg = plane.normal.angle(&Vector3::z()).to_degrees();
    assert!(tilt_deg < 0.7 && report.level_planes == 2, "{tilt_deg}, {report:?}");
    assert_relative_eq!(plane.height(&Point3::new(0.85, 0.5, 0.0)), 0.0, epsilon = 0.01);
}

#[test]
fn a_reflection_below_a_polished_floor_is_not_taken_for_the_floor() {
    for seed in 0..5 {
        let (mut points, cameras) = room(seed, 1.0, &Similarity3::identity());
        // A lamp on the ceiling reflected in the floor: as far below as the lamp is above.
        let total: f64 = points.iter().map(|p| p.area).sum();
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        for _ in 0..500 {
            let (x, y) = (rng.random_range(1.0..3.0), rng.random_range(1.0..2.0));
            let noise: f64 = StandardNormal.sample(&mut rng);
            points.push(SurfacePoint {
                position: Point3::new(x, y, -2.5 + 0.01 * noise),
                normal: Vector3::z(),
                area: 0.03 * total / 500.0,
                sigma: 0.01,
            });
        }
        let (plane, report) = find(&points, &cameras, &[], &FloorOptions::default()).unwrap();
        assert!(plane.height(&Point3::origin()).abs() < 0.02, "room {seed}: {report:?}");
    }
}

#[test]
fn without_its_floor_a_room_has_none() {
    let (points, cameras) = room(3, 1.0, &Similarity3::identity());
    let without: Vec<SurfacePoint> = points.into_iter().filter(|p| p.position.z > 0.2).collect();
    let line = find(&without, &cameras, &[], &FloorOptions::default());
    // The ceiling's normal points down, so at most the table is left, and walls reach below it.
    assert!(line.is_err(), "{line:?}");
    assert!(find(&[], &cameras, &[], &FloorOptions::default()).is_err());
}

#[test]
fn the_world_stands_on_the_floor_below_the_first_camera() {
    let floor = Plane { normal: Vector3::new(0.1, -0.9, 0.2).normalize(), distance: -1.3 };
    let camera = Isometry3::from_parts(
        Translation3::new(0.4, 0.2, -0.1),
        UnitQuaternion::from_euler_angles(0.3, 0.5, -0.2),
    );
    let world = world_frame(&floor, &camera);
    let centre = world * (camera.inverse() * Point3::origin());
    assert_relative_eq!(centre.xy(), Point3::origin().xy(), epsilon = 1e-12);
    let height = floor.height(&(camera.inverse() * Point3::origin()));
    assert_relative_eq!(centre.z, height, epsilon = 1e-12);
    let axis = world.rotation * (camera.rotation.inverse() * Vector3::z());
    assert_relative_eq!(axis.y, 0.0, epsilon = 1e-12);
    assert!(axis.x > 0.0);
    let on_floor = Point3::from(floor.normal * floor.distance);
    assert_relative_eq!((world * on_floor).z, 0.0, epsilon = 1e-12);
}

#[test]
fn a_camera_that_looks_straight_down_gives_x_by_its_image() {
    let floor = Plane { normal: Vector3::z(), distance: 0.0 };
    // Looking down: image right is world x, image down is world −y, so image up is world y.
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    let camera = Isometry3::from_parts(Translation3::from(rotation * -Vector3::new(1.0, 2.0, 3.0)), rotation);
    let world = world_frame(&floor, &camera);
    assert_relative_eq!(world.rotation * Vector3::y(), Vector3::x(), epsilon = 1e-9);
    assert_relative_eq!(world * Point3::new(1.0, 2.0, 0.0), Point3::origin(), epsilon = 1e-9);
}
