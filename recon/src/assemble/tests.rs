//! Rooms assembled from surfaces with known truth.

use super::*;
use crate::capture::ReferenceFrame;
use crate::motion::SparsePoint;
use crate::project::{ControlPoint, KnownLength, PickedPoint, ProjectCamera};
use crate::ray_depth::{RayDepth, RayMeasurement};
use crate::surface::rendered::Rendering;
use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Point2, Point3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::raycast::RayScene;
use synthetic::RoomOptions;

/// The same point in single precision, in which rays are cast.
fn single(p: &Point3<f64>) -> Vec3 {
    Vec3::new(p.x as f32, p.y as f32, p.z as f32)
}

/// Point of the room that a camera shows at a pixel, and the depth of this point along the camera's axis; both in metres.
fn hit(scene: &RayScene, camera: &Camera, pixel: &Point2<f64>) -> Option<(Point3<f64>, f64)> {
    let direction = camera.camera_from_world.rotation.inverse() * camera.intrinsics.unproject(pixel)?;
    let depth_m = f64::from(scene.cast(single(&camera.center()), single(&Point3::from(direction)))?.distance);
    Some((camera.center() + direction * depth_m, depth_m))
}

/// Points visible to both cameras, picked to within a pixel.
fn picks(scene: &RayScene, [a, b]: [&Camera; 2], rng: &mut Pcg64Mcg) -> Vec<PickedPoint> {
    let mut points: Vec<PickedPoint> = Vec::new();
    while points.len() < 10 {
        let [width, height] = [a.intrinsics.width, a.intrinsics.height].map(f64::from);
        let pixel = Point2::new(rng.random_range(8.0..width - 8.0), rng.random_range(8.0..height - 8.0));
        let Some((place, _)) = hit(scene, a, &pixel) else { continue };
        let seen = b.project(&place).filter(|p| b.intrinsics.contains(p));
        let Some(other) = seen.filter(|_| !scene.is_blocked(single(&b.center()), single(&place))) else {
            continue;
        };
        let mut slip = || Vector2::new(rng.random_range(-0.6..0.6), rng.random_range(-0.6..0.6));
        points.push(PickedPoint { picks: vec![(0, pixel + slip()), (1, other + slip())] });
    }
    points
}

fn project(points: Vec<PickedPoint>, length: KnownLength) -> Project {
    let camera = |name: &str| ProjectCamera {
        name: name.into(),
        capture: "unused".into(),
        reference: ReferenceFrame::Last,
        intrinsics: None,
    };
    Project {
        path: "room.toml".into(),
        cameras: vec![camera("a"), camera("b")],
        points,
        are_points_proposed: false,
        lengths: vec![length],
        control_points: Vec::new(),
    }
}

/// Captures of two cameras that are their surfaces alone.
fn of_surfaces<'a>(surfaces: &'a [Surface], lenses: &'a [Intrinsics]) -> Captures<'a> {
    static MEASURED: [Vec<MeasuredPixel>; 2] = [Vec::new(), Vec::new()];
    Captures {
        motions: &[],
        surfaces,
        key_frame_discs: &[],
        lenses,
        measured: &MEASURED,
        edges: &[],
        squares: &[],
    }
}

/// A capture with known motion, in its own frame and unit.
struct Filmed {
    camera_from_world: Vec<Option<Isometry3<f64>>>,
    points: Vec<SparsePoint>,
}

impl Filmed {
    /// Moves a camera around its installed pose and follows 600 pixels of its reference picture, each to within 0.17 pixels.
    fn around(camera: &Camera, scene: &RayScene, unit_m: f64, rng: &mut Pcg64Mcg) -> Self {
        const FRAMES: usize = 16;
        const FEATURES: usize = 600;
        let path: Vec<Isometry3<f64>> = (0..FRAMES)
            .map(|frame| {
                let turn = frame as f64 / FRAMES as f64 * std::f64::consts::TAU;
                let shift_m =
                    Vector3::new(0.3 * turn.sin(), 0.2 * (2.0 * turn).sin(), 0.1 * (1.0 - turn.cos()));
                Isometry3::new(shift_m / unit_m, Vector3::new(0.03 * turn.sin(), 0.0, 0.0))
            })
            .collect();
        let lens = &camera.intrinsics;
        let [width, height] = [lens.width, lens.height].map(f64::from);
        let mut points = Vec::new();
        while points.len() < FEATURES {
            let pixel = Point2::new(rng.random_range(8.0..width - 8.0), rng.random_range(8.0..height - 8.0));
            let Some((_, depth_m)) = hit(scene, camera, &pixel) else { continue };
            let position = Point3::from(lens.unproject(&pixel).unwrap() * (depth_m / unit_m));
            let observations = path.iter().enumerate().filter_map(|(frame, pose)| {
                let slip = Vector2::from_fn(|_, _| rng.random_range(-0.17..0.17));
                let seen = lens.project(&(pose * position)).filter(|pixel| lens.contains(pixel))?;
                Some((frame, if frame == 0 { pixel } else { seen + slip }))
            });
            let observations = observations.collect();
            points.push(SparsePoint { position, observations });
        }
        Self { camera_from_world: path.into_iter().map(Some).collect(), points }
    }
}

#[test]
fn furnished_rooms_come_out_metric_and_upright() {
    for seed in 1..=6 {
        let built = RoomOptions { seed, ..RoomOptions::default() }.build().unwrap();
        let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
        let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
        // The two captures have different units.
        let units = [(0, 1.9), (1, 0.7)];
        let surfaces = units.map(|(i, unit_m)| {
            Rendering { unit_m, noise: 0.005, holes: 0.2, seed: seed + i as u64 }.filmed(&built, truth[i])
        });
        let lenses: [Intrinsics; 2] = truth.map(|camera| camera.intrinsics.clone());
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let points = picks(&scene, truth, &mut rng);
        let height_m = truth[0].center().z;
        let project = project(points, KnownLength::Height { camera: 0, height_m });
        let filmed = units.map(|(i, unit_m)| Filmed::around(truth[i], &scene, unit_m, &mut rng));
        let motions = [0, 1].map(|i| {
            let Filmed { camera_from_world, points } = &filmed[i];
            CaptureMotion { lens: &lenses[i], reference: 0, camera_from_world, points }
        });
        let captures = Captures { motions: &motions, ..of_surfaces(&surfaces, &lenses) };
        let (room, report) = assemble(&project, &captures, &AssembleOptions::default()).unwrap();

        let found = [0, 1].map(|i| &room.cameras[i].camera);
        let second = |[a, b]: [&Camera; 2]| a.camera_from_world * b.camera_from_world.inverse();
        let (relative, expected) = (second(found), second(truth));
        let off_m = (relative.translation.vector - expected.translation.vector).norm();
        let off_deg = calib::rotation::angle_between_deg(&relative.rotation, &expected.rotation);
        assert!(off_m < 0.03 && off_deg < 0.25, "seed {seed}: {off_m} m, {off_deg}°, {report:?}");
        for (f, t) in found.iter().zip(truth) {
            let up = |camera: &Camera| camera.camera_from_world.rotation * Vector3::z();
            let tilt_deg = up(f).angle(&up(t)).to_degrees();
            let lift_m = f.center().z - t.center().z;
            assert!(tilt_deg < 0.2 && lift_m.abs() < 0.02, "seed {seed}: {tilt_deg}°, {lift_m} m");
        }
        // Nothing is filled in but the floor under the surfaces' holes.
        let Some(Geometry::Discs(discs)) = &room.geometry else { panic!("{:?}", room.geometry) };
        let assumed: Vec<&Disc> = discs.iter().filter(|disc| disc.filled).collect();
        assert!(report.fusion.assumed_floor > 500 && assumed.len() > 50, "seed {seed}: {}", assumed.len());
        for disc in assumed {
            assert!(disc.center.z.abs() < 0.01 && disc.normal.z > 0.999, "seed {seed}: {disc:?}");
        }
        // The captures are straight, and each sees features of the other.
        let merge = &report.merge;
        assert_eq!(merge.depth_sigma.len(), 2);
        assert!(merge.depth_sigma.iter().all(|sigma| (1e-6..0.01).contains(sigma)), "seed {seed}: {merge:?}");
        let adjustment = merge.adjustment.as_ref().unwrap();
        assert!(
            !adjustment.contradicts_picks && adjustment.shared_features[&[0, 1]] > 0,
            "seed {seed}: {adjustment:?}"
        );
    }
}

/// Of ten picks the second camera measures six at another surface, in its reference picture as in the frames that follow.
#[test]
fn most_picks_measured_at_another_surface_leave_the_room_right() {
    const RATIOS: [f64; 10] = [0.86, 1.0, 0.9, 1.0, 0.955, 1.0, 0.93, 0.95, 1.0, 0.89];
    const UNITS_M: [f64; 2] = [1.9, 0.7];
    let built = RoomOptions { seed: 2, ..RoomOptions::default() }.build().unwrap();
    let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
    let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
    let surfaces = [0, 1].map(|i| {
        Rendering { unit_m: UNITS_M[i], noise: 0.005, holes: 0.2, seed: 2 + i as u64 }
            .filmed(&built, truth[i])
    });
    let lenses: [Intrinsics; 2] = truth.map(|camera| camera.intrinsics.clone());
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let points = picks(&scene, truth, &mut rng);
    let filmed = [0, 1].map(|i| Filmed::around(truth[i], &scene, UNITS_M[i], &mut rng));
    let measured = [0, 1].map(|i| {
        let of_pick = |(point, ratio): (&PickedPoint, f64)| {
            let pixel = point.pixel(i).unwrap();
            let (_, depth_m) = hit(&scene, truth[i], &pixel).unwrap();
            let depth = if i == 1 { ratio } else { 1.0 } * depth_m / UNITS_M[i];
            let place = Point3::from(lenses[i].unproject(&pixel).unwrap() * depth);
            let frames = filmed[i].camera_from_world.iter().enumerate().skip(1);
            let seen =
                frames.filter_map(|(frame, pose)| Some((frame, lenses[i].project(&((*pose)? * place))?)));
            let measured = RayMeasurement { depth: RayDepth { depth, sigma: 0.003 }, seen: seen.collect() };
            MeasuredPixel { pixel, measured }
        };
        points.iter().zip(RATIOS).map(of_pick).collect::<Vec<_>>()
    });
    let motions = [0, 1].map(|i| {
        let Filmed { camera_from_world, points } = &filmed[i];
        CaptureMotion { lens: &lenses[i], reference: 0, camera_from_world, points }
    });
    let project = project(points, KnownLength::Height { camera: 0, height_m: truth[0].center().z });
    let captures = Captures { motions: &motions, measured: &measured, ..of_surfaces(&surfaces, &lenses) };
    let (room, report) = assemble(&project, &captures, &AssembleOptions::default()).unwrap();

    // A slip of a pick over an edge may make one more.
    let foreign = &report.merge.foreign_depths;
    let wrong = (1..).zip(RATIOS).filter(|(_, ratio)| *ratio < 1.0).map(|(number, _)| (number, 1));
    let wrong: Vec<(usize, usize)> = wrong.collect();
    assert!(wrong.iter().all(|depth| foreign.contains(depth)), "{foreign:?}");
    assert!(foreign.len() <= wrong.len() + 1 && report.merge.outliers.is_empty(), "{report:?}");
    let second = |[a, b]: [&Camera; 2]| a.camera_from_world * b.camera_from_world.inverse();
    let (found, expected) = (second([0, 1].map(|i| &room.cameras[i].camera)), second(truth));
    let off_m = (found.translation.vector - expected.translation.vector).norm();
    let off_deg = calib::rotation::angle_between_deg(&found.rotation, &expected.rotation);
    assert!(off_m < 0.03 && off_deg < 0.25, "{off_m} m, {off_deg}°");
}

#[test]
fn a_board_gives_the_metres_in_whichever_camera_it_is_seen() {
    const UNITS_M: [f64; 2] = [1.9, 0.7];
    const SQUARE_M: f64 = 0.05;
    let built = RoomOptions { seed: 1, ..RoomOptions::default() }.build().unwrap();
    let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
    let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
    let surfaces = [0, 1].map(|i| {
        Rendering { unit_m: UNITS_M[i], noise: 0.005, holes: 0.2, seed: 1 + i as u64 }.of(&scene, truth[i])
    });
    let lenses: [Intrinsics; 2] = truth.map(|camera| camera.intrinsics.clone());
    let points = picks(&scene, truth, &mut Pcg64Mcg::seed_from_u64(1));
    let by = |camera: usize, square: Option<Square>| {
        let board = "9x6".parse().unwrap();
        let project = project(points.clone(), KnownLength::Board { camera, board, square_m: SQUARE_M });
        let captures = Captures { squares: &[square], ..of_surfaces(&surfaces, &lenses) };
        assemble(&project, &captures, &AssembleOptions::default())
    };
    for (camera, unit_m) in UNITS_M.into_iter().enumerate() {
        let square = Square { side: SQUARE_M / unit_m, sigma: 0.001, frames: 9, rms_px: 0.1 };
        let (room, report) = by(camera, Some(square)).unwrap();
        assert!((report.metres_per_unit / UNITS_M[0] - 1.0).abs() < 0.01, "camera {camera}: {report:?}");
        for (found, truth) in room.cameras.iter().zip(truth) {
            let lift_m = found.camera.center().z - truth.center().z;
            assert!(lift_m.abs() < 0.03, "camera {camera}: {lift_m} m");
        }
    }
    let refused = by(1, None).unwrap_err().to_string();
    assert!(refused.contains("[scale], board"), "{refused}");
}

/// In bent spaces floors slope, but vertical lines in the pictures do not: a fourth of all edges here. From the top of
/// the image to its bottom one camera's depths are stretched by 12 %, the other's by 6 %.
#[test]
fn vertical_lines_in_pictures_level_a_bent_room() {
    let mut tilts_deg = [0.0; 2];
    for seed in 1..=5 {
        let built = RoomOptions { seed, image_px: [480, 360], ..RoomOptions::default() }.build().unwrap();
        let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
        let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
        let surfaces = [(0, 0.12), (1, 0.06)].map(|(i, bent)| {
            let mut surface = Rendering { unit_m: 0.8, noise: 0.005, holes: 0.2, seed }.of(&scene, truth[i]);
            let (width, height) = (surface.width(), surface.height());
            for (i, depth) in surface.depth.iter_mut().enumerate() {
                *depth *= 1.0 + bent * ((i / width) as f32 / height as f32 - 0.5);
            }
            surface
        });
        let lenses = truth.map(|camera| camera.intrinsics.clone());
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut normal = |camera: &Camera, is_plumb: bool| {
            let up = camera.camera_from_world.rotation * Vector3::z();
            let any = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0)).normalize();
            if is_plumb { up.cross(&any).normalize() + 0.01 * any } else { any }.normalize()
        };
        let edges =
            truth.map(|camera| (0..1500).map(|k| normal(camera, k % 4 == 0)).collect::<Vec<Vector3<f64>>>());
        let points = picks(&scene, truth, &mut Pcg64Mcg::seed_from_u64(seed));
        let project = project(points, KnownLength::Height { camera: 0, height_m: truth[0].center().z });
        for (tilt_deg, edges) in tilts_deg.iter_mut().zip([&[][..], &edges]) {
            let captures = Captures { edges, ..of_surfaces(&surfaces, &lenses) };
            let (room, report) = assemble(&project, &captures, &AssembleOptions::default()).unwrap();
            assert_eq!(report.floor.plumb_captures > 0, !edges.is_empty(), "seed {seed}: {report:?}");
            for (found, truth) in room.cameras.iter().zip(truth) {
                let up = |camera: &Camera| camera.camera_from_world.rotation * Vector3::z();
                *tilt_deg += up(&found.camera).angle(&up(truth)).to_degrees() / 10.0;
            }
        }
    }
    let [without, with] = tilts_deg;
    assert!(with < 0.9 * without, "{with}° with, {without}° without lines");
}

/// Pixel of a point of the room in a camera, if it is seen there.
fn seen(scene: &RayScene, camera: &Camera, place: &Point3<f64>) -> Option<Point2<f64>> {
    let single = |p: &Point3<f64>| Vec3::new(p.x as f32, p.y as f32, p.z as f32);
    let pixel = camera.project(place).filter(|p| camera.intrinsics.contains(p))?;
    // A point of a surface is seen until just before it.
    let before = place + (camera.center() - place).normalize() * 0.02;
    (!scene.is_blocked(single(&camera.center()), single(&before))).then_some(pixel)
}

/// Known lengths contradict each other by their errors; three of four outvote one that is wrong, and the room stands in the
/// coordinates of its control points.
#[test]
fn several_lengths_give_the_metres_and_control_points_the_coordinates() {
    let built = RoomOptions { seed: 2, ..RoomOptions::default() }.build().unwrap();
    let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
    let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
    let surfaces = [(0, 1.9), (1, 0.7)].map(|(i, unit_m)| {
        Rendering { unit_m, noise: 0.002, holes: 0.0, seed: 2 + i as u64 }.of(&scene, truth[i])
    });
    let lenses: [Intrinsics; 2] = truth.map(|camera| camera.intrinsics.clone());
    let picked = picks(&scene, truth, &mut Pcg64Mcg::seed_from_u64(2));

    // Places on the floor that one camera sees, and distances between them.
    let foot = truth[0].center().xy() + (truth[1].center().xy() - truth[0].center().xy()) * 0.5;
    let floor = (-40..40).flat_map(|x| (-40..40).map(move |y| (0.1 * f64::from(x), 0.1 * f64::from(y))));
    let floor: Vec<(Point3<f64>, Point2<f64>)> = floor
        .map(|(x, y)| Point3::new(foot.x + x, foot.y + y, 0.0))
        .filter_map(|place| Some((place, seen(&scene, truth[0], &place)?)))
        .collect();
    let [first, middle, last] = [floor.len() / 8, floor.len() / 2, floor.len() * 7 / 8].map(|i| floor[i]);
    let distance = |from: (Point3<f64>, Point2<f64>), to: (Point3<f64>, Point2<f64>), stretched: f64| {
        KnownLength::Distance {
            camera: 0,
            from: from.1,
            to: to.1,
            metres: stretched * (from.0 - to.0).norm(),
        }
    };
    let lengths = vec![
        distance(first, middle, 1.0),
        distance(middle, last, 1.3),
        distance(first, last, 1.0),
        KnownLength::Height { camera: 1, height_m: truth[1].center().z },
    ];
    // Coordinates of a plan: turned and moved against the room's.
    let plan = nalgebra::Isometry2::new(Vector2::new(20.0, -4.0), 1.1);
    let control_points: Vec<ControlPoint> = [first, middle, last]
        .map(|(place, pixel)| ControlPoint {
            picks: vec![(0, pixel)],
            place: plan * place.xy(),
            height_m: Some(0.0),
        })
        .into();
    let project = Project {
        lengths,
        control_points,
        ..project(picked, KnownLength::Height { camera: 0, height_m: 1.0 })
    };
    let captures = of_surfaces(&surfaces, &lenses);
    let (room, report) = assemble(&project, &captures, &AssembleOptions::default()).unwrap();
    for (found, truth) in room.cameras.iter().zip(truth) {
        let expected = plan * truth.center().xy();
        let off_m = (found.camera.center().xy() - expected).norm();
        assert!(off_m < 0.06, "{off_m} m, {:?}", report.evidence);
        let heading = |pose: &nalgebra::UnitQuaternion<f64>| (pose.inverse() * Vector3::z()).xy();
        let expected = plan.rotation * heading(&truth.camera_from_world.rotation);
        let turn_deg = heading(&found.camera.camera_from_world.rotation).angle(&expected).to_degrees();
        assert!(turn_deg < 0.6, "{turn_deg}°");
    }
    let off: Vec<f64> = report.evidence.lengths.iter().map(|l| l.found_m / l.known_m - 1.0).collect();
    assert_eq!(off.len(), 5, "four lengths, and the control points' extent");
    for (i, off) in off.iter().enumerate() {
        let expected = if i == 1 { 1.0 / 1.3 - 1.0 } else { 0.0 };
        assert!((off - expected).abs() < 0.012, "length {i}: {off}");
    }
    let control = &report.evidence.control_points;
    assert!(control.len() == 3 && control.iter().all(|point| point.off_m.iter().all(|off| off.abs() < 0.05)));

    // A plan whose y points down is a mirrored one.
    let mut mirrored = project.clone();
    for point in &mut mirrored.control_points {
        point.place.y *= -1.0;
    }
    let refused = assemble(&mirrored, &captures, &AssembleOptions::default()).unwrap_err().to_string();
    assert!(refused.contains("[[control]]") && refused.contains("mirrored"), "{refused}");
}
