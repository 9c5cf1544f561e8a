//! Observations of the same points by another view.

use glam::{Affine3A, Vec3};
use nalgebra::Similarity3;

use crate::dense::Pinhole;
use crate::surface::{DepthOrigin, Surface};

/// Another camera that may have seen the same surface.
pub(super) struct Witness<'a> {
    pub(super) surface: &'a Surface,
    pub(super) camera: Pinhole,
    pub(super) from_camera: Affine3A,
    /// Factor from lengths of this camera to lengths of the witness.
    pub(super) scale: f32,
    /// Whether the witness takes precedence where both see equally well.
    pub(super) first: bool,
}

impl<'a> Witness<'a> {
    pub(super) fn new(surface: &'a Surface, witness_from_camera: &Similarity3<f64>, first: bool) -> Self {
        let (t, r) = (witness_from_camera.isometry.translation.vector, witness_from_camera.isometry.rotation);
        let scale = witness_from_camera.scaling() as f32;
        let rotation = glam::Quat::from_xyzw(r.i as f32, r.j as f32, r.k as f32, r.w as f32);
        let translation = Vec3::new(t.x as f32, t.y as f32, t.z as f32);
        let from_camera =
            Affine3A::from_scale_rotation_translation(Vec3::splat(scale), rotation, translation);
        Self { camera: surface.pinhole(), surface, from_camera, scale, first }
    }

    /// Pixel of a point in the witness's picture, and the point's depth there.
    pub(super) fn pixel(&self, point: Vec3) -> Option<(usize, usize, f32)> {
        let p = self.from_camera.transform_point3(point);
        if p.z <= 0.0 {
            return None;
        }
        let u = (self.camera.fx * p.x / p.z + self.camera.cx).round();
        let v = (self.camera.fy * p.y / p.z + self.camera.cy).round();
        let inside = u >= 1.0
            && v >= 1.0
            && u < self.surface.width() as f32 - 1.0
            && v < self.surface.height() as f32 - 1.0;
        inside.then_some((u as usize, v as usize, p.z))
    }

    /// Depth that the witness sees at a point's pixel, and the point's own depth there; `None` where it sees nothing.
    pub(super) fn seen_at(&self, point: Vec3) -> Option<(f32, f32)> {
        let (u, v, z) = self.pixel(point)?;
        Some((self.seen(v * self.surface.width() + u)?, z))
    }

    /// Depth at a pixel; `None` where it is unknown or only assumed.
    fn seen(&self, i: usize) -> Option<f32> {
        let seen = self.surface.depth[i];
        (seen > 0.0 && self.surface.origin[i] != DepthOrigin::Assumed).then_some(seen)
    }

    /// Tells whether all surfaces that the witness measured around a pixel lie well behind `z`.
    pub(super) fn looks_past(&self, (u, v): (usize, usize), z: f32, same_surface: f32) -> bool {
        (v - 1..=v + 1).all(|y| {
            (u - 1..=u + 1).all(|x| {
                self.seen(y * self.surface.width() + x).is_none_or(|seen| z < seen * (1.0 - same_surface))
            })
        })
    }
}
