//! Evidence about an assembled room that the fit of its picks does not already contain.

use nalgebra::{Point3, Similarity3, Vector3};
use serde::Serialize;

use crate::floor::Plane;
use crate::merge::{self, MergeReport, Merged};
use crate::plumb;
use crate::project::Project;
use crate::proposals;
use crate::scale::LengthResidual;
use crate::scale::control::ControlResidual;
use crate::surface::{DepthOrigin, Surface};

/// Step between the pixels whose distance is looked at.
const STRIDE: usize = 8;

/// Evidence about a room.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct RoomEvidence {
    /// Evidence of each camera, in the project's order.
    pub cameras: Vec<CameraEvidence>,
    /// Evidence of each pair of cameras.
    pub pairs: Vec<PairEvidence>,
    /// Floor's share of all area seen.
    pub floor_share: f64,
    /// Median distance of the measured surfaces from their cameras, metres.
    pub reach_m: f64,
    /// Whether the program proposed the picks to itself.
    pub are_picks_proposed: bool,
    /// Whether what the captures show contradicts the picks, so that the picks alone place the cameras.
    pub adjustment_contradicts_picks: bool,
    /// Each known length beside what the room has there.
    pub lengths: Vec<LengthResidual>,
    /// Each control point beside where the room has it.
    pub control_points: Vec<ControlResidual>,
}

/// Evidence of one camera.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct CameraEvidence {
    /// Height above the floor, metres.
    pub height_m: f64,
    /// Angle between the floor's normal and the vertical that most lines in the pictures are plumb with, degrees; `None`
    /// without such lines.
    pub lean_deg: Option<f64>,
    /// Number of lines for that vertical, as a multiple of those for the floor's normal.
    pub outvoted: f64,
}

/// Evidence of a pair of cameras.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct PairEvidence {
    /// Indices of the cameras.
    pub cameras: [usize; 2],
    /// Number of points picked in both that fit …
    pub picks: usize,
    /// … and of those that were left out.
    pub left_out: usize,
    /// Root mean square distance between the picks and the projections of their points, pixels.
    pub rms_px: f64,
    /// Number of pixels of either that lie within the other's view.
    pub overlapping: usize,
    /// Share of these that stand in the other's view, which sees past them.
    pub in_the_way: f64,
    /// Number of places with texture where both surfaces coincide.
    pub compared: usize,
    /// Median correlation of both pictures there.
    pub correlation: f64,
    /// Number of features of either that were found in the other's picture; `None` where they were not searched.
    pub shared_features: Option<usize>,
}

/// Gathers the evidence about an assembled room, but for its known metres.
///
/// # Arguments
/// `edges`: normals of the interpretation planes of each camera's edges; may be empty. `floor_share`: the floor's share of
/// the area. `metres_per_unit`: metres in a unit of the common frame.
pub(crate) fn gather(
    project: &Project,
    surfaces: &[Surface],
    edges: &[Vec<Vector3<f64>>],
    (merged, report): (&Merged, &MergeReport),
    (floor, floor_share): (&Plane, f64),
    metres_per_unit: f64,
) -> RoomEvidence {
    let poses = merged.poses();
    let cameras = poses.iter().enumerate().map(|(index, pose)| {
        let normal = pose.rotation * floor.normal;
        let lines = edges.get(index).and_then(|lines| plumb::against(lines, &normal));
        CameraEvidence {
            height_m: floor.height(&(pose.inverse() * Point3::origin())) * metres_per_unit,
            lean_deg: lines.map(|lines| lines.lean_deg),
            outvoted: lines.map_or(0.0, |lines| lines.outvoted),
        }
    });
    RoomEvidence {
        cameras: cameras.collect(),
        pairs: pairs(project, surfaces, merged, report),
        are_picks_proposed: project.are_points_proposed,
        floor_share,
        reach_m: reach(surfaces, &merged.common_from_camera) * metres_per_unit,
        adjustment_contradicts_picks: report.adjustment.as_ref().is_some_and(|told| told.contradicts_picks),
        ..RoomEvidence::default()
    }
}

fn pairs(
    project: &Project,
    surfaces: &[Surface],
    merged: &Merged,
    report: &MergeReport,
) -> Vec<PairEvidence> {
    let found = report.adjustment.as_ref().map(|told| &told.shared_features);
    merge::pairs(surfaces.len())
        .map(|cameras| {
            let [a, b] = cameras;
            let shared: Vec<usize> = (1..=project.points.len())
                .filter(|number| cameras.iter().all(|c| project.points[number - 1].pixel(*c).is_some()))
                .collect();
            let left_out = shared.iter().filter(|number| report.is_left_out(**number)).count();
            let off: Vec<f64> = report
                .misfits_px
                .iter()
                .filter(|(number, camera, _)| cameras.contains(camera) && shared.contains(number))
                .map(|(.., off)| off * off)
                .collect();
            let first_from_second = merged.common_from_camera[a].inverse() * merged.common_from_camera[b];
            let seen = proposals::evidence_of([&surfaces[a], &surfaces[b]], &first_from_second);
            PairEvidence {
                cameras,
                picks: shared.len() - left_out,
                left_out,
                rms_px: (off.iter().sum::<f64>().abs() / off.len().max(1) as f64).sqrt(),
                overlapping: seen.overlapping,
                in_the_way: seen.in_the_way,
                compared: seen.compared,
                correlation: seen.correlation,
                shared_features: found.and_then(|found| found.get(&cameras).copied()),
            }
        })
        .collect()
}

/// Median distance of measured surface points from their camera, in the common unit.
fn reach(surfaces: &[Surface], common_from_camera: &[Similarity3<f64>]) -> f64 {
    let of_one = |(surface, common): (&Surface, &Similarity3<f64>)| {
        let scale = common.scaling();
        let measured = (0..surface.depth.len())
            .step_by(STRIDE)
            .filter(|i| surface.origin[*i] == DepthOrigin::Stereo)
            .filter_map(|i| Some(f64::from(surface.point(i)?.length()) * scale));
        measured.collect::<Vec<f64>>()
    };
    let mut all: Vec<f64> = surfaces.iter().zip(common_from_camera).flat_map(of_one).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}
