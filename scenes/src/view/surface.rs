//! Colour and normal of the surface that a ray hits.

use glam::Vec3;

use crate::geometry::{Disc, Geometry, Mesh};
use crate::raycast::RayScene;

/// Distance along the ray beyond the first disc, metres plus a share of the distance, within which discs belong to the
/// same surface: their colours are mixed, so that overlapping discs do not end in hard rims.
const SAME_SURFACE_M: f32 = 0.02;
const SAME_SURFACE_SHARE: f32 = 0.005;
/// Largest number of discs mixed.
const MIXED_DISCS: usize = 4;
/// Distance behind a hit at which the next ray begins.
const STEP_M: f32 = 1e-4;

/// A point of a surface that a ray hit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SurfaceHit {
    /// Distance along the (unit) direction.
    pub distance: f32,
    /// Normal as stored in the geometry: it may point away from the eye.
    pub normal: Vec3,
    /// Red, green, blue, 0 to 255.
    pub color: Vec3,
}

/// Factor that brings a geometry's colours to the brightness of a well exposed picture, from 1 to 4: vertex colours
/// baked in a dark room make dark figures.
pub fn exposure(geometry: &Geometry) -> f32 {
    /// Lower bound of the brightest tenth of a well exposed picture.
    const BRIGHT: f32 = 205.0;
    let brightness = |c: &[u8; 3]| c.iter().copied().max().unwrap_or(0);
    let mut values: Vec<u8> = match geometry {
        Geometry::Mesh(mesh) => mesh.colors.iter().map(brightness).collect(),
        Geometry::Discs(discs) => discs.iter().map(|d| brightness(&d.color)).collect(),
    };
    values.sort_unstable();
    let bright = values.get(values.len() * 9 / 10).copied().unwrap_or(u8::MAX);
    (BRIGHT / f32::from(bright.max(1))).clamp(1.0, 4.0)
}

/// First surface along a ray that `keep` (given the point and the normal) accepts.
pub(crate) fn first_seen(
    geometry: &Geometry,
    scene: &RayScene,
    origin: Vec3,
    direction: Vec3,
    keep: impl Fn(Vec3, Vec3) -> bool,
) -> Option<SurfaceHit> {
    /// Largest number of layers passed over: a bound for broken geometry, far above that of a room.
    const MAX_LAYERS: usize = 256;
    let mut start = 0.0;
    for _ in 0..MAX_LAYERS {
        let hit = scene.cast(origin + direction * start, direction)?;
        let distance = start + hit.distance;
        let point = origin + direction * distance;
        let (normal, color) = surface(geometry, hit.primitive, point);
        if keep(point, normal) {
            let color = match geometry {
                Geometry::Mesh(_) => color,
                Geometry::Discs(discs) => mixed(discs, scene, (origin, direction), (hit.primitive, distance)),
            };
            return Some(SurfaceHit { distance, normal, color });
        }
        start = distance + STEP_M;
    }
    None
}

/// Normal, as stored in the geometry, of the first surface along a unit direction, if it is no farther than `farthest` metres.
pub(crate) fn first_normal(
    geometry: &Geometry,
    scene: &RayScene,
    origin: Vec3,
    direction: Vec3,
    farthest: f32,
) -> Option<Vec3> {
    let hit = scene.cast_within(origin, direction, farthest)?;
    Some(surface(geometry, hit.primitive, origin + direction * hit.distance).0)
}

/// Colour of overlapping discs from the first hit on, each weighted by the ray's distance from its middle.
fn mixed(discs: &[Disc], scene: &RayScene, (origin, direction): (Vec3, Vec3), first: (u32, f32)) -> Vec3 {
    let limit = first.1 + SAME_SURFACE_M + SAME_SURFACE_SHARE * first.1;
    let (mut sum, mut weights, mut next) = (Vec3::ZERO, 0.0, Some(first));
    for _ in 0..MIXED_DISCS {
        let Some((disc, distance)) = next else { break };
        let disc = &discs[disc as usize];
        let off = (origin + direction * distance).distance_squared(disc.center) / (disc.radius * disc.radius);
        let weight = (1.0 - off).max(0.0) + 0.02;
        sum += weight * rgb(disc.color);
        weights += weight;
        let start = distance + STEP_M;
        let behind = scene.cast_within(origin + direction * start, direction, limit - start);
        next = behind.map(|hit| (hit.primitive, start + hit.distance));
    }
    sum / weights
}

/// Normal and colour of a primitive at a point on it.
fn surface(geometry: &Geometry, primitive: u32, point: Vec3) -> (Vec3, Vec3) {
    match geometry {
        Geometry::Discs(discs) => {
            let disc = &discs[primitive as usize];
            (disc.normal, rgb(disc.color))
        }
        Geometry::Mesh(mesh) => triangle(mesh, mesh.triangles[primitive as usize], point),
    }
}

fn triangle(mesh: &Mesh, corners: [u32; 3], point: Vec3) -> (Vec3, Vec3) {
    let [a, b, c] = corners.map(|i| mesh.vertices[i as usize]);
    let normal = (b - a).cross(c - a);
    let area = normal.length_squared().max(f32::MIN_POSITIVE);
    // Barycentric weights: the areas of the parts that the point cuts the triangle into.
    let at_b = (point - a).cross(c - a).dot(normal) / area;
    let at_c = (b - a).cross(point - a).dot(normal) / area;
    let color = if mesh.colors.len() == mesh.vertices.len() {
        let [ca, cb, cc] = corners.map(|i| rgb(mesh.colors[i as usize]));
        ca * (1.0 - at_b - at_c) + cb * at_b + cc * at_c
    } else {
        Vec3::splat(190.0)
    };
    (normal.normalize_or_zero(), color)
}

fn rgb(color: [u8; 3]) -> Vec3 {
    Vec3::from(color.map(f32::from))
}
