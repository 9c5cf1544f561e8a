//! Two cameras in a room of known geometry, each with a frame and a scale of its own.

mod adjusted;
mod box_room;
mod foreign_depths;

use super::*;
use crate::project::{KnownLength, PickedPoint, ProjectCamera};
use crate::ray_depth::RayDepth;
use box_room::BoxRoom;
use calib::{Intrinsics, rotation};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Half extents of the room, a box around the origin.
const HALF: Vector3<f64> = Vector3::new(3.0, 2.0, 1.3);
/// Unit of each camera, metres.
const UNITS: [f64; 2] = [1.7, 0.6];

fn lens() -> Intrinsics {
    Intrinsics::from_horizontal_fov(320, 240, 80.0)
}

fn poses() -> [Isometry3<f64>; 2] {
    [Vector3::new(-2.5, -1.5, 0.9), Vector3::new(2.4, 1.6, 0.8)].map(|eye| {
        let ahead = Vector3::new(0.2, 0.1, -0.6) - eye;
        let rotation = UnitQuaternion::face_towards(&ahead, &-Vector3::z());
        Isometry3::from_parts(eye.into(), rotation).inverse()
    })
}

pub(super) fn surface(camera: usize) -> Surface {
    let room = BoxRoom([Point3::from(-HALF), Point3::from(HALF)]);
    room.seen(&lens(), &poses()[camera], UNITS[camera])
}

/// Points on the floor, picked in both cameras with half a pixel of error.
fn picked(places: &[(f64, f64)]) -> Vec<PickedPoint> {
    places
        .iter()
        .enumerate()
        .map(|(i, (x, y))| {
            let world = Point3::new(*x, *y, -HALF.z);
            let picks = poses()
                .iter()
                .enumerate()
                .map(|(camera, pose)| {
                    let error = 0.4 * ((7 * i + 3 * camera) as f64).sin();
                    (camera, lens().project(&(pose * world)).unwrap() + nalgebra::Vector2::new(error, -error))
                })
                .collect();
            PickedPoint { picks }
        })
        .collect()
}

/// Points visible to both cameras.
fn project() -> Project {
    let places = [(-1.0, -1.0), (1.2, -0.8), (0.3, 0.9), (-0.6, 0.7), (0.9, 0.3), (-0.2, -0.4), (1.5, 0.8)];
    project_of(picked(&places), &lens())
}

/// Two cameras with these points.
fn project_of(points: Vec<PickedPoint>, lens: &Intrinsics) -> Project {
    let camera = |name: &str| ProjectCamera {
        name: name.into(),
        capture: "unused".into(),
        reference: crate::capture::ReferenceFrame::Last,
        intrinsics: Some(lens.clone()),
    };
    Project {
        path: "room.toml".into(),
        cameras: vec![camera("a"), camera("b")],
        points,
        are_points_proposed: false,
        lengths: vec![KnownLength::Height { camera: 0, height_m: 2.2 }],
        control_points: Vec::new(),
    }
}

fn merged(project: &Project, options: &MergeOptions) -> Result<(Merged, MergeReport)> {
    merge(project, &[surface(0), surface(1)], &[lens(), lens()], &[vec![], vec![]], options)
}

/// Error of the second camera's pose relative to the first: share of their distance, degrees, share of the scale.
fn errors(merged: &Merged) -> (f64, f64, f64) {
    let truth = poses()[0] * poses()[1].inverse();
    let found = merged.common_from_camera[1];
    let shift = found.isometry.translation.vector * UNITS[0] - truth.translation.vector;
    let turn = rotation::angle_between_deg(&found.isometry.rotation, &truth.rotation);
    let scale = found.scaling() * UNITS[0] / UNITS[1] - 1.0;
    (shift.norm() / truth.translation.vector.norm(), turn, scale.abs())
}

#[test]
fn picks_join_cameras_of_any_frame_and_scale() {
    let (result, report) = merged(&project(), &MergeOptions::default()).unwrap();
    let (shift, turn, scale) = errors(&result);
    assert!(shift < 0.02 && turn < 0.6 && scale < 0.02, "{shift} {turn} {scale}");
    assert!(report.outliers.is_empty() && report.pick_rms_px < 1.0, "{report:?}");
}

#[test]
fn a_bad_pick_is_named_and_left_out() {
    let mut project = project();
    project.points[2].picks[1].1 += nalgebra::Vector2::new(25.0, -14.0);
    let (result, report) = merged(&project, &MergeOptions::default()).unwrap();
    assert_eq!(report.outliers.len(), 1, "{report:?}");
    assert_eq!(report.outliers[0].0, 3);
    assert!(report.outliers[0].2 > 6.0);
    assert!(result.points[2].is_none());
    let (shift, turn, _) = errors(&result);
    assert!(shift < 0.02 && turn < 0.6, "{shift} {turn}");
}

#[test]
fn depths_that_both_contradict_a_pick_leave_it_out_unless_one_is_uncertain() {
    let project = project();
    let left_out = |sigmas: [f64; 2]| {
        let measured = [0, 1].map(|camera| {
            let pixel = project.points[3].pixel(camera).unwrap();
            let depth = 1.2 * surface(camera).point_at(&pixel).unwrap().z;
            let depth = RayDepth { depth, sigma: sigmas[camera] };
            vec![MeasuredPixel { pixel, measured: RayMeasurement { depth, seen: Vec::new() } }]
        });
        let surfaces = [surface(0), surface(1)];
        let (_, report) =
            merge(&project, &surfaces, &[lens(), lens()], &measured, &MergeOptions::default()).unwrap();
        report.outliers.iter().map(|(point, ..)| *point).collect::<Vec<_>>()
    };
    assert_eq!(left_out([0.01, 0.01]), [4]);
    // Beside an edge a depth is as uncertain as the step there.
    assert!(left_out([0.2, 0.01]).is_empty());
    assert!(left_out([0.01, 0.2]).is_empty());
}

#[test]
fn points_that_do_not_agree_join_nothing() {
    let mut project = project();
    project.points.truncate(4);
    // The same points in another order: no three fit.
    let pixels: Vec<Point2<f64>> = project.points.iter().map(|p| p.picks[1].1).collect();
    for (i, point) in project.points.iter_mut().enumerate() {
        point.picks[1].1 = pixels[(i + 1) % 4];
    }
    let line = merged(&project, &MergeOptions::default()).unwrap_err().to_string();
    assert!(line.contains("room.toml") && line.contains("[[point]]"), "{line}");
}

#[test]
fn picks_without_depth_are_told() {
    let mut blind = surface(1);
    blind.depth.fill(0.0);
    let surfaces = [surface(0), blind];
    let line = merge(&project(), &surfaces, &[lens(), lens()], &[vec![], vec![]], &MergeOptions::default())
        .unwrap_err()
        .to_string();
    assert!(line.contains("depth at only 0") && line.contains("[[point]] 1, b"), "{line}");
}

/// Surfaces without depth at some of the project's points, in either camera.
fn blind_at(project: &Project, points: &[usize]) -> [Surface; 2] {
    [0, 1].map(|camera| {
        let mut surface = surface(camera);
        for point in points {
            let pixel = project.points[*point].pixel(camera).unwrap();
            let width = surface.width();
            for (i, depth) in surface.depth.iter_mut().enumerate() {
                let at = Point2::new((i % width) as f64, (i / width) as f64);
                if (at - pixel).amax() < 12.0 {
                    *depth = 0.0;
                }
            }
        }
        surface
    })
}

#[test]
fn picks_without_depth_still_count_by_where_their_rays_meet() {
    let options = MergeOptions::default();
    let run = |project: &Project| {
        let surfaces = blind_at(project, &[1, 5]);
        merge(project, &surfaces, &[lens(), lens()], &[vec![], vec![]], &options).unwrap()
    };
    let mut project = project();
    let (result, report) = run(&project);
    assert!(report.outliers.is_empty(), "{report:?}");
    let there = poses()[0] * Point3::new(1.2, -0.8, -HALF.z) / UNITS[0];
    assert!((result.points[1].unwrap() - there).norm() < 0.05, "{:?} {there}", result.points[1]);
    // A wrong pick is detected where there are enough others: with few points some rotation of a camera lets the rays
    // meet for any picks. The cameras face each other, so the wrong pick's own rays pass beside each other.
    project.points.extend(picked(&[
        (0.0, 0.2),
        (0.6, -1.1),
        (-1.2, 0.1),
        (0.4, -0.3),
        (1.0, 1.1),
        (-0.5, -1.2),
    ]));
    project.points[1].picks[1].1.x += 30.0;
    let (_, report) = run(&project);
    assert!(report.outliers.iter().any(|(point, ..)| *point == 2), "{report:?}");
}

/// Residuals of correct cameras: the rays of one pick's two pixels miss each other by the difference of both pixels' errors. The point
/// lies in the middle, so each residual is half of that difference. The fit without further constraints is too good: five picks have
/// residuals of a tenth of their noise.
#[test]
fn right_cameras_do_not_spoil_a_fit_that_is_too_good() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    for sigma_px in [0.5, 1.0, 2.0] {
        let mut off_px =
            || 0.5 * sigma_px * (rng.sample::<f64, _>(StandardNormal) - rng.sample::<f64, _>(StandardNormal));
        let sets_px = (0..1000).map(|_| ((0..5).map(|_| off_px().powi(2)).sum::<f64>() / 5.0).sqrt());
        let spoiling = sets_px.filter(|rms_px| spoils(*rms_px, 0.1 * sigma_px, sigma_px)).count();
        assert!(spoiling <= 10, "{sigma_px} px: {spoiling} of 1000");
        assert!(spoils(1.9 * sigma_px, 0.1 * sigma_px, sigma_px), "{sigma_px} px");
    }
}

#[test]
fn picks_almost_on_a_line_are_refused() {
    let mut project = project();
    project.points.truncate(6);
    for (i, point) in project.points.iter_mut().enumerate() {
        // Along a skirting board, picked to a pixel or so.
        let world = Point3::new(0.4 * i as f64 - 1.0, 0.3 * i as f64 - 0.8, -HALF.z);
        for (camera, pixel) in &mut point.picks {
            let off =
                nalgebra::Vector2::new((5 * i + *camera) as f64, (3 * i + 7 * *camera) as f64).map(f64::sin);
            *pixel = lens().project(&(poses()[*camera] * world)).unwrap() + 1.2 * off;
        }
    }
    let line = merged(&project, &MergeOptions::default()).unwrap_err().to_string();
    assert!(line.contains("on a line") && line.contains("`a` and `b`"), "{line}");
}

/// Surface of a capture whose lens or path bends its space: the error of the depth grows across the image.
fn bent(camera: usize, slope: f64) -> Surface {
    let mut surface = surface(camera);
    let lens = lens();
    for (i, depth) in surface.depth.iter_mut().enumerate() {
        let across = ((i as f64 / f64::from(lens.width)).floor() - lens.cy) / lens.fy;
        *depth *= (1.0 + slope * across) as f32;
    }
    surface
}

#[test]
fn bent_depths_are_noticed_and_trusted_less() {
    let options = MergeOptions::default();
    let run = |slope: f64| {
        let surfaces = [bent(0, slope), surface(1)];
        merge(&project(), &surfaces, &[lens(), lens()], &[vec![], vec![]], &options).unwrap()
    };
    let (straight, straight_report) = run(0.0);
    let (result, report) = run(0.5);
    assert!(report.depth_sigma[0] > 2.0 * straight_report.depth_sigma[0], "{report:?} {straight_report:?}");
    assert!(report.outliers.is_empty(), "{report:?}");
    let (bent_errors, straight_errors) = (errors(&result), errors(&straight));
    assert!(bent_errors.1 < 2.0 && straight_errors.1 < 0.6, "{bent_errors:?} {straight_errors:?}");
}

#[test]
fn one_camera_alone_stands_where_it_is_and_misses_no_pick() {
    let mut project = project();
    project.cameras.truncate(1);
    project.points.clear();
    let (result, report) =
        merge(&project, &[surface(0)], &[lens()], &[vec![]], &MergeOptions::default()).unwrap();
    assert_eq!(result.common_from_camera, [Similarity3::identity()]);
    assert_eq!(report.pick_rms_px.to_bits(), 0.0_f64.to_bits());
}
