//! A plane fitted to every small neighbourhood, much more precise than a single pixel's normal.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use crate::dense::Support;
use crate::surface::Surface;

/// Distance between neighbourhoods, pixels.
pub(super) const CELL: usize = 4;
/// Half width of a neighbourhood, pixels.
const RADIUS: isize = 7;
/// Least share of a neighbourhood that must lie on its plane.
const LEAST_INSIDE: f64 = 0.6;

/// Local planes on a grid over the image.
pub(super) struct Cells {
    columns: usize,
    rows: usize,
    /// Plane of each cell at its middle pixel; `None` where the neighbourhood is no plane.
    pub(super) supports: Vec<Option<Support>>,
}

impl Cells {
    /// Middle pixel of a cell.
    pub(super) fn middle(&self, cell: usize) -> (f32, f32) {
        let (column, row) = (cell % self.columns, cell / self.columns);
        ((column * CELL + CELL / 2) as f32, (row * CELL + CELL / 2) as f32)
    }

    /// Local plane at a pixel.
    pub(super) fn near(&self, x: usize, y: usize) -> Option<Support> {
        let (column, row) = ((x / CELL).min(self.columns - 1), (y / CELL).min(self.rows - 1));
        let cell = row * self.columns + column;
        let (u, v) = self.middle(cell);
        Some(self.supports[cell]?.moved(x as f32 - u, y as f32 - v))
    }
}

/// Fits all neighbourhoods; `step` is the inverse depth of a pixel of disparity.
pub(super) fn fit(surface: &Surface, step: f32) -> Cells {
    let (columns, rows) = (surface.width().div_ceil(CELL).max(1), surface.height().div_ceil(CELL).max(1));
    let mut cells = Cells { columns, rows, supports: Vec::new() };
    cells.supports = (0..columns * rows)
        .into_par_iter()
        .map(|cell| {
            let (u, v) = cells.middle(cell);
            neighbourhood(surface, u as isize, v as isize, step)
        })
        .collect();
    cells
}

fn neighbourhood(surface: &Surface, u: isize, v: isize, step: f32) -> Option<Support> {
    let mut samples: Vec<[f64; 3]> = Vec::with_capacity(64);
    for dv in (-RADIUS..=RADIUS).step_by(2) {
        for du in (-RADIUS..=RADIUS).step_by(2) {
            let (x, y) = (u + du, v + dv);
            if x < 0 || y < 0 || x >= surface.width() as isize || y >= surface.height() as isize {
                continue;
            }
            let depth = surface.depth[y as usize * surface.width() + x as usize];
            if depth > 0.0 {
                samples.push([du as f64, dv as f64, f64::from(1.0 / depth)]);
            }
        }
    }
    let needed = (RADIUS + 1).pow(2) as f64 * LEAST_INSIDE;
    if (samples.len() as f64) < needed {
        return None;
    }
    // The fit starts from the depth with most support, so that an edge through the neighbourhood does not tip the
    // plane.
    let mut inverse: Vec<f64> = samples.iter().map(|s| s[2]).collect();
    inverse.sort_by(f64::total_cmp);
    let median = inverse[inverse.len() / 2];
    let mut plane = Vector3::new(0.0, 0.0, median);
    for tolerance in [8.0, 2.0, 1.0] {
        let tolerance = tolerance * f64::from(step);
        let (mut normal, mut right) = (Matrix3::<f64>::zeros(), Vector3::<f64>::zeros());
        for [du, dv, w] in &samples {
            let q = Vector3::new(*du, *dv, 1.0);
            if (plane.dot(&q) - w).abs() < tolerance {
                normal += q * q.transpose();
                right += q * *w;
            }
        }
        if normal[(2, 2)] < needed {
            return None;
        }
        plane = normal.cholesky()?.solve(&right);
    }
    let support = Support { w: plane.z as f32, gu: plane.x as f32, gv: plane.y as f32 };
    (support.w > 0.0).then_some(support)
}
