//! One room from all cameras' surfaces: merged, with its floor found, in metres, fused.

mod join;
#[cfg(test)]
mod tests;

use nalgebra::{Similarity3, Vector3};
use scenes::geometry::{Disc, Geometry};
use scenes::room::{Room, RoomCamera};
use serde::{Deserialize, Serialize};

use crate::floor::{self, FloorOptions, FloorReport};
use crate::fusion::{self, FusionOptions, FusionReport};
use crate::merge::{self, CaptureMotion, MergeOptions, MergeReport};
use crate::project::Project;
use crate::ray_depth::MeasuredPixel;
use crate::scale::board::Square;
use crate::scale::{JoinedPictures, Metres};
use crate::surface::Surface;
use crate::verdict::RoomEvidence;
use crate::{Error, Result, scale, verdict};
use join::JoinedCameras;

/// Relative error of a camera's depths from which on it is reported.
const DOUBTFUL_DEPTH: f64 = 0.015;

/// Options of a room's assembly.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AssembleOptions {
    /// Options of joining cameras.
    pub merge: MergeOptions,
    /// Options of the floor's search.
    pub floor: FloorOptions,
    /// Options of the fusion to discs.
    pub fusion: FusionOptions,
}

/// Report of a room's assembly.
#[derive(Debug, Clone, PartialEq)]
pub struct AssembleReport {
    /// Report of joining cameras.
    pub merge: MergeReport,
    /// Report of the floor's search; lengths in units of the first camera's reconstruction.
    pub floor: FloorReport,
    /// Metres in a unit of the first camera's reconstruction.
    pub metres_per_unit: f64,
    /// The room from each camera's frame, whose unit is its capture's.
    pub world_from_camera: Vec<Similarity3<f64>>,
    /// Report of the fusion to discs.
    pub fusion: FusionReport,
    /// Evidence for and against the room.
    pub evidence: RoomEvidence,
}

/// Results of the captures: one entry a camera of the project, in its order.
#[derive(Debug, Clone, Copy)]
pub struct Captures<'a> {
    /// Motion of each capture; empty for surfaces alone, which are then not adjusted.
    pub motions: &'a [CaptureMotion<'a>],
    /// Surface seen by each reference view.
    pub surfaces: &'a [Surface],
    /// Discs seen only by each camera's key frames, in its reference view's frame and unit.
    pub key_frame_discs: &'a [&'a [Disc]],
    /// Intrinsics as filmed.
    pub lenses: &'a [calib::Intrinsics],
    /// Picked pixels with individually measured depths.
    pub measured: &'a [Vec<MeasuredPixel>],
    /// Normals of the interpretation planes of edges in the pictures, in the reference view's frame; may be empty.
    pub edges: &'a [Vec<Vector3<f64>>],
    /// The side of the calibration board of each of the project's lengths, in its camera's unit; may be empty without boards.
    pub squares: &'a [Option<Square>],
}

/// Assembles a room. Zones are left empty, reference images unnamed.
///
/// # Errors
/// Picks that do not fit, missing depth at picks, no floor: each with its place.
pub fn assemble(
    project: &Project,
    captures: &Captures<'_>,
    options: &AssembleOptions,
) -> Result<(Room, AssembleReport)> {
    let Captures { surfaces, lenses, measured, squares, .. } = *captures;
    let JoinedCameras { merged, report: merge_report, poses, floor } =
        captures.join_cameras(project, options)?;
    for (point, camera, off) in &merge_report.outliers {
        tracing::warn!(
            "{}: [[point]] {point}, {}: left out, {off:.1} pixels from where the other picks put it",
            project.path.display(),
            project.cameras[*camera].name
        );
    }
    for (point, camera) in &merge_report.foreign_depths {
        tracing::warn!(
            "{}: [[point]] {point}, {}: its depth is measured at another surface, and not used; pick corners of things rather than \
             what is seen between them",
            project.path.display(),
            project.cameras[*camera].name
        );
    }
    for (camera, sigma) in project.cameras.iter().zip(&merge_report.depth_sigma) {
        if *sigma > DOUBTFUL_DEPTH {
            tracing::warn!(
                "camera `{}`: its depths are off by about {:.1} %, so its space is bent; check the intrinsics, and film along a wider path",
                camera.name,
                100.0 * sigma
            );
        }
    }
    let (floor, floor_report) = floor.map_err(|error| match error {
        Error::Room(problem) => Error::content(&project.path, "floor", problem),
        other => other,
    })?;
    let joined = JoinedPictures { project, surfaces, lenses, measured, merged: &merged };
    let Metres { per_unit: metres_per_unit, lengths } = scale::metres(&joined, squares, &floor)?;
    let level_from_common = floor::metric(&floor::world_frame(&floor, &poses[0]), metres_per_unit);
    let (world_from_level, control_points) = scale::control::fit(&joined, &level_from_common)?;
    let world_from_common = world_from_level * level_from_common;
    let evidence = verdict::evidence::gather(
        project,
        surfaces,
        captures.edges,
        (&merged, &merge_report),
        (&floor, floor_report.area_share),
        metres_per_unit,
    );
    let evidence = RoomEvidence { lengths, control_points, ..evidence };
    let world_from_camera: Vec<Similarity3<f64>> =
        merged.common_from_camera.iter().map(|s| world_from_common * s).collect();
    let level_from_camera: Vec<Similarity3<f64>> =
        merged.common_from_camera.iter().map(|s| level_from_common * s).collect();
    let mut seen = surfaces.to_vec();
    fusion::assumed_floor::assume_floor(&mut seen, lenses, &level_from_camera);
    let (discs, fusion_report) =
        fusion::fuse(&seen, captures.key_frame_discs, &world_from_camera, &options.fusion);
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
    let report = AssembleReport {
        merge: merge_report,
        floor: floor_report,
        metres_per_unit,
        world_from_camera,
        fusion: fusion_report,
        evidence,
    };
    Ok((room, report))
}

fn is_finite(disc: &Disc) -> bool {
    disc.center.is_finite() && disc.normal.is_finite() && disc.radius.is_finite() && disc.radius > 0.0
}
