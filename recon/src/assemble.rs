//! One room from all cameras' surfaces: merged, with its floor found, in metres, fused.

use nalgebra::{Isometry3, Similarity3};
use scenes::geometry::{Disc, Geometry, point_from_vec3, vector_from_vec3};
use scenes::room::{Room, RoomCamera};

use crate::floor::{self, FloorOptions, FloorReport, SurfacePoint};
use crate::fusion::{self, FusionOptions, FusionReport};
use crate::merge::{self, MergeOptions, MergeReport};
use crate::project::Project;
use crate::ray_depth::MeasuredPixel;
use crate::surface::{Origin, Surface};
use crate::{Result, scale};

/// How a room is put together.
#[derive(Debug, Clone, Default)]
pub struct AssembleOptions {
    /// Joining cameras.
    pub merge: MergeOptions,
    /// Finding the floor.
    pub floor: FloorOptions,
    /// Making discs.
    pub fusion: FusionOptions,
}

/// What was done.
#[derive(Debug, Clone, PartialEq)]
pub struct AssembleReport {
    /// Joining cameras.
    pub merge: MergeReport,
    /// Finding the floor; lengths in units of the first camera's reconstruction.
    pub floor: FloorReport,
    /// Metres in a unit of the first camera's reconstruction.
    pub metres_per_unit: f64,
    /// Making discs.
    pub fusion: FusionReport,
}

/// Puts a room together. Zones are left empty, reference images unnamed.
///
/// # Arguments
/// `surfaces`, `lenses` (intrinsics as filmed) and `measured` (the project's pixels whose depth was measured on its own):
/// one a camera of the project, in its order.
///
/// # Errors
/// Picks that do not fit, no depth where it is needed, no floor: each with its place.
pub fn assemble(
    project: &Project,
    surfaces: &[Surface],
    lenses: &[calib::Intrinsics],
    measured: &[Vec<MeasuredPixel>],
    options: &AssembleOptions,
) -> Result<(Room, AssembleReport)> {
    let (merged, merge_report) = merge::merge(project, surfaces, lenses, measured, &options.merge)?;
    for (point, camera, off) in &merge_report.outliers {
        tracing::warn!(
            "{}: [[point]] {point}, {}: left out, {off:.1} pixels from where the other picks put it",
            project.path.display(),
            project.cameras[*camera].name
        );
    }
    let poses: Vec<Isometry3<f64>> = merged.common_from_camera.iter().map(camera_pose).collect();
    let points = surface_points(surfaces, &merged.common_from_camera);
    let (plane, floor_report) = floor::find(&points, &poses, &options.floor)?;
    let metres_per_unit =
        scale::metres_per_unit(project, surfaces, lenses, measured, &merged, &poses, &plane)?;
    let world_from_common = floor::metric(&floor::world_frame(&plane, &poses[0]), metres_per_unit);
    let world_from_camera: Vec<Similarity3<f64>> =
        merged.common_from_camera.iter().map(|s| world_from_common * s).collect();
    let (discs, fusion_report) = fusion::fuse(surfaces, &world_from_camera, &options.fusion);
    let cameras = project
        .cameras
        .iter()
        .zip(lenses)
        .zip(&world_from_camera)
        .map(|((camera, lens), pose)| RoomCamera {
            name: camera.name.clone(),
            camera: calib::Camera { intrinsics: lens.clone(), camera_from_world: camera_pose(pose) },
            reference: None,
        })
        .collect();
    let discs: Vec<Disc> = discs.into_iter().filter(is_finite).collect();
    let room = Room { cameras, geometry: Some(Geometry::Discs(discs)), ..Room::default() };
    let report =
        AssembleReport { merge: merge_report, floor: floor_report, metres_per_unit, fusion: fusion_report };
    Ok((room, report))
}

fn is_finite(disc: &Disc) -> bool {
    disc.center.is_finite() && disc.normal.is_finite() && disc.radius.is_finite() && disc.radius > 0.0
}

/// A camera's pose in the other frame, in that frame's units: the scale only stretches what the camera sees.
fn camera_pose(frame_from_camera: &Similarity3<f64>) -> Isometry3<f64> {
    frame_from_camera.isometry.inverse()
}

/// Every few pixels of what was measured, in the common frame.
fn surface_points(surfaces: &[Surface], common_from_camera: &[Similarity3<f64>]) -> Vec<SurfacePoint> {
    /// Pixels between samples.
    const STRIDE: usize = 4;
    let mut points = Vec::new();
    for (surface, common) in surfaces.iter().zip(common_from_camera) {
        for y in (0..surface.height()).step_by(STRIDE) {
            for x in (0..surface.width()).step_by(STRIDE) {
                let i = y * surface.width() + x;
                let Some(point) = surface.point(i).filter(|_| surface.origin[i] == Origin::Stereo) else {
                    continue;
                };
                let scale = common.scaling();
                points.push(SurfacePoint {
                    position: common * point_from_vec3(point),
                    normal: common.isometry.rotation * vector_from_vec3(surface.normal[i]),
                    area: f64::from(surface.area(i)) * (STRIDE * STRIDE) as f64 * scale * scale,
                    sigma: surface.depth_sigma(point.z) * f64::from(point.z) * scale,
                });
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::ReferenceFrame;
    use crate::project::{PickedPoint, ProjectCamera, Scale};
    use crate::surface::rendered::Rendering;
    use calib::{Camera, Intrinsics};
    use glam::Vec3;
    use nalgebra::{Point2, Point3, Vector2, Vector3};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;
    use scenes::raycast::RayScene;
    use scenes::synthetic::RoomOptions;

    /// Points that both cameras see, picked to within a pixel.
    fn picks(scene: &RayScene, [a, b]: [&Camera; 2], rng: &mut Pcg64Mcg) -> Vec<PickedPoint> {
        let single = |p: &Point3<f64>| Vec3::new(p.x as f32, p.y as f32, p.z as f32);
        let mut points: Vec<PickedPoint> = Vec::new();
        while points.len() < 10 {
            let [width, height] = [a.intrinsics.width, a.intrinsics.height].map(f64::from);
            let pixel = Point2::new(rng.random_range(8.0..width - 8.0), rng.random_range(8.0..height - 8.0));
            let ray = a.intrinsics.unproject(&pixel).unwrap();
            let direction = a.camera_from_world.rotation.inverse() * ray;
            let Some(hit) = scene.cast(single(&a.center()), single(&Point3::from(direction))) else {
                continue;
            };
            let place = a.center() + direction * f64::from(hit.distance);
            let seen = b.project(&place).filter(|p| b.intrinsics.contains(p));
            let Some(other) = seen.filter(|_| !scene.is_blocked(single(&b.center()), single(&place))) else {
                continue;
            };
            let mut slip = || Vector2::new(rng.random_range(-0.6..0.6), rng.random_range(-0.6..0.6));
            points.push(PickedPoint { picks: vec![(0, pixel + slip()), (1, other + slip())] });
        }
        points
    }

    fn project(points: Vec<PickedPoint>, scale: Scale) -> Project {
        let camera = |name: &str| ProjectCamera {
            name: name.into(),
            capture: "unused".into(),
            reference: ReferenceFrame::Last,
            intrinsics: None,
        };
        Project { path: "room.toml".into(), cameras: vec![camera("a"), camera("b")], points, scale }
    }

    #[test]
    fn furnished_rooms_come_out_metric_and_upright() {
        for seed in 1..=6 {
            let built = RoomOptions { seed, ..RoomOptions::default() }.build().unwrap();
            let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
            let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
            // Two captures know nothing of each other's unit.
            let surfaces = [(0, 1.9), (1, 0.7)].map(|(i, unit_m)| {
                Rendering { unit_m, noise: 0.005, holes: 0.2, seed: seed + i as u64 }.of(&scene, truth[i])
            });
            let lenses: [Intrinsics; 2] = truth.map(|camera| camera.intrinsics.clone());
            let points = picks(&scene, truth, &mut Pcg64Mcg::seed_from_u64(seed));
            let height_m = truth[0].center().z;
            let project = project(points, Scale::Height { camera: 0, height_m });
            let (room, report) =
                assemble(&project, &surfaces, &lenses, &[vec![], vec![]], &AssembleOptions::default())
                    .unwrap();

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
        }
    }

    /// What pictures have in common says how cameras stand where their spaces are bent: across the image here, by half as
    /// much as the capture of a real room was. Both are bent the same way, so that their surfaces agree all the same.
    #[test]
    fn pictures_hold_what_bent_depths_let_go() {
        let mut turns_deg = [0.0; 2];
        for seed in 4..=8 {
            let built = RoomOptions { seed, image_px: [480, 360], ..RoomOptions::default() }.build().unwrap();
            let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
            let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
            let surfaces = truth.map(|camera| {
                let mut surface =
                    Rendering { unit_m: 0.8, noise: 0.005, holes: 0.2, seed }.filmed(&built, camera);
                let width = surface.width();
                for (i, depth) in surface.depth.iter_mut().enumerate() {
                    *depth *= 1.0 + 0.04 * ((i % width) as f32 / width as f32 - 0.5);
                }
                surface
            });
            let lenses = truth.map(|camera| camera.intrinsics.clone());
            let mut points = picks(&scene, truth, &mut Pcg64Mcg::seed_from_u64(seed));
            points.truncate(8);
            let project = project(points, Scale::Height { camera: 0, height_m: truth[0].center().z });
            let expected = truth[0].camera_from_world * truth[1].camera_from_world.inverse();
            for (turn_deg, matches) in turns_deg.iter_mut().zip([0, MergeOptions::default().matches]) {
                let options = MergeOptions { matches, ..MergeOptions::default() };
                let (merged, report) =
                    merge::merge(&project, &surfaces, &lenses, &[vec![], vec![]], &options).unwrap();
                assert_eq!(report.matches > 0, matches > 0, "seed {seed}: {report:?}");
                let found = merged.common_from_camera[0].inverse() * merged.common_from_camera[1];
                *turn_deg += calib::rotation::angle_between_deg(&found.isometry.rotation, &expected.rotation);
            }
        }
        let [without, with] = turns_deg;
        assert!(with < 0.75 * without, "{with}° with, {without}° without what pictures have in common");
    }
}
