//! Who is seen at each pixel of a camera: the nearest body that nothing static hides.
//!
//! The ray of a pixel meets an ellipsoid where |e + t g| = 1 in the space in which the ellipsoid is the unit
//! sphere (e the camera, g the ray's direction there): a quadratic whose smaller root is the distance along the
//! camera's z, because directions have z = 1 in the camera's frame.

use nalgebra::{Point2, Vector3};

use crate::stage::StageCamera;
use crate::tracks::extent::Body;

/// Per pinhole pixel, row by row.
#[derive(Debug, Clone)]
pub(super) struct Layers {
    /// Whose surface is seen: index of the body + 1, or 0.
    pub(super) owner: Vec<u16>,
    /// How squarely that surface faces the camera, 0 to 1.
    pub(super) facing: Vec<f32>,
}

impl Layers {
    pub(super) fn new(camera: &StageCamera, bodies: &[Body]) -> Self {
        let pixels = camera.width() as usize * camera.height() as usize;
        let mut layers = Self { owner: vec![0; pixels], facing: vec![0.0; pixels] };
        let mut nearest = camera.static_z_m.clone();
        nearest.resize(pixels, f32::INFINITY);
        for (index, body) in bodies.iter().enumerate().take(usize::from(u16::MAX)) {
            layers.add(camera, body, index as u16 + 1, &mut nearest);
        }
        layers
    }

    fn add(&mut self, camera: &StageCamera, body: &Body, owner: u16, nearest: &mut [f32]) {
        let Some(bounds) = body.pixel_box(&camera.pinhole) else { return };
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let columns = bounds.left.floor().max(0.0) as usize
            ..((bounds.left + bounds.width).ceil() + 1.0).clamp(0.0, width as f64) as usize;
        let rows = bounds.top.floor().max(0.0) as usize
            ..((bounds.top + bounds.height).ceil() + 1.0).clamp(0.0, height as f64) as usize;
        let half = 0.5 * body.height_m;
        let axes = Vector3::new(body.radius_m, body.radius_m, half);
        let pose = &camera.pinhole.camera_from_world;
        let center = body.foot + Vector3::z() * half;
        let eye = (camera.pinhole.center() - center).component_div(&axes);
        let world_from_camera = pose.rotation.inverse();
        let c = eye.norm_squared() - 1.0;
        for v in rows {
            for u in columns.clone() {
                let pixel = Point2::new(u as f64, v as f64);
                let Some(ray) = camera.pinhole.intrinsics.unproject(&pixel) else { continue };
                let direction = world_from_camera * ray;
                let g = direction.component_div(&axes);
                let (a, b) = (g.norm_squared(), eye.dot(&g));
                let discriminant = b * b - a * c;
                if discriminant <= 0.0 {
                    continue;
                }
                let z = (-b - discriminant.sqrt()) / a;
                let at = v * width + u;
                if z > 0.0 && (z as f32) < nearest[at] {
                    nearest[at] = z as f32;
                    self.owner[at] = owner;
                    let normal = (eye + g * z).component_div(&axes).normalize();
                    self.facing[at] = (-normal.dot(&direction.normalize())).max(0.0) as f32;
                }
            }
        }
    }

    /// Whose surface is seen at a pixel; `None` outside the image or where no body is.
    pub(super) fn owner_at(&self, camera: &StageCamera, pixel: Point2<f64>) -> Option<usize> {
        let (u, v) = (pixel.x.round(), pixel.y.round());
        let inside = u >= 0.0 && v >= 0.0 && u < camera.width() as f64 && v < camera.height() as f64;
        let at = inside.then(|| v as usize * camera.width() as usize + u as usize)?;
        usize::from(self.owner[at]).checked_sub(1)
    }
}
