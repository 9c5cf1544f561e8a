//! Surface area above each cell of the floor, by height.

use glam::{Vec2, Vec3};
use nalgebra::Point2;

use super::{Grid, WalkableOptions};
use crate::geometry::Geometry;

/// Height of a band in [`Survey::height_bands`], metres.
pub(super) const BAND_M: f64 = 0.1;
/// Least vertical component of a floor normal: 37° of noise.
const FLOOR_NORMAL_Z: f32 = 0.8;
/// Largest number of samples along a side of a triangle.
const MOST_SAMPLES_A_SIDE: f32 = 4096.0;
/// Spacing of the samples from which the floor's extent is found, metres.
const COARSE_SPACING_M: f32 = 0.25;
/// Share of the floor's area that is cut off at each end of x and y: strays far away must not enlarge the grid.
const CUT_OFF: f64 = 0.002;
/// Border around the remaining floor, metres.
const BORDER_M: f64 = 0.5;
/// Area of floor below which the extent of all surfaces is used instead, m².
const LEAST_FLOOR_M2: f64 = 0.25;

/// Counts of surface above each cell.
pub(super) struct Survey {
    /// Cells with floor in them.
    pub(super) floor: Grid,
    /// Square metres of surface between ankle and head.
    pub(super) obstructing_m2: Vec<f32>,
    /// Bit set of the height bands between ankle and head that hold surface: bit 0 starts at the ankle, each is 0.1 m
    /// high.
    pub(super) height_bands: Vec<u32>,
}

impl Survey {
    /// Surveys the geometry; `None` when nothing is below head height. The grid covers the regions of `include`.
    pub(super) fn of(
        geometry: &Geometry,
        include: &[(Point2<f64>, Point2<f64>)],
        options: &WalkableOptions,
    ) -> Option<Self> {
        let extent = extent(geometry, options)?;
        let empty = Grid::around(include.iter().copied().chain([extent]), options.cell_m)?;
        let mut floor_m2 = vec![0.0_f32; empty.bits.len()];
        let mut obstructing_m2 = vec![0.0_f32; empty.bits.len()];
        let mut height_bands = vec![0_u32; empty.bits.len()];
        let (ankle, head) = (options.ankle_m as f32, options.head_m as f32);
        each_sample(geometry, 0.5 * empty.cell_m as f32, &mut |p, normal, area| {
            let Some(i) = empty.index_of(&Point2::new(f64::from(p.x), f64::from(p.y))) else { return };
            if is_floor(p, normal, options) {
                floor_m2[i] += area;
            } else if (ankle..head).contains(&p.z) {
                obstructing_m2[i] += area;
                height_bands[i] |= 1 << (((p.z - ankle) / BAND_M as f32) as u32).min(31);
            }
        });
        let enough = (options.obstructed_fraction * empty.cell_m * empty.cell_m) as f32;
        let floor = empty.with(floor_m2.iter().map(|area| *area >= enough).collect());
        Some(Self { floor, obstructing_m2, height_bands })
    }
}

fn is_floor(p: Vec3, normal: Vec3, options: &WalkableOptions) -> bool {
    p.z.abs() <= options.floor_tolerance_m as f32 && normal.z.abs() >= FLOOR_NORMAL_Z
}

/// Bounds of the floor, without strays far away.
fn extent(geometry: &Geometry, options: &WalkableOptions) -> Option<(Point2<f64>, Point2<f64>)> {
    let (mut floor, mut all) = (Vec::new(), Vec::new());
    let mut floor_m2 = 0.0;
    each_sample(geometry, COARSE_SPACING_M, &mut |p, normal, area| {
        let sample = (p.truncate(), f64::from(area));
        if is_floor(p, normal, options) {
            floor.push(sample);
            floor_m2 += f64::from(area);
        }
        if p.z < options.head_m as f32 {
            all.push(sample);
        }
    });
    let samples = if floor_m2 >= LEAST_FLOOR_M2 { &mut floor } else { &mut all };
    let (x_low, x_high) = middle_part(samples, |p| p.x)?;
    let (y_low, y_high) = middle_part(samples, |p| p.y)?;
    Some((Point2::new(x_low - BORDER_M, y_low - BORDER_M), Point2::new(x_high + BORDER_M, y_high + BORDER_M)))
}

/// Range of a coordinate without [`CUT_OFF`] of the area at either end.
fn middle_part(samples: &mut [(Vec2, f64)], coordinate: impl Fn(Vec2) -> f32) -> Option<(f64, f64)> {
    samples.sort_by(|a, b| coordinate(a.0).total_cmp(&coordinate(b.0)));
    let cut = CUT_OFF * samples.iter().map(|(_, area)| area).sum::<f64>();
    let passes = |passed: &mut f64, area: f64| {
        *passed += area;
        *passed > cut
    };
    let (mut from_low, mut from_high) = (0.0, 0.0);
    let low = samples.iter().find(|(_, area)| passes(&mut from_low, *area))?;
    let high = samples.iter().rev().find(|(_, area)| passes(&mut from_high, *area))?;
    Some((f64::from(coordinate(low.0)), f64::from(coordinate(high.0))))
}

/// Calls `visit` with points all over the surfaces, at most `spacing` apart: place, unit normal (either side), and the
/// square metres that the point stands for.
fn each_sample(geometry: &Geometry, spacing: f32, visit: &mut impl FnMut(Vec3, Vec3, f32)) {
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
