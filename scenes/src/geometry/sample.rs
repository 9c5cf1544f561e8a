//! Points all over the surfaces of a geometry.

use glam::{Vec2, Vec3};

use super::Geometry;

/// Largest number of samples along a side of a triangle.
const MOST_SAMPLES_A_SIDE: f32 = 4096.0;

/// Calls `visit` with points all over the surfaces, at most `spacing` apart: place, unit normal (either side), and the
/// square metres that the point stands for.
pub(crate) fn each_sample(geometry: &Geometry, spacing: f32, visit: &mut impl FnMut(Vec3, Vec3, f32)) {
    match geometry {
        Geometry::Mesh(mesh) => {
            for &triangle in &mesh.triangles {
                sample_triangle(mesh.corners(triangle), spacing, visit);
            }
        }
        Geometry::Discs(discs) => {
            for d in discs {
                sample_disc(d.center, d.normal, d.radius, spacing, visit);
            }
        }
    }
}

/// Visits the middles of the n² congruent parts of a triangle.
fn sample_triangle([a, b, c]: [Vec3; 3], spacing: f32, visit: &mut impl FnMut(Vec3, Vec3, f32)) {
    let cross = (b - a).cross(c - a);
    let Some(normal) = cross.try_normalize() else { return };
    let longest = (b - a).length().max((c - a).length()).max((c - b).length());
    let n = (longest / spacing).ceil().clamp(1.0, MOST_SAMPLES_A_SIDE);
    let area = 0.5 * cross.length() / (n * n);
    let (along, across) = ((b - a) / n, (c - a) / n);
    for i in 0..n as u32 {
        for j in 0..n as u32 - i {
            let corner = a + along * i as f32 + across * j as f32;
            visit(corner + (along + across) / 3.0, normal, area);
            if i + j + 1 < n as u32 {
                visit(corner + (along + across) * (2.0 / 3.0), normal, area);
            }
        }
    }
}

/// Visits a lattice on the disc, at least its centre.
fn sample_disc(
    center: Vec3,
    normal: Vec3,
    radius: f32,
    spacing: f32,
    visit: &mut impl FnMut(Vec3, Vec3, f32),
) {
    let steps = (radius / spacing).floor().min(MOST_SAMPLES_A_SIDE) as i32;
    let (x, y) = normal.any_orthonormal_pair();
    let offsets = |i: i32| (-steps..=steps).map(move |j| Vec2::new(i as f32, j as f32) * spacing);
    let inside: Vec<Vec2> = (-steps..=steps).flat_map(offsets).filter(|o| o.length() <= radius).collect();
    let area = std::f32::consts::PI * radius * radius / inside.len() as f32;
    for offset in inside {
        visit(center + x * offset.x + y * offset.y, normal, area);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area and centroid; summed in double precision, since there are a hundred thousand samples.
    fn total(sample: impl Fn(&mut dyn FnMut(Vec3, f32))) -> (f32, Vec3) {
        let (mut area, mut moment) = (0.0, glam::DVec3::ZERO);
        sample(&mut |p, a| {
            area += f64::from(a);
            moment += p.as_dvec3() * f64::from(a);
        });
        (area as f32, (moment / area).as_vec3())
    }

    #[test]
    fn samples_stand_for_the_whole_area_and_balance() {
        let corners = [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 0.6, 0.8)];
        for spacing in [5.0, 0.3, 0.01] {
            let (area, center) = total(|visit| sample_triangle(corners, spacing, &mut |p, _, a| visit(p, a)));
            assert!((area - 1.0).abs() < 1e-4, "{spacing}: {area}");
            let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
            assert!(center.distance(middle) < 1e-3, "{spacing}: {center}");
            let (area, center) = total(|visit| {
                sample_disc(Vec3::ONE, Vec3::Y, 0.5, spacing, &mut |p, _, a| visit(p, a));
            });
            assert!((area - std::f32::consts::PI * 0.25).abs() < 1e-4);
            assert!(center.distance(Vec3::ONE) < 1e-3);
        }
    }
}
