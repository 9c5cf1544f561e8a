//! All cameras in one frame, upright, and the floor there. Two things need each other: lines in the pictures say how level
//! the cameras stand once it is known about where up is, and that is where the floor's normal points, which is found where
//! cameras are joined. So cameras are joined by what people picked, a first look at the surfaces tells about where up is, and
//! they are joined again, by what the lines say as well.

use nalgebra::{Isometry3, Similarity3, Vector3};
use scenes::geometry::{point_from_vec3, vector_from_vec3};

use super::{AssembleOptions, Captures};
use crate::Result;
use crate::floor::{self, FloorReport, Plane, SurfacePoint};
use crate::merge::{self, MergeReport, Merged};
use crate::plumb::{self, Plumb};
use crate::project::Project;
use crate::surface::{Origin, Surface};

/// Pixels between those that a floor is looked for among …
const STRIDE: usize = 4;
/// … and at first, to know about where it is.
const COARSE_STRIDE: usize = 8;

/// Cameras in one frame, and the floor there.
pub(super) struct Joined {
    pub(super) merged: Merged,
    pub(super) report: MergeReport,
    /// Camera from the common frame, one a camera.
    pub(super) poses: Vec<Isometry3<f64>>,
    /// An error where no plane can be a floor: what is wrong with the picks is told first.
    pub(super) floor: Result<(Plane, FloorReport)>,
}

impl Captures<'_> {
    /// Joined by what people picked and, where nothing of that suffers, by what runs up in the pictures.
    pub(super) fn joined(&self, project: &Project, options: &AssembleOptions) -> Result<Joined> {
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
        {
            let joined = self.on_floor(level, level_report, &plumb, options);
            if joined.floor.is_ok() {
                return Ok(joined);
            }
        }
        Ok(self.on_floor(merged, report, &plumb, options))
    }

    /// Which way is up in each camera's frame by the lines in its pictures; of none where a first look finds no floor.
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
    ) -> Joined {
        let poses = merged.poses();
        let points = surface_points(self.surfaces, &merged.common_from_camera, STRIDE);
        let told = plumb.iter().zip(&poses);
        let plumb: Vec<Plumb> =
            told.filter_map(|(of, pose)| Some(of.as_ref()?.turned(&pose.rotation.inverse()))).collect();
        let floor = floor::find(&points, &poses, &plumb, &options.floor);
        Joined { merged, report, poses, floor }
    }
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
