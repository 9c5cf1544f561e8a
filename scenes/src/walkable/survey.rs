//! Surface area above each cell of the floor, by height.

use glam::{Vec2, Vec3};
use nalgebra::Point2;

use super::{Grid, WalkableOptions};
use crate::geometry::Geometry;
use crate::geometry::sample::each_sample;

/// Height of a band in [`Survey::height_bands`], metres.
pub(super) const BAND_M: f64 = 0.1;
/// Least vertical component of a floor normal: 37° of noise.
const FLOOR_NORMAL_Z: f32 = 0.8;
/// Spacing of the samples from which the floor's extent is found, metres.
const COARSE_SPACING_M: f32 = 0.25;
/// Number of such samples up to which the spacing stays …
const MOST_COARSE_SAMPLES: f64 = 1e6;
/// … and of those that fill the grid: a room in millimetres has a million times a room's area.
const MOST_SAMPLES: f64 = 2e8;
/// Distance from the floor beyond which a region is left out of the grid, metres: the cells would become too large for
/// the room itself.
const FARTHEST_M: f64 = 300.0;
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
        let area_m2 = area_m2(geometry);
        let extent = extent(geometry, spacing(COARSE_SPACING_M, area_m2, MOST_COARSE_SAMPLES), options)?;
        let include = include.iter().copied().filter(|region| gap_m(region, &extent) <= FARTHEST_M);
        let empty = Grid::around(include.chain([extent]), options.cell_m)?;
        let mut floor_m2 = vec![0.0_f32; empty.bits.len()];
        let mut obstructing_m2 = vec![0.0_f32; empty.bits.len()];
        let mut height_bands = vec![0_u32; empty.bits.len()];
        let (ankle, head) = (options.ankle_m as f32, options.head_m as f32);
        let fine = spacing(0.5 * empty.cell_m as f32, area_m2, MOST_SAMPLES);
        each_sample(geometry, fine, &mut |p, normal, area| {
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

/// Area of all surfaces, square metres.
fn area_m2(geometry: &Geometry) -> f64 {
    match geometry {
        Geometry::Mesh(mesh) => {
            let area = |triangle: &[u32; 3]| {
                let [a, b, c] = mesh.corners(*triangle).map(Vec3::as_dvec3);
                0.5 * (b - a).cross(c - a).length()
            };
            mesh.triangles.iter().map(area).sum()
        }
        Geometry::Discs(discs) => {
            discs.iter().map(|disc| std::f64::consts::PI * f64::from(disc.radius).powi(2)).sum()
        }
    }
}

/// The spacing that is wanted, or the one at which the area takes no more than `most` samples.
fn spacing(wanted_m: f32, area_m2: f64, most: f64) -> f32 {
    wanted_m.max((area_m2 / most).sqrt() as f32)
}

/// Distance between two boxes, metres; 0 where they meet.
fn gap_m(a: &(Point2<f64>, Point2<f64>), b: &(Point2<f64>, Point2<f64>)) -> f64 {
    let along = |axis: usize| (a.0[axis] - b.1[axis]).max(b.0[axis] - a.1[axis]).max(0.0);
    along(0).hypot(along(1))
}

/// Bounds of the floor, without strays far away.
fn extent(
    geometry: &Geometry,
    spacing_m: f32,
    options: &WalkableOptions,
) -> Option<(Point2<f64>, Point2<f64>)> {
    let (mut floor, mut all) = (Vec::new(), Vec::new());
    let mut floor_m2 = 0.0;
    each_sample(geometry, spacing_m, &mut |p, normal, area| {
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
