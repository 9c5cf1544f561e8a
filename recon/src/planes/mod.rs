//! The room's planes: measured depths are made exact on them, and holes of stereo are filled from them.
//!
//! Indoors, untextured walls and floors leave holes in stereo, and a hole in a wall is a hole in the prediction of
//! occlusion. Planes are found in the measured depths ([`detect`]), the ceiling opposite the floor ([`opposite`]);
//! pixels on a plane take its depth, and so do those beside them whose colours the plane explains better than stereo
//! did ([`grow`], [`photo`]); unreliable rims of near things, where patches reach over the edge, are discarded
//! ([`rims`]); unknown pixels then take the plane of the nearest measured pixel along paths which avoid edges in the
//! picture ([`spread`]), unless another view looks past it ([`witness`]). Filled pixels are marked as such.
//!
//! Everything happens in inverse depth, where a plane is linear over the image and stereo's noise is the same everywhere.

mod detect;
mod grow;
mod local;
mod opposite;
mod photo;
mod rims;
mod speckles;
mod spread;
#[cfg(test)]
mod tests;
mod witness;

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::dense::{DenseView, Support};
use crate::surface::{DepthOrigin, Surface};

pub use detect::ImagePlane;

/// Options of plane detection and filling. Depth tolerances are in pixels of stereo's disparity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlaneOptions {
    /// Largest distance of a measured pixel from its plane, pixels of disparity.
    pub tolerance_px: f32,
    /// … and the largest if it lies amid pixels of the plane, or beside one and the colours in other views agree.
    pub loose_tolerance_px: f32,
    /// Largest angle between the plane's and the neighbourhood's normals for the former, degrees.
    pub facing_deg: f32,
    /// Least share of the image that makes a plane.
    pub least_share: f32,
    /// Largest number of planes.
    pub most_planes: usize,
    /// Largest share of the image of patches of equal depth that are discarded.
    pub speckle_share: f32,
    /// Width of the unreliable rim of near things, pixels.
    pub rim_px: usize,
    /// Pixels of disparity between two surfaces with an edge between them.
    pub edge_px: f32,
    /// Relative difference between the depths of neighbouring pixels, half of which separates two surfaces.
    pub edge: f32,
    /// Pixels of smooth picture whose path cost equals a step of one grey level.
    pub edge_cost: f32,
    /// Largest distance over which a plane is continued, pixels; also limited to its own half width.
    pub reach_px: f32,
    /// Largest distance over which a surface on no plane is continued, pixels.
    pub surface_reach_px: f32,
    /// Relative excess of another view's measured depth from which on it looks past a filled point.
    pub looked_past: f32,
    /// Seed of the random samples; a build takes that of [`crate::pipeline::BuildOptions`].
    #[serde(skip)]
    pub seed: u64,
}

impl Default for PlaneOptions {
    fn default() -> Self {
        Self {
            tolerance_px: 0.6,
            loose_tolerance_px: 2.5,
            facing_deg: 22.0,
            least_share: 0.002,
            most_planes: 40,
            speckle_share: 0.0003,
            rim_px: 5,
            edge_px: 1.5,
            edge: 0.04,
            edge_cost: 0.4,
            reach_px: 160.0,
            surface_reach_px: 24.0,
            looked_past: 0.04,
            seed: 0,
        }
    }
}

/// Report of plane detection and filling.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlaneReport {
    /// Number of planes found.
    pub planes: usize,
    /// Share of the image that lies on one of them and was measured.
    pub on_planes: f64,
    /// Share that was measured but discarded: speckles, rims, behind the room.
    pub forgotten: f64,
    /// Share that was filled.
    pub filled: f64,
}

/// A completed reference view with its room's planes.
#[derive(Debug, Clone)]
pub struct Completed {
    /// Surface of the view, cleaned and completed.
    pub surface: Surface,
    /// Planes that enclose the room: nothing real lies behind them.
    pub enclosing: Vec<ImagePlane>,
    /// Report of the completion.
    pub report: PlaneReport,
}

/// Cleans and completes the reference view's surface; `None` without a view. `views`: the reference first, then the key
/// frames.
pub fn complete(views: &[DenseView], options: &PlaneOptions) -> Option<Completed> {
    let view = views.first()?;
    let mut surface = Surface::from_view(view);
    let total = view.filmed.iter().filter(|filmed| **filmed).count().max(1) as f64;
    let share = |count: usize| count as f64 / total;
    let known = |s: &Surface| s.depth.iter().filter(|z| **z > 0.0).count();
    let measured = known(&surface);
    speckles::remove(&mut surface, options);

    let cells = local::fit(&surface, view.step);
    let mut planes = detect::planes(&surface, &cells, view.step, options);
    opposite::add(&surface, &mut planes, view.step, options);
    forget_behind(&mut surface, &planes, view.step);
    let mut labels = label(&surface, &cells, &planes, view.step, options);
    for _ in 0..3 {
        labels = agree_with_neighbours(&surface, &planes, &labels, view.step, options);
    }
    let witnesses = witness::Witnesses::new(&views[1..]);
    if let Some(photo) = photo::PhotoConsistency::new(view, &witnesses) {
        grow::grow(&surface, &planes, &mut labels, &photo, view.step, options);
    }
    let rims = rims::forget(&mut surface, &planes, &labels, &cells, view.step, options);
    let forgotten = measured - known(&surface);
    let on_planes = snap(&mut surface, &planes, &labels);
    let filled = spread::fill(&mut surface, &view.filmed, &planes, &labels, &witnesses, options);
    rims.confirm(&mut surface, view.step, options);
    let report = PlaneReport {
        planes: planes.len(),
        on_planes: share(on_planes),
        forgotten: share(forgotten),
        filled: share(filled),
    };
    let enclosing = planes.into_iter().filter(|p| p.encloses).collect();
    Some(Completed { surface, enclosing, report })
}

/// Discards depths behind an enclosing plane: reflections, or mistakes.
fn forget_behind(surface: &mut Surface, planes: &[ImagePlane], step: f32) {
    let width = surface.width();
    for i in 0..surface.depth.len() {
        if surface.depth[i] <= 0.0 {
            continue;
        }
        let (u, v) = ((i % width) as f32, (i / width) as f32);
        if planes.iter().any(|p| p.encloses && p.hides(u, v, surface.depth[i], step)) {
            surface.forget(i);
        }
    }
}

/// Plane of each measured pixel.
fn label(
    surface: &Surface,
    cells: &local::Cells,
    planes: &[ImagePlane],
    step: f32,
    options: &PlaneOptions,
) -> Vec<Option<u16>> {
    let (width, camera) = (surface.width(), surface.pinhole());
    let facing = options.facing_deg.to_radians().cos();
    (0..surface.depth.len())
        .into_par_iter()
        .map(|i| {
            if surface.depth[i] <= 0.0 {
                return None;
            }
            let (x, y) = (i % width, i / width);
            let (u, v, w) = (x as f32, y as f32, 1.0 / surface.depth[i]);
            let around = cells.near(x, y).map(|s| s.normal(u, v, &camera));
            let mut best: Option<(f32, u16)> = None;
            for (k, plane) in planes.iter().enumerate() {
                let off = (plane.at(u, v) - w).abs() / step;
                // A pixel whose neighbourhood is no plane itself must fit better.
                let fits = match around {
                    Some(normal) => off < options.tolerance_px && normal.dot(plane.normal) > facing,
                    None => off < 0.5 * options.tolerance_px,
                } || (plane.opposite
                    && off < options.loose_tolerance_px
                    && surface.normal[i].dot(plane.normal) > opposite::LEAST_FACING);
                if fits && best.is_none_or(|b| off < b.0) {
                    best = Some((off, k as u16));
                }
            }
            best.map(|b| b.1)
        })
        .collect()
}

/// Assigns pixels amid a plane's pixels that are off by little more than noise to that plane, too.
fn agree_with_neighbours(
    surface: &Surface,
    planes: &[ImagePlane],
    labels: &[Option<u16>],
    step: f32,
    options: &PlaneOptions,
) -> Vec<Option<u16>> {
    const RADIUS: isize = 2;
    let (width, height) = (surface.width() as isize, surface.height() as isize);
    let around = |i: usize| {
        let (x, y) = (i as isize % width, i as isize / width);
        (-RADIUS..=RADIUS)
            .flat_map(move |dy| (-RADIUS..=RADIUS).map(move |dx| (x + dx, y + dy)))
            .filter(move |(x, y)| *x >= 0 && *y >= 0 && *x < width && *y < height)
            .filter_map(|(x, y)| labels[(y * width + x) as usize])
    };
    (0..labels.len())
        .into_par_iter()
        .map(|i| {
            if labels[i].is_some() || surface.depth[i] <= 0.0 {
                return labels[i];
            }
            let (u, v) = ((i as isize % width) as f32, (i as isize / width) as f32);
            let needed = (2 * RADIUS as usize + 1).pow(2) / 2;
            let candidate = around(i).find(|k| around(i).filter(|other| other == k).count() >= needed)?;
            let off = (planes.get(usize::from(candidate))?.at(u, v) - 1.0 / surface.depth[i]).abs();
            (off < options.loose_tolerance_px * step).then_some(candidate)
        })
        .collect()
}

/// Sets pixels on planes to the planes' depth and normal; returns their number.
fn snap(surface: &mut Surface, planes: &[ImagePlane], labels: &[Option<u16>]) -> usize {
    let width = surface.width();
    let mut count = 0;
    for (i, label) in labels.iter().enumerate() {
        let Some(plane) = label.and_then(|k| planes.get(usize::from(k))) else { continue };
        let w = plane.at((i % width) as f32, (i / width) as f32);
        if surface.depth[i] > 0.0 && w > 0.0 {
            surface.depth[i] = 1.0 / w;
            surface.normal[i] = plane.normal;
            if plane.opposite {
                // The plane's direction is assumed: good enough for filling, not for aligning cameras' surfaces.
                surface.origin[i] = DepthOrigin::Filled;
                surface.agreeing[i] = 0;
            }
            count += 1;
        }
    }
    count
}

impl Surface {
    /// Sets a pixel to unknown.
    pub(crate) fn forget(&mut self, i: usize) {
        self.depth[i] = 0.0;
        self.normal[i] = Vec3::ZERO;
        self.agreeing[i] = 0;
        self.origin[i] = DepthOrigin::Unknown;
    }

    /// Plane through a measured pixel.
    pub(crate) fn support(&self, i: usize) -> Option<Support> {
        let (u, v) = ((i % self.width()) as f32, (i / self.width()) as f32);
        let camera = self.pinhole();
        let w = (self.depth[i] > 0.0).then(|| 1.0 / self.depth[i])?;
        Support::from_normal(w, self.normal[i], camera.ray(u, v), &camera)
    }
}
