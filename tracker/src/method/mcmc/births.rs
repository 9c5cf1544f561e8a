//! Where new people are proposed: uniformly over a region of the floor, or where they would explain foreground.
//!
//! The region is cut into square cells. The silhouette of an average person in the middle of each is drawn once, when the
//! room is prepared, so that a moment's foreground is weighed against all cells with a few thousand word operations. The
//! proposal is a mixture whose density is known everywhere, as the reversible jump needs it.

use nalgebra::Point2;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use crate::likelihood::Simulation;
use crate::silhouette::{Body, Silhouette, View};

/// About how many cells a region is cut into; a cell is never smaller than [`SMALLEST_CELL_M`].
const CELLS: f64 = 600.0;
/// A third of a shoulder's width: finer places are found by UPDATE-P.
const SMALLEST_CELL_M: f64 = 0.15;

/// A region of the floor in cells.
#[derive(Debug, Clone)]
pub(super) struct BirthMap {
    cell_m: f64,
    cells: Vec<Cell>,
    /// Running sums of the cells' weights at this moment, ending in 1; empty when nothing is unexplained.
    cumulative: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Cell {
    center: Point2<f64>,
    /// Of an average person in the middle, one a camera.
    silhouettes: Vec<Silhouette>,
}

impl BirthMap {
    /// Cuts the part of the box `low..high` where `inside` holds into cells.
    pub(super) fn new(
        views: &[View],
        average: &Body,
        (low, high): (Point2<f64>, Point2<f64>),
        inside: impl Fn(f64, f64) -> bool,
    ) -> Self {
        // The share of the box that is inside, by a coarse look, sizes the cells.
        const LOOKS: usize = 40;
        let at = |i: usize, n: usize, from: f64, to: f64| from + (to - from) * (i as f64 + 0.5) / n as f64;
        let hits = (0..LOOKS * LOOKS)
            .filter(|k| inside(at(k % LOOKS, LOOKS, low.x, high.x), at(k / LOOKS, LOOKS, low.y, high.y)))
            .count();
        let area = (high.x - low.x) * (high.y - low.y) * hits as f64 / (LOOKS * LOOKS) as f64;
        let cell_m = (area / CELLS).sqrt().max(SMALLEST_CELL_M);
        let columns = ((high.x - low.x) / cell_m).ceil().max(1.0) as usize;
        let rows = ((high.y - low.y) / cell_m).ceil().max(1.0) as usize;
        let mut cells = Vec::new();
        for k in 0..columns * rows {
            let corner =
                Point2::new(low.x + (k % columns) as f64 * cell_m, low.y + (k / columns) as f64 * cell_m);
            // A cell belongs to the region when any of nine points in it does.
            let belongs = (0..9)
                .any(|s| inside(corner.x + at(s % 3, 3, 0.0, cell_m), corner.y + at(s / 3, 3, 0.0, cell_m)));
            if belongs {
                let center = corner + nalgebra::Vector2::repeat(0.5 * cell_m);
                let body = Body { x_m: center.x, y_m: center.y, ..*average };
                let silhouettes = views.iter().map(|view| Silhouette::new(view, &body)).collect();
                cells.push(Cell { center, silhouettes });
            }
        }
        Self { cell_m, cells, cumulative: Vec::new() }
    }

    /// Whether the region holds no place at all.
    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Whether some cell would explain something.
    pub(super) fn is_weighed(&self) -> bool {
        !self.cumulative.is_empty()
    }

    /// Area of all cells, m².
    pub(super) fn area_m2(&self) -> f64 {
        self.cells.len() as f64 * self.cell_m * self.cell_m
    }

    /// The mean area in pixels of an average person in each view, over the cells from which it is in the image.
    pub(super) fn typical_px(&self, views: usize) -> Vec<f64> {
        (0..views)
            .map(|camera| {
                let seen =
                    self.cells.iter().map(|c| f64::from(c.silhouettes[camera].area_px)).filter(|a| *a > 0.0);
                let (sum, n) = seen.fold((0.0, 0.0), |(sum, n), area| (sum + area, n + 1.0));
                if n > 0.0 { sum / n } else { 1.0 }
            })
            .collect()
    }

    /// Weighs the cells by what a person there would explain of the foreground that the present state leaves over.
    ///
    /// `log_gain` turns the newly covered pixels (all, foreground) of each camera into nats.
    pub(super) fn weigh(&mut self, simulation: &Simulation, log_gain: impl Fn(usize, [i64; 2]) -> f64) {
        let cameras: Vec<usize> = match self.cells.first() {
            Some(cell) => (0..cell.silhouettes.len()).filter(|c| simulation.in_use(*c)).collect(),
            None => Vec::new(),
        };
        let gains: Vec<f64> = self
            .cells
            .iter()
            .map(|cell| {
                cameras.iter().map(|&c| log_gain(c, simulation.gain(c, &cell.silhouettes[c]))).sum::<f64>()
            })
            .collect();
        self.cumulative.clear();
        let best = gains.iter().copied().fold(0.0, f64::max);
        if best <= 0.0 {
            return;
        }
        // The middle of a cell gains less than the best place in it, so the peak is made about five nats high.
        let temperature = (best / 5.0).max(1.0);
        let mut sum = 0.0;
        for gain in gains {
            sum += if gain > 0.0 { ((gain - best) / temperature).exp() } else { 0.0 };
            self.cumulative.push(sum);
        }
        for value in &mut self.cumulative {
            *value /= sum;
        }
    }

    /// Draws a place: with probability `informed` by the weights, otherwise uniformly. The place may lie just outside the
    /// region, in a cell that straddles its border.
    pub(super) fn sample(&self, informed: f64, rng: &mut Pcg64Mcg) -> Point2<f64> {
        let by_weight = self.is_weighed() && rng.random::<f64>() < informed;
        let i = if by_weight {
            let mark = rng.random::<f64>();
            self.cumulative.partition_point(|c| *c <= mark).min(self.cells.len() - 1)
        } else {
            rng.random_range(0..self.cells.len())
        };
        let offset = |rng: &mut Pcg64Mcg| (rng.random::<f64>() - 0.5) * self.cell_m;
        let (dx, dy) = (offset(rng), offset(rng));
        self.cells[i].center + nalgebra::Vector2::new(dx, dy)
    }

    /// The density of [`Self::sample`] at a place, 1/m².
    pub(super) fn density(&self, x_m: f64, y_m: f64, informed: f64) -> f64 {
        let half = 0.5 * self.cell_m;
        let holds = |c: &Cell| (c.center.x - x_m).abs() <= half && (c.center.y - y_m).abs() <= half;
        let Some(i) = self.cells.iter().position(holds) else { return 0.0 };
        let uniform = 1.0 / self.cells.len() as f64;
        let share = if self.cumulative.is_empty() {
            uniform
        } else {
            let weight = self.cumulative[i] - if i == 0 { 0.0 } else { self.cumulative[i - 1] };
            informed * weight + (1.0 - informed) * uniform
        };
        share / (self.cell_m * self.cell_m)
    }
}
