//! Picks of which most are measured at another surface in one of the cameras.

use calib::{Camera, rotation};
use nalgebra::{Point2, Point3, Similarity3};
use scenes::geometry::{vec3_from_point, vec3_from_vector};
use scenes::raycast::RayScene;
use synthetic::{RoomOptions, SyntheticRoom};

use super::super::*;
use super::project_of;
use crate::project::PickedPoint;
use crate::ray_depth::RayDepth;
use crate::surface::rendered::Rendering;

/// Metres in a unit of each camera.
const UNITS_M: [f64; 2] = [0.9, 1.2];
/// Ratio of the depth that one of the cameras has at each pick to the true one. All are equally certain, and most are wrong.
const RATIOS: [f64; 12] = [0.84, 1.0, 0.87, 0.9, 1.0, 0.955, 1.0, 0.93, 0.96, 1.0, 0.94, 0.89];

fn room() -> SyntheticRoom {
    RoomOptions { seed: 2, image_px: [480, 360], ..RoomOptions::default() }.build().unwrap()
}

/// Places that both cameras see, a pick each, with their true depths along z in metres.
fn picked(room: &SyntheticRoom, [a, b]: [&Camera; 2]) -> Vec<(PickedPoint, [f64; 2])> {
    let scene = RayScene::new(room.room.geometry.as_ref().unwrap()).unwrap();
    let pixels = (0..).map(|i| {
        let [right, down] = [0.618, 0.414].map(|step| (0.5 + f64::from(i) * step).fract());
        Point2::new(20.0 + 440.0 * right, 20.0 + 320.0 * down)
    });
    let places = pixels.filter_map(|pixel| {
        let ray = a.camera_from_world.rotation.inverse() * a.intrinsics.unproject(&pixel)?;
        let hit = scene.cast(vec3_from_point(&a.center()), vec3_from_vector(&ray))?;
        let place: Point3<f64> = a.center() + ray * f64::from(hit.distance);
        let other = b.project(&place).filter(|pixel| b.intrinsics.contains(pixel))?;
        let is_hidden = scene.is_blocked(vec3_from_point(&b.center()), vec3_from_point(&place));
        let depths = [a, b].map(|camera| (camera.camera_from_world * place).z);
        (!is_hidden).then(|| (PickedPoint { picks: vec![(0, pixel), (1, other)] }, depths))
    });
    places.take(RATIOS.len()).collect()
}

/// Report of joining two cameras by picks of which most have a wrong depth in one of them, the error of the ratio of their scales in
/// percent, and that of their relative orientation in degrees. `is_blank`: whether the pictures show nothing.
fn merged(wrong_camera: usize, is_blank: bool) -> (MergeReport, f64, f64) {
    let room = room();
    let cameras = [0, 1].map(|index| &room.room.cameras[index].camera);
    let picked = picked(&room, cameras);
    let surfaces = [0, 1].map(|index| {
        let rendering = Rendering { unit_m: UNITS_M[index], noise: 0.003, holes: 0.1, seed: index as u64 };
        let mut surface = rendering.filmed(&room, cameras[index]);
        if is_blank {
            surface.picture.fill(90);
        }
        surface
    });
    let measured = [0, 1].map(|index| {
        let of_pick = |((pick, depths_m), ratio): (&(PickedPoint, [f64; 2]), f64)| {
            let ratio = if index == wrong_camera { ratio } else { 1.0 };
            let depth = RayDepth { depth: ratio * depths_m[index] / UNITS_M[index], sigma: 0.003 };
            MeasuredPixel {
                pixel: pick.pixel(index).unwrap(),
                measured: RayMeasurement { depth, seen: Vec::new() },
            }
        };
        picked.iter().zip(RATIOS).map(of_pick).collect::<Vec<_>>()
    });
    let lenses = cameras.map(|camera| camera.intrinsics.clone());
    let project = project_of(picked.into_iter().map(|(pick, _)| pick).collect(), &lenses[0]);
    let (merged, report) = merge(&project, &surfaces, &lenses, &measured, &MergeOptions::default()).unwrap();
    let truth = cameras[0].camera_from_world * cameras[1].camera_from_world.inverse();
    let found: &Similarity3<f64> = &merged.common_from_camera[1];
    let scale = found.scaling() * UNITS_M[0] / UNITS_M[1] - 1.0;
    (report, 100.0 * scale.abs(), rotation::angle_between_deg(&found.isometry.rotation, &truth.rotation))
}

#[test]
fn depths_of_other_surfaces_are_left_out_where_surfaces_and_pictures_confirm_the_rest() {
    for camera in [0, 1] {
        let (report, scale_percent, turn_deg) = merged(camera, false);
        let wrong = (1..).zip(RATIOS).filter(|(_, ratio)| *ratio < 1.0).map(|(number, _)| (number, camera));
        let mut foreign = report.foreign_depths.clone();
        foreign.sort_unstable();
        assert_eq!(foreign, wrong.collect::<Vec<_>>());
        assert!(
            report.outliers.is_empty() && scale_percent < 0.5 && turn_deg < 0.3,
            "{camera}: {scale_percent} %, {turn_deg}°"
        );
    }
}

#[test]
fn without_pictures_that_confirm_it_no_depth_is_left_out() {
    let (report, scale_percent, _) = merged(1, true);
    assert!(report.foreign_depths.is_empty(), "{:?}", report.foreign_depths);
    assert!(scale_percent > 2.0, "the wrong depths do no harm: {scale_percent} %");
}
