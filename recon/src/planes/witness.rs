//! Evidence of the capture's other views about points that are to be filled in.

use glam::{Affine3A, Quat, Vec3};

use crate::dense::{DenseView, Pinhole};

/// Measured depths of the key frames.
pub(super) struct Witnesses<'a> {
    pub(super) views: Vec<(&'a DenseView, Pinhole, Affine3A)>,
}

impl<'a> Witnesses<'a> {
    pub(super) fn new(views: &'a [DenseView]) -> Self {
        let views = views
            .iter()
            .map(|view| {
                let (t, r) = (view.camera_from_reference.translation, view.camera_from_reference.rotation);
                let rotation = Quat::from_xyzw(r.i as f32, r.j as f32, r.k as f32, r.w as f32);
                let translation = Vec3::new(t.x as f32, t.y as f32, t.z as f32);
                (view, view.pinhole(), Affine3A::from_rotation_translation(rotation, translation))
            })
            .collect();
        Self { views }
    }

    /// Tells whether more views look past a point of the reference's frame than agree with it.
    pub(super) fn contradict(&self, point: Vec3, tolerance: f32) -> bool {
        let (mut past, mut agree) = (0, 0);
        for (view, camera, camera_from_reference) in &self.views {
            let p = camera_from_reference.transform_point3(point);
            if p.z <= 0.0 {
                continue;
            }
            let u = (camera.fx * p.x / p.z + camera.cx).round();
            let v = (camera.fy * p.y / p.z + camera.cy).round();
            if u < 0.0 || v < 0.0 || u >= view.map.width as f32 || v >= view.map.height as f32 {
                continue;
            }
            let Some(seen) = view.depth(u as usize, v as usize) else { continue };
            past += usize::from(seen > p.z * (1.0 + tolerance));
            agree += usize::from((seen / p.z - 1.0).abs() <= tolerance);
        }
        past >= 2 && past > agree
    }
}
