//! One room from all cameras' surfaces: merged, with its floor found, in metres, fused.

use nalgebra::{Isometry3, Similarity3, Vector3};
use scenes::geometry::{Disc, Geometry, point_from_vec3, vector_from_vec3};
use scenes::room::{Room, RoomCamera};

use crate::floor::{self, FloorOptions, FloorReport, Plane, SurfacePoint};
use crate::fusion::{self, FusionOptions, FusionReport};
use crate::merge::{self, MergeOptions, MergeReport, Merged};
use crate::plumb::{self, Plumb};
use crate::project::Project;
use crate::ray_depth::MeasuredPixel;
use crate::surface::{Origin, Surface};
use crate::{Result, scale};

/// Depths at picks that are off by more than this share are worth a word.
const DOUBTFUL_DEPTH: f64 = 0.015;

/// Pixels between those that a floor is looked for among …
const STRIDE: usize = 4;
/// … and at first, to know about where it is.
const COARSE_STRIDE: usize = 8;

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

/// What was made of the captures: everything once a camera of the project, in its order.
#[derive(Debug, Clone, Copy)]
pub struct Captures<'a> {
    /// What each sees from its reference view.
    pub surfaces: &'a [Surface],
    /// Intrinsics as filmed.
    pub lenses: &'a [calib::Intrinsics],
    /// The project's pixels whose depth was measured on its own.
    pub measured: &'a [Vec<MeasuredPixel>],
    /// Normals of the interpretation planes of edges in the pictures, in the reference view's frame; may be empty.
    pub edges: &'a [Vec<Vector3<f64>>],
}

/// Puts a room together. Zones are left empty, reference images unnamed.
///
/// # Errors
/// Picks that do not fit, no depth where it is needed, no floor: each with its place.
pub fn assemble(
    project: &Project,
    captures: &Captures<'_>,
    options: &AssembleOptions,
) -> Result<(Room, AssembleReport)> {
    let Captures { surfaces, lenses, measured, .. } = *captures;
    let Joined { merged, report: merge_report, poses, floor, floor_report } =
        captures.joined(project, options)?;
    for (point, camera, off) in &merge_report.outliers {
        tracing::warn!(
            "{}: [[point]] {point}, {}: left out, {off:.1} pixels from where the other picks put it",
            project.path.display(),
            project.cameras[*camera].name
        );
    }
    for (camera, sigma) in project.cameras.iter().zip(&merge_report.depth_sigma) {
        if *sigma > DOUBTFUL_DEPTH {
            tracing::warn!(
                "camera `{}`: its depths are off by about {:.1} % at the picks, so its space is bent; check the intrinsics, and film along a wider path",
                camera.name,
                100.0 * sigma
            );
        }
    }
    let metres_per_unit =
        scale::metres_per_unit(project, surfaces, lenses, measured, &merged, &poses, &floor)?;
    let world_from_common = floor::metric(&floor::world_frame(&floor, &poses[0]), metres_per_unit);
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
            camera: calib::Camera { intrinsics: lens.clone(), camera_from_world: merge::camera_pose(pose) },
            reference: None,
        })
        .collect();
    let discs: Vec<Disc> = discs.into_iter().filter(is_finite).collect();
    let room = Room { cameras, geometry: Some(Geometry::Discs(discs)), ..Room::default() };
    let report =
        AssembleReport { merge: merge_report, floor: floor_report, metres_per_unit, fusion: fusion_report };
    Ok((room, report))
}

/// Cameras in one frame, and the floor there.
struct Joined {
    merged: Merged,
    report: MergeReport,
    /// Camera from the common frame, one a camera.
    poses: Vec<Isometry3<f64>>,
    floor: Plane,
    floor_report: FloorReport,
}

impl Captures<'_> {
    /// Joined by what people picked, and then, once it is known about where up is, by what the lines in each camera's pictures
    /// say of it as well.
    fn joined(&self, project: &Project, options: &AssembleOptions) -> Result<Joined> {
        let merge = |plumb: &[Option<Plumb>]| {
            merge::merge(project, self.surfaces, self.lenses, self.measured, plumb, &options.merge)
        };
        let (merged, report) = merge(&[])?;
        let plumb = self.plumb(&merged, options);
        if plumb.iter().flatten().count() > 1
            && let Ok((level, level_report)) = merge(&plumb)
            // What people picked is right: what contradicts it is not.
            && level_report.outliers == report.outliers
            && !merge::spoils(level_report.pick_rms_px, report.pick_rms_px)
            && let Ok(joined) = self.on_floor(level, level_report, &plumb, options)
        {
            return Ok(joined);
        }
        self.on_floor(merged, report, &plumb, options)
    }

    /// Which way is up in each camera's frame by the lines in its pictures, where a first look at the surfaces tells about
    /// where that is.
    fn plumb(&self, merged: &Merged, options: &AssembleOptions) -> Vec<Option<Plumb>> {
        let poses = merged.poses();
        let points = surface_points(self.surfaces, &merged.common_from_camera, COARSE_STRIDE);
        let Ok((floor, _)) = floor::find(&points, &poses, &[], &options.floor) else { return Vec::new() };
        let seen = |(of, pose): (&Vec<Vector3<f64>>, &Isometry3<f64>)| {
            plumb::agreed(of, &(pose.rotation * floor.normal))
        };
        self.edges.iter().zip(&poses).map(seen).collect()
    }

    fn on_floor(
        &self,
        merged: Merged,
        report: MergeReport,
        plumb: &[Option<Plumb>],
        options: &AssembleOptions,
    ) -> Result<Joined> {
        let poses = merged.poses();
        let points = surface_points(self.surfaces, &merged.common_from_camera, STRIDE);
        let told = plumb.iter().zip(&poses);
        let plumb: Vec<Plumb> =
            told.filter_map(|(of, pose)| Some(of.as_ref()?.turned(&pose.rotation.inverse()))).collect();
        let (floor, floor_report) = floor::find(&points, &poses, &plumb, &options.floor)?;
        Ok(Joined { merged, report, poses, floor, floor_report })
    }
}

fn is_finite(disc: &Disc) -> bool {
    disc.center.is_finite() && disc.normal.is_finite() && disc.radius.is_finite() && disc.radius > 0.0
}

/// Every few pixels of what was measured, in the common frame.
fn surface_points(
    surfaces: &[Surface],
    common_from_camera: &[Similarity3<f64>],
    stride: usize,
) -> Vec<SurfacePoint> {
    let mut points = Vec::new();
    for (surface, common) in surfaces.iter().zip(common_from_camera) {
        for y in (0..surface.height()).step_by(stride) {
            for x in (0..surface.width()).step_by(stride) {
                let i = y * surface.width() + x;
                let Some(point) = surface.point(i).filter(|_| surface.origin[i] == Origin::Stereo) else {
                    continue;
                };
                let scale = common.scaling();
                points.push(SurfacePoint {
                    position: common * point_from_vec3(point),
                    normal: common.isometry.rotation * vector_from_vec3(surface.normal[i]),
                    area: f64::from(surface.area(i)) * (stride * stride) as f64 * scale * scale,
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
            let captures =
                Captures { surfaces: &surfaces, lenses: &lenses, measured: &[vec![], vec![]], edges: &[] };
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
                    merge::merge(&project, &surfaces, &lenses, &[vec![], vec![]], &[], &options).unwrap();
                assert_eq!(report.matches > 0, matches > 0, "seed {seed}: {report:?}");
                let found = merged.common_from_camera[0].inverse() * merged.common_from_camera[1];
                *turn_deg += calib::rotation::angle_between_deg(&found.isometry.rotation, &expected.rotation);
            }
        }
        let [without, with] = turns_deg;
        assert!(with < 0.75 * without, "{with}° with, {without}° without what pictures have in common");
    }

    /// Where depths are bent, floors slope; what runs up in the pictures does not: a fourth of all edges here. Rooms are bent by as much as the capture
    /// of a real one was, from the top of the image to its bottom, one more than the other.
    #[test]
    fn what_runs_up_in_the_pictures_says_how_level_a_bent_room_is() {
        let mut tilts_deg = [0.0; 2];
        for seed in 1..=5 {
            let built = RoomOptions { seed, image_px: [480, 360], ..RoomOptions::default() }.build().unwrap();
            let scene = RayScene::new(built.room.geometry.as_ref().unwrap()).unwrap();
            let truth = [0, 1].map(|i| &built.room.cameras[i].camera);
            let surfaces = [(0, 0.12), (1, 0.06)].map(|(i, bent)| {
                let mut surface =
                    Rendering { unit_m: 0.8, noise: 0.005, holes: 0.2, seed }.of(&scene, truth[i]);
                let (width, height) = (surface.width(), surface.height());
                for (i, depth) in surface.depth.iter_mut().enumerate() {
                    *depth *= 1.0 + bent * ((i / width) as f32 / height as f32 - 0.5);
                }
                surface
            });
            let lenses = truth.map(|camera| camera.intrinsics.clone());
            let mut rng = Pcg64Mcg::seed_from_u64(seed);
            let edges = truth.map(|camera| {
                let up = camera.camera_from_world.rotation * Vector3::z();
                let plumb = |rng: &mut Pcg64Mcg| {
                    let any = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
                    up.cross(&any).normalize() + up * rng.random_range(-0.01..0.01)
                };
                let other = |rng: &mut Pcg64Mcg| Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
                let all: Vec<Vector3<f64>> = (0..1500)
                    .map(|k| if k % 4 == 0 { plumb(&mut rng) } else { other(&mut rng) }.normalize())
                    .collect();
                all
            });
            let points = picks(&scene, truth, &mut Pcg64Mcg::seed_from_u64(seed));
            let project = project(points, Scale::Height { camera: 0, height_m: truth[0].center().z });
            for (tilt_deg, edges) in tilts_deg.iter_mut().zip([&[][..], &edges]) {
                let measured = &[vec![], vec![]];
                let captures = Captures { surfaces: &surfaces, lenses: &lenses, measured, edges };
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
}
