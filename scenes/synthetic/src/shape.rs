//! Shapes that bodies are made of, and their intersections with rays in closed form.

use glam::{Quat, Vec2, Vec3};

/// A shape that a ray can hit.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shape {
    /// A sphere swept from `a` to `b` while its radius changes.
    Capsule { a: Vec3, b: Vec3, radius_a: f32, radius_b: f32 },
    /// An ellipsoid turned about its centre.
    Ellipsoid { center: Vec3, axes: Vec3, turn: Quat },
}

/// Intersection of a ray with a shape: the distance and the outward normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Met {
    pub distance: f32,
    pub normal: Vec3,
}

impl Shape {
    /// A sphere around the shape: its centre and radius.
    pub(super) fn around(&self) -> (Vec3, f32) {
        match *self {
            Self::Capsule { a, b, radius_a, radius_b } => {
                (0.5 * (a + b), 0.5 * a.distance(b) + radius_a.max(radius_b))
            }
            Self::Ellipsoid { center, axes, .. } => (center, axes.max_element()),
        }
    }

    /// First point of a ray (unit direction, eye outside) on the shape.
    pub(super) fn intersect(&self, eye: Vec3, direction: Vec3) -> Option<Met> {
        match *self {
            Self::Capsule { a, b, radius_a, radius_b } => capsule(eye, direction, a, b, radius_a, radius_b),
            Self::Ellipsoid { center, axes, turn } => {
                let inverse = turn.inverse();
                let (o, d) = (inverse * (eye - center) / axes, inverse * direction / axes);
                let (p, q, r) = (d.length_squared(), o.dot(d), o.length_squared() - 1.0);
                let discriminant = q * q - p * r;
                if discriminant <= 0.0 {
                    return None;
                }
                let distance = (-q - discriminant.sqrt()) / p;
                let normal = turn * ((o + d * distance) / axes);
                (distance > 0.0).then(|| Met { distance, normal: normal.normalize_or_zero() })
            }
        }
    }

    /// Coordinates of a point on the shape's surface, metres: around it, and along it.
    pub(super) fn place(&self, point: Vec3) -> Vec2 {
        match *self {
            Self::Capsule { a, b, radius_a, .. } => {
                let axis = (b - a).normalize_or_zero();
                let along = (point - a).dot(axis);
                let (side, front) = axis.any_orthonormal_pair();
                let around = (point - a).dot(side).atan2((point - a).dot(front));
                Vec2::new(around * radius_a, along)
            }
            Self::Ellipsoid { center, axes, turn } => {
                let p = turn.inverse() * (point - center);
                Vec2::new(p.y.atan2(p.x) * axes.x, p.z)
            }
        }
    }
}

fn sphere(eye: Vec3, direction: Vec3, center: Vec3, radius: f32) -> Option<Met> {
    let o = eye - center;
    let along = o.dot(direction);
    let discriminant = along * along - o.length_squared() + radius * radius;
    if discriminant <= 0.0 {
        return None;
    }
    let distance = -along - discriminant.sqrt();
    (distance > 0.0).then(|| Met { distance, normal: (o + direction * distance) / radius })
}

/// Intersection with the cone that touches both end spheres, between the circles of contact; else with the nearer
/// sphere.
///
/// With the axis m from a to b and the radii's difference ρ, a point a + q of the cone satisfies
/// (|m|² − ρ²) |q|² − (q·m)² + 2 rₐ ρ q·m − rₐ² |m|² = 0, a quadratic along the ray (after Quilez).
fn capsule(eye: Vec3, direction: Vec3, a: Vec3, b: Vec3, radius_a: f32, radius_b: f32) -> Option<Met> {
    // Ends only, when one sphere contains the other.
    let ends = [sphere(eye, direction, a, radius_a), sphere(eye, direction, b, radius_b)];
    let nearer_end = ends
        .into_iter()
        .flatten()
        .reduce(|nearer, other| if other.distance < nearer.distance { other } else { nearer });
    let (axis, rho) = (b - a, radius_a - radius_b);
    let m = axis.length_squared();
    if m <= rho * rho {
        return nearer_end;
    }
    // Start near the shape, so that squares of distances do not swamp its radius.
    let shift = (0.5 * (a + b) - eye).dot(direction);
    let o = eye + direction * shift - a;
    let (od, om, dm, oo) = (o.dot(direction), o.dot(axis), direction.dot(axis), o.length_squared());
    let d2 = m - rho * rho;
    let k2 = d2 - dm * dm;
    let k1 = d2 * od - om * dm + radius_a * rho * dm;
    let k0 = d2 * oo - om * om + radius_a * rho * om * 2.0 - m * radius_a * radius_a;
    let discriminant = k1 * k1 - k0 * k2;
    if discriminant > 0.0 && k2.abs() > 1e-12 {
        let t = (-discriminant.sqrt() - k1) / k2;
        let y = om - radius_a * rho + t * dm;
        if y > 0.0 && y < d2 && t + shift > 0.0 {
            let normal = d2 * (o + t * direction) - axis * y;
            return Some(Met { distance: t + shift, normal: normal.normalize_or_zero() });
        }
    }
    nearer_end
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Distance from a point to the surface of a tapered capsule, by trying many spheres along it.
    fn depth_in(shape: &Shape, p: Vec3) -> f32 {
        match *shape {
            Shape::Capsule { a, b, radius_a, radius_b } => (0..=4000)
                .map(|i| {
                    let t = i as f32 / 4000.0;
                    radius_a + (radius_b - radius_a) * t - p.distance(a.lerp(b, t))
                })
                .fold(f32::MIN, f32::max),
            Shape::Ellipsoid { center, axes, turn } => 1.0 - (turn.inverse() * (p - center) / axes).length(),
        }
    }

    #[test]
    fn rays_meet_shapes_where_swept_spheres_begin() {
        let mut rng = Pcg64Mcg::seed_from_u64(4);
        let mut vector = |reach: f32| {
            Vec3::new(
                rng.random_range(-reach..reach),
                rng.random_range(-reach..reach),
                rng.random_range(-reach..reach),
            )
        };
        let (mut met, mut missed) = (0, 0);
        for i in 0..400 {
            let (center, half) = (vector(1.0), vector(0.3));
            let shape = if i % 4 == 0 {
                Shape::Ellipsoid {
                    center,
                    axes: half.abs() + Vec3::splat(0.05),
                    turn: Quat::from_rotation_arc(Vec3::Z, vector(1.0).normalize()),
                }
            } else {
                let radii = vector(0.1).abs() + Vec3::splat(0.03);
                Shape::Capsule { a: center - half, b: center + half, radius_a: radii.x, radius_b: radii.y }
            };
            let eye = vector(1.0).normalize() * 4.0;
            let direction = (center + vector(0.2) - eye).normalize();
            if let Some(m) = shape.intersect(eye, direction) {
                met += 1;
                let p = eye + direction * m.distance;
                assert!(depth_in(&shape, p).abs() < 3e-3, "{shape:?}: {}", depth_in(&shape, p));
                assert!((m.normal.length() - 1.0).abs() < 1e-3 && m.normal.dot(direction) < 1e-3);
                // There is no earlier hit, and the normal points out.
                assert!((0..100).all(|k| {
                    depth_in(&shape, eye + direction * (m.distance - 0.01 - 0.03 * k as f32)) < 1e-4
                }));
                assert!(depth_in(&shape, p + m.normal * 0.01) < depth_in(&shape, p - m.normal * 0.01));
            } else {
                missed += 1;
                assert!(
                    (0..600).all(|k| depth_in(&shape, eye + direction * (2.0 + 0.007 * k as f32)) < 2e-3)
                );
            }
        }
        assert!(met > 100 && missed > 40, "{met} {missed}");
    }
}
