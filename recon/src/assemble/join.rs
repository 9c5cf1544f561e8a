//! All cameras in one frame, with the vertical and the floor there.
//!
//! The cameras are first joined by the picks. A coarse search finds a floor under them, whose normal is near the vertical; with
//! it, the vertical lines of the pictures are told from other lines. Then the captures are adjusted together, the floor is found
//! by surfaces and vertical lines, and the captures are adjusted once more with their features on the floor in one plane.

use nalgebra::{Isometry3, Similarity3, Vector3};
use scenes::geometry::{point_from_vec3, vector_from_vec3};

use super::{AssembleOptions, Captures};
use crate::Result;
use crate::floor::{self, FloorReport, Plane, SurfacePoint};
use crate::merge::{self, MergeReport, Merged, MergedCaptures};
use crate::plumb::{self, Plumb};
use crate::project::Project;
use crate::surface::{DepthOrigin, Surface};

/// Step between the pixels among which the floor is searched …
const STRIDE: usize = 4;
/// … and the step of the first, coarse search.
const COARSE_STRIDE: usize = 8;

/// Cameras in one frame, and the floor there.
pub(super) struct JoinedCameras {
    pub(super) merged: Merged,
    pub(super) report: MergeReport,
    /// Pose (camera from the common frame) of each camera.
    pub(super) poses: Vec<Isometry3<f64>>,
    /// The floor; an error where no plane can be one, kept so that problems of the picks are reported first.
    pub(super) floor: Result<(Plane, FloorReport)>,
}

impl JoinedCameras {
    fn new(merged: Merged, report: MergeReport, floor: Result<(Plane, FloorReport)>) -> Self {
        Self { poses: merged.poses(), merged, report, floor }
    }
}

impl Captures<'_> {
    /// Joins the cameras by the picks, then adjusts all captures together where their motions are given.
    pub(super) fn join_cameras(&self, project: &Project, options: &AssembleOptions) -> Result<JoinedCameras> {
        let joined = merge::merge(project, self.surfaces, self.lenses, self.measured, &options.merge)?;
        let plumb = self.plumb(&joined.0, options);
        self.on_floor(project, joined, &plumb, options)
    }

    /// Vertical in each camera's frame by the lines in its pictures; empty where the coarse search finds no floor.
    fn plumb(&self, merged: &Merged, options: &AssembleOptions) -> Vec<Option<Plumb>> {
        let poses = merged.poses();
        let points = surface_points(self.surfaces, &merged.common_from_camera, COARSE_STRIDE);
        let Ok((floor, _)) = floor::find(&points, &poses, &[], &options.floor) else { return Vec::new() };
        let seen = |(of, pose): (&Vec<Vector3<f64>>, &Isometry3<f64>)| {
            plumb::agreed(of, &(pose.rotation * floor.normal))
        };
        self.edges.iter().zip(&poses).map(seen).collect()
    }

    /// Adjusts joined cameras with their captures, finds the floor, and adjusts them with it.
    fn on_floor(
        &self,
        project: &Project,
        joined: (Merged, MergeReport),
        plumb: &[Option<Plumb>],
        options: &AssembleOptions,
    ) -> Result<JoinedCameras> {
        let Captures { motions, surfaces, lenses, measured, .. } = *self;
        let captures = MergedCaptures { motions, surfaces, lenses, measured };
        let (merged, mut report) = joined;
        let Some(adjusted) = merge::adjust(project, &captures, (&merged, &mut report), &options.merge)?
        else {
            let floor = self.floor(&merged, plumb, options);
            return Ok(JoinedCameras::new(merged, report, floor));
        };
        let (merged, report) = (adjusted.merged.clone(), adjusted.report.clone());
        let floor = self.floor(&merged, plumb, options);
        if let Ok((plane, told)) = &floor
            && let Some((laid, plane)) = adjusted.on_floor(plane)
        {
            return Ok(JoinedCameras::new(laid.merged, laid.report, Ok((plane, told.clone()))));
        }
        Ok(JoinedCameras::new(merged, report, floor))
    }

    /// The floor under joined cameras.
    fn floor(
        &self,
        merged: &Merged,
        plumb: &[Option<Plumb>],
        options: &AssembleOptions,
    ) -> Result<(Plane, FloorReport)> {
        let poses = merged.poses();
        let points = surface_points(self.surfaces, &merged.common_from_camera, STRIDE);
        let told = plumb.iter().zip(&poses);
        let plumb: Vec<Plumb> =
            told.filter_map(|(of, pose)| Some(of.as_ref()?.turned(&pose.rotation.inverse()))).collect();
        floor::find(&points, &poses, &plumb, &options.floor)
    }
}

/// Measured surface at every `stride`-th pixel, in the common frame.
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
                let Some(point) = surface.point(i).filter(|_| surface.origin[i] == DepthOrigin::Stereo)
                else {
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
