//! One room from all cameras' surfaces: merged, with its floor found, in metres, fused.

use glam::Vec3;
use nalgebra::{Isometry3, Point3, Similarity3, Vector3};
use scenes::geometry::{Disc, Geometry};
use scenes::room::{Room, RoomCamera};

use crate::floor::{self, FloorOptions, FloorReport, SurfacePoint};
use crate::fusion::{self, FusionOptions, FusionReport};
use crate::merge::{self, MergeOptions, MergeReport};
use crate::project::Project;
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
/// `surfaces` and `lenses` (intrinsics as filmed): one a camera of the project, in its order.
///
/// # Errors
/// Picks that do not fit, no depth where it is needed, no floor: each with its place.
pub fn assemble(
    project: &Project,
    surfaces: &[Surface],
    lenses: &[calib::Intrinsics],
    options: &AssembleOptions,
) -> Result<(Room, AssembleReport)> {
    let (merged, merge_report) = merge::merge(project, surfaces, lenses, &options.merge)?;
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
    let metres_per_unit = scale::metres_per_unit(project, surfaces, lenses, &merged, &poses, &plane)?;
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
    /// Standard deviation of a depth as a share of it, at the median depth; it grows with the depth.
    const NOISE: f64 = 0.004;
    let mut points = Vec::new();
    for (surface, common) in surfaces.iter().zip(common_from_camera) {
        let mut depths: Vec<f32> = surface.depth.iter().copied().filter(|z| *z > 0.0).collect();
        depths.sort_by(f32::total_cmp);
        let median = depths.get(depths.len() / 2).map_or(1.0, |z| f64::from(*z));
        for y in (0..surface.height()).step_by(STRIDE) {
            for x in (0..surface.width()).step_by(STRIDE) {
                let i = y * surface.width() + x;
                let Some(point) = surface.point(i).filter(|_| surface.origin[i] == Origin::Stereo) else {
                    continue;
                };
                let scale = common.scaling();
                let z = f64::from(point.z);
                points.push(SurfacePoint {
                    position: common * Point3::from(double(point)),
                    normal: common.isometry.rotation * double(surface.normal[i]),
                    area: f64::from(surface.area(i)) * (STRIDE * STRIDE) as f64 * scale * scale,
                    sigma: NOISE * z * z / median * scale,
                });
            }
        }
    }
    points
}

fn double(v: Vec3) -> Vector3<f64> {
    Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z))
}
