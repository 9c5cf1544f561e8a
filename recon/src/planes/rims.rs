//! Unreliable rims of near things. A patch beside an edge is matched by the near side's texture, so near surfaces come
//! out too wide by up to the patch's radius. Those rims are discarded; the picture's own edges then decide which
//! surface they belong to, and where they confirm stereo, its measurement is restored.

use rayon::prelude::*;

use super::local::Cells;
use super::{ImagePlane, PlaneOptions};
use crate::dense::Support;
use crate::surface::{DepthOrigin, Surface};

/// Number of directions in which a rim's edge is searched.
const DIRECTIONS: usize = 16;
/// Distance by which a surface must continue beyond a pixel, away from the edge, for it not to be the middle of
/// something thin, pixels.
const THIN_PX: f32 = 2.0;

/// Measurements on rims that are discarded for now.
pub(super) struct Rims {
    pixels: Vec<Rim>,
}

struct Rim {
    pixel: usize,
    support: Support,
    agreeing: u8,
}

/// Plane of each pixel, for comparison with its neighbours.
struct Neighbourhood<'a> {
    width: isize,
    height: isize,
    supports: &'a [Option<Support>],
    labels: &'a [Option<u16>],
    /// Difference in inverse depth that makes an edge.
    edge: f32,
}

/// Discards the near side of depth edges; the middle of thin things stays.
pub(super) fn forget(
    surface: &mut Surface,
    planes: &[ImagePlane],
    labels: &[Option<u16>],
    cells: &Cells,
    step: f32,
    options: &PlaneOptions,
) -> Rims {
    let supports: Vec<Option<Support>> = (0..surface.depth.len())
        .into_par_iter()
        .map(|i| support(surface, planes, labels, cells, step, i))
        .collect();
    let around = Neighbourhood {
        width: surface.width() as isize,
        height: surface.height() as isize,
        supports: &supports,
        labels,
        edge: options.edge_px * step,
    };
    let rings = rings(options.rim_px);
    let beyond = options.rim_px as f32 + 1.0;
    // Distance of each pixel from the nearest edge whose near side it is on, pixels.
    let distance: Vec<f32> = (0..supports.len())
        .into_par_iter()
        .map(|i| {
            let edge = rings.iter().find(|(offset, _)| around.edge(i, *offset));
            edge.map_or(beyond, |(_, radius)| *radius)
        })
        .collect();
    let has_core = |i: usize| {
        let needed = (distance[i] + THIN_PX).min(beyond);
        rings.iter().any(|(offset, _)| around.continued(i, *offset).is_some_and(|j| distance[j] >= needed))
    };
    let doubtful: Vec<usize> =
        (0..supports.len()).into_par_iter().filter(|i| distance[*i] < beyond && has_core(*i)).collect();
    let mut pixels = Vec::with_capacity(doubtful.len());
    for pixel in doubtful {
        // A plane of assumed direction was never measured.
        let assumed = labels[pixel].and_then(|k| planes.get(usize::from(k))).is_some_and(|p| p.opposite);
        if let Some(support) = supports[pixel].filter(|_| !assumed) {
            pixels.push(Rim { pixel, support, agreeing: surface.agreeing[pixel] });
        }
        surface.forget(pixel);
    }
    Rims { pixels }
}

impl Rims {
    /// Restores measurements where the filled surface confirms them.
    pub(super) fn confirm(&self, surface: &mut Surface, step: f32, options: &PlaneOptions) {
        let (width, camera) = (surface.width(), surface.pinhole());
        for Rim { pixel, support, agreeing } in &self.pixels {
            let i = *pixel;
            let filled = surface.depth[i] > 0.0;
            if filled && (1.0 / surface.depth[i] - support.w).abs() < options.edge_px * step {
                surface.depth[i] = 1.0 / support.w;
                surface.normal[i] = support.normal((i % width) as f32, (i / width) as f32, &camera);
                surface.agreeing[i] = *agreeing;
                surface.origin[i] = DepthOrigin::Stereo;
            }
        }
    }
}

impl Neighbourhood<'_> {
    fn at(&self, i: usize, (dx, dy): (isize, isize)) -> Option<usize> {
        let (x, y) = (i as isize % self.width + dx, i as isize / self.width + dy);
        (x >= 0 && y >= 0 && x < self.width && y < self.height).then(|| (y * self.width + x) as usize)
    }

    /// Difference in inverse depth by which one pixel's surface lies before another's, by both planes. Of two sides
    /// that meet at a crease each lies behind the other's plane, or each before it, but never one before the other.
    fn before(&self, i: usize, j: usize, (dx, dy): (isize, isize)) -> Option<f32> {
        let (here, there) = (self.supports[i].as_ref()?, self.supports[j].as_ref()?);
        let (dx, dy) = (dx as f32, dy as f32);
        Some((here.moved(dx, dy).w - there.w).min(here.w - there.moved(-dx, -dy).w))
    }

    fn same_plane(&self, i: usize, j: usize) -> bool {
        self.labels[i].is_some() && self.labels[i] == self.labels[j]
    }

    /// Tells whether a pixel lies on the near side of an edge between it and the other.
    fn edge(&self, i: usize, offset: (isize, isize)) -> bool {
        self.at(i, offset).is_some_and(|j| {
            !self.same_plane(i, j) && self.before(i, j, offset).is_some_and(|off| off > self.edge)
        })
    }

    /// The other pixel, if it is on the same surface.
    fn continued(&self, i: usize, offset: (isize, isize)) -> Option<usize> {
        self.at(i, offset).filter(|j| {
            self.same_plane(i, *j) || self.before(i, *j, offset).is_some_and(|off| off.abs() < self.edge)
        })
    }
}

/// Plane of a measured pixel: the room's, its neighbourhood's, or its own.
fn support(
    surface: &Surface,
    planes: &[ImagePlane],
    labels: &[Option<u16>],
    cells: &Cells,
    step: f32,
    i: usize,
) -> Option<Support> {
    let (x, y) = (i % surface.width(), i / surface.width());
    let own = surface.support(i)?;
    if let Some(plane) = labels[i].and_then(|k| planes.get(usize::from(k))) {
        return Some(plane.support(x as f32, y as f32));
    }
    match cells.near(x, y) {
        Some(around) if (around.w - own.w).abs() < step => Some(Support { w: own.w, ..around }),
        _ => Some(own),
    }
}

/// Offsets on rings around a pixel, nearest first, with their radii in pixels.
fn rings(largest: usize) -> Vec<((isize, isize), f32)> {
    let mut out: Vec<((isize, isize), f32)> = Vec::new();
    for radius in (1..=largest).map(|r| r as f32) {
        for k in 0..DIRECTIONS {
            let angle = std::f32::consts::TAU * k as f32 / DIRECTIONS as f32;
            let offset = ((radius * angle.cos()).round() as isize, (radius * angle.sin()).round() as isize);
            if out.iter().all(|(other, _)| *other != offset) {
                out.push((offset, radius));
            }
        }
    }
    out
}
