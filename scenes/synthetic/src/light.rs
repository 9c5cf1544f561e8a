//! Light in a room, computed once at the vertices of its mesh: lamps at the ceiling with soft shadows, and ambient
//! light, which is weaker in corners.

use glam::{Vec2, Vec3};
use rayon::prelude::*;

use super::surface::{Surfaces, Tessellation};
use super::texture::unit;
use scenes::raycast::RayScene;

/// Side of a square lamp.
const LAMP_M: f32 = 0.7;
/// Number of points of a lamp, along each side, from which shadows are cast.
const LAMP_POINTS: i32 = 3;
/// Number of directions in which occlusion of the ambient light is tested.
const AROUND: u32 = 32;
/// Distance beyond which surroundings do not darken.
const AROUND_M: f32 = 1.6;
/// Brightness of the ambient light; the lamps add about as much below them.
const AMBIENT: f32 = 0.42;

/// Lamps that shine downwards.
#[derive(Debug, Clone, Default)]
pub(super) struct Lamps {
    /// Centres of the lamps.
    pub places: Vec<Vec3>,
    /// Brightness of each lamp, such that the floor below is lit by about 0.5.
    pub strength: f32,
}

impl Lamps {
    /// Light of a lamp's point on a surface, without shadows: by the inverse square of the distance, and slanted.
    fn point_light(&self, lamp: Vec3, point: Vec3, normal: Vec3) -> f32 {
        let towards = lamp - point;
        let squared = towards.length_squared().max(0.05);
        let direction = towards / squared.sqrt();
        self.strength * normal.dot(direction).max(0.0) * direction.z.max(0.05) / squared
    }

    /// Light on an unshaded surface, used for people.
    pub(super) fn open(&self, point: Vec3, normal: Vec3) -> f32 {
        let lamps: f32 = self.places.iter().map(|lamp| self.point_light(*lamp, point, normal)).sum();
        AMBIENT * (0.75 + 0.25 * normal.z) + lamps
    }

    fn shaded(&self, scene: &RayScene, point: Vec3, normal: Vec3, seed: u32) -> f32 {
        let mut light = 0.0;
        for (i, lamp) in (0_i32..).zip(&self.places) {
            for k in 0..LAMP_POINTS * LAMP_POINTS {
                let cell = glam::IVec2::new(i, k);
                let jitter = Vec2::new(unit(cell, seed), unit(cell, seed ^ 0xabc));
                let at = (Vec2::new((k % LAMP_POINTS) as f32, (k / LAMP_POINTS) as f32) + jitter)
                    / LAMP_POINTS as f32;
                let source = *lamp + ((at - 0.5) * LAMP_M).extend(-0.02);
                if !scene.is_blocked(point, source) {
                    light += self.point_light(source, point, normal);
                }
            }
        }
        light / (LAMP_POINTS * LAMP_POINTS) as f32
    }
}

/// Open share of the surroundings, weighted by the cosine to the normal.
fn openness(scene: &RayScene, point: Vec3, normal: Vec3, seed: u32) -> f32 {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    let turn = unit(glam::IVec2::new(1, 2), seed);
    let open: f32 = (0..AROUND)
        .map(|k| {
            // Fibonacci's lattice on the disc, lifted to the hemisphere: cosine-weighted directions.
            let radius = ((k as f32 + 0.5) / AROUND as f32).sqrt();
            let angle = std::f32::consts::TAU * (k as f32 * 0.618_034 + turn);
            let height = (1.0 - radius * radius).sqrt();
            let direction =
                tangent * (radius * angle.cos()) + bitangent * (radius * angle.sin()) + normal * height;
            scene.cast(point, direction).map_or(1.0, |hit| (hit.distance / AROUND_M).min(1.0))
        })
        .sum();
    open / AROUND as f32
}

/// Light at each vertex of a room's mesh.
pub(super) fn bake(
    surfaces: &Surfaces,
    tessellation: &Tessellation,
    scene: &RayScene,
    lamps: &Lamps,
) -> Vec<f32> {
    /// Distance of lit points from their surface and from its rim, where other surfaces touch it.
    const OFF_M: f32 = 0.02;
    let vertices = tessellation.mesh.vertices.par_iter().zip(&tessellation.quad_of_vertex).enumerate();
    vertices
        .map(|(i, (vertex, quad))| {
            let quad = &surfaces.quads[*quad as usize];
            let normal = quad.normal();
            let center = quad.origin + 0.5 * (quad.u + quad.v);
            let inwards = (center - *vertex).normalize_or_zero() * OFF_M.min(0.5 * center.distance(*vertex));
            let point = *vertex + inwards + normal * OFF_M;
            AMBIENT * openness(scene, point, normal, i as u32) + lamps.shaded(scene, point, normal, i as u32)
        })
        .collect()
}

/// Converts linear light to sRGB (by the plain power of 2.2).
pub(super) fn encode(linear: Vec3) -> [u8; 3] {
    linear.to_array().map(|c| (c.clamp(0.0, 1.0).powf(1.0 / 2.2) * 255.0).round() as u8)
}
