//! Triangles and discs as ray targets, both sides alike.

use glam::{Vec3, Vec3A};
use obvhs::aabb::Aabb;

use crate::geometry::Disc;

/// A flat ray target.
pub(super) trait Primitive: Copy + Send + Sync {
    fn aabb(&self) -> Aabb;

    /// Distance along the ray in units of its direction's length; infinity for a miss. Only in front of the origin.
    fn distance(&self, origin: Vec3A, direction: Vec3A) -> f32;

    /// Unit normal, on either side.
    fn normal(&self) -> Vec3A;
}

/// Distance along the ray to the plane through `point`, infinity behind the origin and for a parallel ray.
fn plane_distance(point: Vec3A, normal: Vec3A, origin: Vec3A, direction: Vec3A) -> f32 {
    let t = normal.dot(point - origin) / normal.dot(direction);
    // The comparison is false for NaN, too.
    if t > 0.0 { t } else { f32::INFINITY }
}

/// A triangle, by its corners.
#[derive(Debug, Clone, Copy)]
pub(super) struct Triangle([Vec3A; 3]);

impl Triangle {
    pub(super) fn new(corners: [Vec3; 3]) -> Self {
        Self(corners.map(Vec3A::from))
    }

    fn area_normal(&self) -> Vec3A {
        let [a, b, c] = self.0;
        (b - a).cross(c - a)
    }

    pub(super) fn is_degenerate(&self) -> bool {
        self.area_normal().try_normalize().is_none()
    }
}

impl Primitive for Triangle {
    fn aabb(&self) -> Aabb {
        Aabb::from_points(&self.0)
    }

    /// Computed from the volumes that the ray spans with each edge (Plücker's coordinates, as in Embree). The volume of
    /// an edge is exactly opposite in the two triangles that share it, so no ray slips between them.
    fn distance(&self, origin: Vec3A, direction: Vec3A) -> f32 {
        let [a, b, c] = self.0.map(|corner| corner - origin);
        let volume = |p: Vec3A, q: Vec3A| (p - q).cross(p + q).dot(direction);
        let (u, v, w) = (volume(c, a), volume(a, b), volume(b, c));
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return f32::INFINITY;
        }
        plane_distance(self.0[0], self.area_normal(), origin, direction)
    }

    fn normal(&self) -> Vec3A {
        self.area_normal().normalize_or_zero()
    }
}

/// A disc.
#[derive(Debug, Clone, Copy)]
pub(super) struct FlatDisc {
    center: Vec3A,
    normal: Vec3A,
    radius: f32,
}

impl FlatDisc {
    pub(super) fn new(disc: &Disc) -> Self {
        Self { center: disc.center.into(), normal: disc.normal.into(), radius: disc.radius }
    }
}

impl Primitive for FlatDisc {
    fn aabb(&self) -> Aabb {
        // A disc reaches r √(1 − nᵢ²) along axis i.
        let squared = (Vec3A::ONE - self.normal * self.normal).max(Vec3A::ZERO);
        let reach = self.radius * Vec3A::new(squared.x.sqrt(), squared.y.sqrt(), squared.z.sqrt());
        Aabb::new(self.center - reach, self.center + reach)
    }

    fn distance(&self, origin: Vec3A, direction: Vec3A) -> f32 {
        let t = plane_distance(self.center, self.normal, origin, direction);
        let inside = t < f32::INFINITY
            && (origin + t * direction).distance_squared(self.center) <= self.radius * self.radius;
        if inside { t } else { f32::INFINITY }
    }

    fn normal(&self) -> Vec3A {
        self.normal
    }
}
