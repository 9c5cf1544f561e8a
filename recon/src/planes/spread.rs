//! Continuation of known surfaces into unknown pixels, along paths that avoid edges in the picture.
//!
//! A shortest-path search (E. W. Dijkstra) from all known pixels at once: a step costs a pixel plus the change of
//! colour, so a region of one colour is filled from its border, and an outline stops the surfaces beyond. A plane of
//! the room is continued far; a surface on no plane only over the width of a rim.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::speckles::neighbours;
use super::witness::Witnesses;
use super::{ImagePlane, PlaneOptions};
use crate::dense::Support;
use crate::surface::{DepthOrigin, Surface};

/// Source of a filled pixel.
#[derive(Clone, Copy)]
enum Seed {
    Plane(u16),
    /// The measured pixel itself.
    Pixel(u32),
}

/// Fills unknown pixels that were filmed; returns their number.
pub(super) fn fill(
    surface: &mut Surface,
    filmed: &[bool],
    planes: &[ImagePlane],
    labels: &[Option<u16>],
    witnesses: &Witnesses<'_>,
    options: &PlaneOptions,
) -> usize {
    let seeds = reached(surface, filmed, planes, labels, options);
    let (width, camera) = (surface.width(), surface.pinhole());
    let nearest = nearest_depth(surface);
    let mut filled = 0;
    let known: Vec<Option<Support>> = (0..surface.depth.len()).map(|i| surface.support(i)).collect();
    for (i, seed) in seeds.into_iter().enumerate() {
        let Some(seed) = seed.filter(|_| surface.depth[i] <= 0.0) else { continue };
        let (u, v) = ((i % width) as f32, (i / width) as f32);
        let mut encloses = false;
        let spread = match seed {
            Seed::Plane(k) => {
                let plane = planes.get(usize::from(k));
                encloses = plane.is_some_and(|p| p.encloses);
                plane.map(|p| p.support(u, v))
            }
            Seed::Pixel(from) => {
                let (fu, fv) = ((from as usize % width) as f32, (from as usize / width) as f32);
                known[from as usize].map(|s| s.moved(u - fu, v - fv))
            }
        };
        // Nothing real lies behind a wall that encloses the room.
        let support = match (spread, nearest_enclosing(planes, u, v)) {
            (Some(own), Some(shell)) if own.w < shell.w => Some(shell),
            (own, _) => own,
        };
        let Some(support) = support.filter(|s| s.w > 0.0 && 1.0 / s.w > nearest) else { continue };
        let normal = support.normal(u, v, &camera);
        let ray = camera.ray(u, v);
        let grazing = normal.dot(ray) > -Support::LEAST_COSINE * ray.length();
        // Surfaces that other views see behind the room's own walls are reflections; all other fillings they may
        // contradict.
        if grazing || (!encloses && witnesses.contradict(ray / support.w, options.looked_past)) {
            continue;
        }
        surface.depth[i] = 1.0 / support.w;
        surface.normal[i] = normal;
        surface.origin[i] = DepthOrigin::Filled;
        filled += 1;
    }
    filled
}

/// Smallest measured depth: a filled plane must not come nearer.
fn nearest_depth(surface: &Surface) -> f32 {
    surface.depth.iter().copied().filter(|z| *z > 0.0).fold(f32::INFINITY, f32::min)
}

/// Nearest enclosing plane at a pixel.
fn nearest_enclosing(planes: &[ImagePlane], u: f32, v: f32) -> Option<Support> {
    planes
        .iter()
        .filter(|p| p.encloses)
        .map(|p| p.support(u, v))
        .max_by(|a, b| a.w.total_cmp(&b.w))
        .filter(|s| s.w > 0.0)
}

/// Seed that reaches each filmed pixel at the least cost, within its reach.
fn reached(
    surface: &Surface,
    filmed: &[bool],
    planes: &[ImagePlane],
    labels: &[Option<u16>],
    options: &PlaneOptions,
) -> Vec<Option<Seed>> {
    /// Unit of the costs, hundredths of a pixel as integers, so that ties are broken the same everywhere.
    const UNIT: f32 = 100.0;
    /// Additional cost of a surface on no plane, pixels.
    const PIXEL_HANDICAP_PX: f32 = 4.0;
    let (width, height) = (surface.width(), surface.height());
    let reach = |seed: &Seed| match seed {
        Seed::Plane(k) => {
            let own = planes.get(usize::from(*k)).map_or(0.0, |p| {
                // A ceiling is measured only in parts: it is continued until something stands before it.
                if p.opposite { f32::INFINITY } else { 0.5 * (p.pixels as f32).sqrt() }
            });
            own.clamp(options.surface_reach_px, options.reach_px)
        }
        Seed::Pixel(_) => options.surface_reach_px,
    };
    let mut seeds: Vec<Option<Seed>> = vec![None; width * height];
    let mut costs = vec![u32::MAX; width * height];
    let mut queue = BinaryHeap::new();
    for i in 0..width * height {
        if surface.depth[i] <= 0.0 {
            continue;
        }
        // A single pixel's plane is imprecise: planes of the room have a start.
        let (seed, cost) = match labels[i] {
            Some(k) => (Seed::Plane(k), 0),
            None if surface.support(i).is_some() => {
                (Seed::Pixel(i as u32), (UNIT * PIXEL_HANDICAP_PX) as u32)
            }
            None => continue,
        };
        seeds[i] = Some(seed);
        costs[i] = cost;
        queue.push(Reverse((cost, i)));
    }
    while let Some(Reverse((cost, i))) = queue.pop() {
        if cost > costs[i] {
            continue;
        }
        let Some(seed) = seeds[i] else { continue };
        for j in neighbours(i, width, height).filter(|j| surface.depth[*j] <= 0.0 && filmed[*j]) {
            let step = UNIT * (1.0 + options.edge_cost * colour_step(surface, i, j));
            let next = cost.saturating_add(step as u32);
            if next < costs[j] && next as f32 <= UNIT * reach(&seed) {
                costs[j] = next;
                seeds[j] = Some(seed);
                queue.push(Reverse((next, j)));
            }
        }
    }
    seeds
}

/// Largest change of a colour channel between two pixels, above the noise.
fn colour_step(surface: &Surface, i: usize, j: usize) -> f32 {
    /// Change in grey levels by sensor noise and compression.
    const NOISE: f32 = 4.0;
    let width = surface.width();
    let at = |i: usize| surface.picture.get_pixel((i % width) as u32, (i / width) as u32).0;
    let (a, b) = (at(i), at(j));
    let change = (0..3).map(|c| a[c].abs_diff(b[c])).max().unwrap_or(0);
    (f32::from(change) - NOISE).max(0.0)
}
