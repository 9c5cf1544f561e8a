//! Renderings of the room from any point of view with the people in it, as in figures 7 and 9 of T. Osawa, X. Wu, K.
//! Sudo, K. Wakabayashi, T. Yasuno, "MCMC based Multiple People Tracking using 3D Environmental Information" (in
//! Japanese), paper LI-007.
//!
//! The room itself is rendered once a view, by rays through the BVH; people are added per frame by the ray–quadric
//! equation, hidden where the room is nearer. From outside ([`birds_eye`]) the ceiling is cut away and walls are
//! visible only from within the room, as in a doll's house.

mod gaps;
mod ray_image;
mod surface;
mod viewpoint;

use calib::Camera;
use glam::Vec3;
use image::RgbImage;
use nalgebra::{Point2, Point3};
use rayon::prelude::*;

use crate::geometry::{Geometry, vec3_from_point};
use crate::raycast::RayScene;
use shell::canvas::Color;

pub(crate) use gaps::surrounded;
pub use ray_image::RayImage;
pub use surface::exposure;
pub(crate) use surface::{first_normal, first_seen};
pub use viewpoint::{birds_eye, extent, look_at};

/// Options of a rendered view.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewOptions {
    /// Height above which surfaces are not shown.
    pub cut_height_m: Option<f32>,
    /// Whether surfaces seen from behind are left out, so that one can look into a room from outside.
    pub cut_backs: bool,
    /// Colour where nothing is hit.
    pub ground: Color,
    /// Rays along each side of a pixel: 2 gives smooth edges.
    pub samples: u32,
    /// Share of a surface's brightness that depends on the light; the rest is its own colour.
    pub shading: f32,
    /// Whether geometry with dark colours is brightened.
    pub brighten: bool,
}

impl Default for ViewOptions {
    /// Options to show the room like a camera in it.
    fn default() -> Self {
        Self {
            cut_height_m: None,
            cut_backs: false,
            ground: Color::PAPER,
            samples: 2,
            shading: 0.3,
            brighten: true,
        }
    }
}

/// Tracker's model of a person: an upright ellipsoid on the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    /// Position, x.
    pub x_m: f32,
    /// Position, y.
    pub y_m: f32,
    /// Half the width.
    pub radius_m: f32,
    /// Height; the ellipsoid touches the floor.
    pub height_m: f32,
    /// Colour.
    pub color: Color,
}

/// A rendered view of a room that people can be put into, frame by frame.
#[derive(Debug, Clone)]
pub struct View {
    /// Colours are 0 to 255.
    rays: RayImage,
}

impl View {
    /// Renders the room. The scene must have been made from this geometry.
    pub fn new(geometry: &Geometry, scene: &RayScene, camera: &Camera, options: &ViewOptions) -> Self {
        let eye = vec3_from_point(&camera.center());
        let light = (eye.normalize_or_zero() * 0.3 + Vec3::new(0.25, 0.15, 0.9)).normalize();
        let gain = if options.brighten { exposure(geometry) } else { 1.0 };
        let meet = |eye: Vec3, direction: Vec3| {
            let seen = first_seen(geometry, scene, eye, direction, |point, normal| {
                options.cut_height_m.is_none_or(|cut| point.z < cut)
                    && !(options.cut_backs && normal.dot(direction) > 0.0)
            })?;
            let facing = if seen.normal.dot(direction) > 0.0 { -seen.normal } else { seen.normal };
            let lit = shade(facing, direction, light, options.shading);
            Some((seen.distance, seen.color * (gain * lit)))
        };
        let rays = RayImage::cast(camera, options.samples, color_vector(options.ground), meet);
        let mut view = Self { rays };
        if matches!(geometry, Geometry::Discs(_)) {
            view.close_gaps();
        }
        view
    }

    /// Closes the gaps of a pixel or two that discs leave where they are seen from nearer than the room was filmed.
    fn close_gaps(&mut self) {
        /// Widest gap that is closed, in pixels to either side.
        const REACH_PX: u32 = 3;
        let width = self.rays.width();
        let distances = &self.rays.distances;
        let reach = (REACH_PX * self.rays.samples) as usize;
        for (i, around) in surrounded(width, &|i| distances[i].is_infinite(), distances.len(), reach) {
            let count = around.len() as f32;
            self.rays.colors[i] = around.iter().map(|j| self.rays.colors[*j]).sum::<Vec3>() / count;
            self.rays.distances[i] = around.iter().map(|j| self.rays.distances[*j]).sum::<f32>() / count;
        }
    }

    /// Camera of the view.
    pub fn camera(&self) -> &Camera {
        &self.rays.camera
    }

    /// Picture of the empty room.
    pub fn image(&self) -> RgbImage {
        self.averaged(&self.rays.colors)
    }

    /// Picture of the room with people who stand on the floor, hide it and are hidden by it.
    pub fn with_people(&self, people: &[Ellipsoid]) -> RgbImage {
        let mut colors = self.rays.colors.clone();
        let width = self.rays.width();
        let mut distances = self.rays.distances.clone();
        for person in people {
            let Some([left, top, right, bottom]) = self.bounds(person) else { continue };
            let (shadow, body) = (color_vector(Color::INK), color_vector(person.color));
            let rows = colors
                .par_chunks_exact_mut(width)
                .zip(distances.par_chunks_exact_mut(width))
                .zip(self.rays.directions.par_chunks_exact(width))
                .skip(top)
                .take(bottom - top);
            rows.for_each(|((colors, distances), directions)| {
                for i in left..right {
                    let direction = directions[i];
                    if let Some((distance, normal)) = intersect(person, self.rays.eye, direction) {
                        if distance < distances[i] {
                            distances[i] = distance;
                            colors[i] = body * body_shade(normal, direction);
                        }
                        continue;
                    }
                    // A soft shadow where the person meets the floor.
                    let point = self.rays.eye + direction * distances[i];
                    if distances[i].is_finite() && point.z.abs() < 0.05 {
                        let off = (point.truncate() - glam::Vec2::new(person.x_m, person.y_m)).length()
                            / (SHADOW_REACH * person.radius_m);
                        colors[i] = colors[i].lerp(shadow, 0.5 * (1.0 - off).clamp(0.0, 1.0));
                    }
                }
            });
        }
        self.averaged(&colors)
    }

    /// Columns and rows of the finer grid that a person's body and shadow can touch; `None` when they are out of view.
    fn bounds(&self, person: &Ellipsoid) -> Option<[usize; 4]> {
        let finite = [person.x_m, person.y_m, person.radius_m, person.height_m].iter().all(|v| v.is_finite());
        if !finite || person.radius_m <= 0.0 || person.height_m <= 0.0 {
            return None;
        }
        let k = &self.rays.camera.intrinsics;
        let (width, height) = (k.width * self.rays.samples, k.height * self.rays.samples);
        let reach = f64::from(SHADOW_REACH * person.radius_m);
        let (mut low, mut high) = (Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN));
        for i in 0..8 {
            let side = |bit: usize| if i >> bit & 1 == 0 { -reach } else { reach };
            let z = if i & 4 == 0 { 0.0 } else { f64::from(person.height_m) };
            let corner = Point3::new(f64::from(person.x_m) + side(0), f64::from(person.y_m) + side(1), z);
            // A corner behind the camera has no image: then the whole picture is searched.
            let Some(p) = self.rays.camera.project(&corner) else {
                return Some([0, 0, width as usize, height as usize]);
            };
            (low, high) = (low.inf(&p), high.sup(&p));
        }
        let s = f64::from(self.rays.samples);
        let column = |u: f64| ((u + 0.5) * s).clamp(0.0, f64::from(width)) as usize;
        let row = |v: f64| ((v + 0.5) * s).clamp(0.0, f64::from(height)) as usize;
        let bounds = [column(low.x - 2.0), row(low.y - 2.0), column(high.x + 2.0), row(high.y + 2.0)];
        (bounds[0] < bounds[2] && bounds[1] < bounds[3]).then_some(bounds)
    }

    fn averaged(&self, colors: &[Vec3]) -> RgbImage {
        let (width, s) = (self.rays.camera.intrinsics.width, self.rays.samples as usize);
        let fine = width as usize * s;
        let mut image = RgbImage::new(width, self.rays.camera.intrinsics.height);
        image.par_chunks_exact_mut(3 * width as usize).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let mut sum = Vec3::ZERO;
                for line in 0..s {
                    let start = (y * s + line) * fine + x * s;
                    sum += colors[start..start + s].iter().sum::<Vec3>();
                }
                let mean = sum / (s * s) as f32;
                pixel.copy_from_slice(&mean.to_array().map(|c| c.round().clamp(0.0, 255.0) as u8));
            }
        });
        image
    }
}

/// Radius of a person's soft shadow, in radii of the person.
const SHADOW_REACH: f32 = 1.6;

fn color_vector(c: Color) -> Vec3 {
    Vec3::new(f32::from(c.r), f32::from(c.g), f32::from(c.b))
}

/// Brightness of a surface: a share of it from a light above and one at the eye.
fn shade(normal: Vec3, direction: Vec3, light: Vec3, share: f32) -> f32 {
    let lit = 0.65 * normal.dot(light).max(0.0) + 0.35 * normal.dot(-direction).max(0.0);
    1.0 - share + share * lit
}

/// Brightness of a person: rounder than the room, with a rim that sets it off.
fn body_shade(normal: Vec3, direction: Vec3) -> f32 {
    let facing = normal.dot(-direction).max(0.0);
    (0.45 + 0.4 * facing + 0.25 * normal.z.max(0.0)).min(1.1)
}

/// First intersection of a ray with an upright ellipsoid: the distance and the outward normal.
///
/// The ellipsoid is the unit sphere in coordinates scaled by its axes (r, r, h/2): |o + t d|² = 1 there.
fn intersect(person: &Ellipsoid, eye: Vec3, direction: Vec3) -> Option<(f32, Vec3)> {
    let half = 0.5 * person.height_m;
    let scale = Vec3::new(person.radius_m, person.radius_m, half).recip();
    let o = (eye - Vec3::new(person.x_m, person.y_m, half)) * scale;
    let d = direction * scale;
    let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 || a <= 0.0 {
        return None;
    }
    let distance = (-b - discriminant.sqrt()) / a;
    (distance > 0.0).then(|| (distance, ((o + d * distance) * scale).normalize_or_zero()))
}

#[cfg(test)]
mod tests;
