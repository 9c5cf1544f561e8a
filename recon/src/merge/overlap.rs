//! Surface points visible to two cameras, found by projecting one's into the other (projective association).

use nalgebra::{Point3, RowVector3, Similarity3, Vector3};
use scenes::geometry::{point_from_vec3, vector_from_vec3};

use crate::surface::{DepthOrigin, Surface};

/// A point of one camera's surface that lies close to another's.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Contact {
    /// Camera that has the point, and the point in its frame.
    pub(super) from: usize,
    pub(super) point: Point3<f64>,
    /// Camera that has the surface, with the surface's point and normal in its frame.
    pub(super) onto: usize,
    pub(super) surface: Point3<f64>,
    pub(super) normal: Vector3<f64>,
    /// Standard deviation of their distance by stereo, as a share of the depth.
    pub(super) sigma: f64,
}

impl Contact {
    /// Derivative of the distance in standard deviations by the point in the frame of the surface's camera.
    pub(super) fn by_point(&self) -> RowVector3<f64> {
        self.normal.transpose() / (self.surface.z * self.sigma)
    }

    /// Distance along the normal as a share of the depth.
    fn relative(&self, poses: &[Similarity3<f64>]) -> f64 {
        let there = poses[self.onto].inverse() * (poses[self.from] * self.point);
        self.normal.dot(&(there - self.surface)) / self.surface.z
    }

    /// Distance along the normal in standard deviations.
    pub(super) fn in_sigmas(&self, poses: &[Similarity3<f64>]) -> f64 {
        self.relative(poses) / self.sigma
    }

    /// Distance along the normal in the common frame's unit.
    pub(super) fn distance(&self, poses: &[Similarity3<f64>]) -> f64 {
        self.relative(poses) * self.surface.z * poses[self.onto].scaling()
    }
}

/// Step between the pixels that are projected.
const STRIDE: usize = 7;
/// Least cosine of the angle between the normals of one surface, 30°.
const LEAST_FACING: f32 = 0.866;

/// Contacts between all pairs whose distance is below `gate` (a share of the depth).
pub(super) fn contacts(surfaces: &[Surface], poses: &[Similarity3<f64>], gate: f64) -> Vec<Contact> {
    let mut found = Vec::new();
    for from in 0..surfaces.len() {
        for onto in 0..surfaces.len() {
            if from != onto {
                between(surfaces, poses, (from, onto), gate, &mut found);
            }
        }
    }
    found
}

fn between(
    surfaces: &[Surface],
    poses: &[Similarity3<f64>],
    (from, onto): (usize, usize),
    gate: f64,
    found: &mut Vec<Contact>,
) {
    let (source, target) = (&surfaces[from], &surfaces[onto]);
    let onto_from = poses[onto].inverse() * poses[from];
    let (width, height) = (target.width(), target.height());
    for y in (STRIDE / 2..source.height()).step_by(STRIDE) {
        for x in (STRIDE / 2..source.width()).step_by(STRIDE) {
            let i = y * source.width() + x;
            let Some(point) = source.point(i).filter(|_| source.origin[i] == DepthOrigin::Stereo) else {
                continue;
            };
            let point = point_from_vec3(point);
            let there = onto_from * point;
            let Some(pixel) = target.intrinsics.project(&there) else { continue };
            let (u, v) = (pixel.x.round(), pixel.y.round());
            if u < 0.0 || v < 0.0 || u >= width as f64 || v >= height as f64 {
                continue;
            }
            let j = v as usize * width + u as usize;
            let Some(surface) = target.point(j).filter(|_| target.origin[j] == DepthOrigin::Stereo) else {
                continue;
            };
            let normal = vector_from_vec3(target.normal[j]);
            let turned = onto_from.isometry.rotation * vector_from_vec3(source.normal[i]);
            if turned.dot(&normal) < f64::from(LEAST_FACING) {
                continue;
            }
            let sigma = source.depth_sigma(source.depth[i]).hypot(target.depth_sigma(surface.z));
            let contact = Contact { from, point, onto, surface: point_from_vec3(surface), normal, sigma };
            if contact.relative(poses).abs() < gate {
                found.push(contact);
            }
        }
    }
}
