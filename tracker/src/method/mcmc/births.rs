//! Birth map: proposes places of new people, uniformly over a region of the floor or where they would explain
//! foreground.
//!
//! The region is divided into square cells. The rectangle that an average person in the middle of each cell would
//! fill in every image is computed once for the room, so a moment's unexplained foreground is counted with four reads
//! of a summed-area table a cell and camera. The proposal is a mixture whose density is known everywhere, as the
//! reversible jump requires.

use nalgebra::{Point2, Vector2};
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

use super::filled::Filled;
use super::left_over::LeftOver;
use crate::likelihood::Layers;
use crate::silhouette::Body;

/// Least side of a cell, metres: half of a person's width. UPDATE-P finds the exact place.
const CELL_M: f64 = 0.25;
/// Largest number of cells of a region; a wide region gets larger cells.
const MOST_CELLS: f64 = 12_000.0;

/// Largest number of squares of the box around a region, most of which may lie outside of it: a zone that is a kilometre
/// away must not exhaust memory.
const MOST_SQUARES: f64 = 2_000_000.0;

/// Region of the floor, divided into cells.
#[derive(Debug, Clone)]
pub(super) struct BirthMap {
    cell_m: f64,
    low: Point2<f64>,
    columns: usize,
    cells: Vec<Cell>,
    /// Index of the cell of each square of the bounding box, row by row; `None` outside the region.
    cell_of: Vec<Option<u32>>,
    /// Running sums of the cells' weights in this moment, ending in 1; empty when no cell would explain foreground.
    cumulative: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Cell {
    center: Point2<f64>,
    /// Rectangles of an average person in the middle, one a camera.
    filled: Vec<Filled>,
}

impl BirthMap {
    /// Divides the part of the box `low..high` (metres) where `inside` holds into cells.
    pub(super) fn new(
        layers: &Layers,
        average: &Body,
        (low, high): (Point2<f64>, Point2<f64>),
        inside: impl Fn(f64, f64) -> bool,
    ) -> Self {
        // The inside fraction of the box, coarsely sampled, determines the size of the cells.
        const LOOKS: usize = 40;
        let at = |i: usize, n: usize, from: f64, to: f64| from + (to - from) * (i as f64 + 0.5) / n as f64;
        let hits = (0..LOOKS * LOOKS)
            .filter(|k| inside(at(k % LOOKS, LOOKS, low.x, high.x), at(k / LOOKS, LOOKS, low.y, high.y)))
            .count();
        let box_area = (high.x - low.x) * (high.y - low.y);
        let area = box_area * hits as f64 / (LOOKS * LOOKS) as f64;
        let cell_m = (area / MOST_CELLS).sqrt().max((box_area / MOST_SQUARES).sqrt()).max(CELL_M);
        let columns = ((high.x - low.x) / cell_m).ceil().max(1.0) as usize;
        let rows = ((high.y - low.y) / cell_m).ceil().max(1.0) as usize;
        let mut cells = Vec::new();
        let mut cell_of = vec![None; columns * rows];
        for (k, cell) in cell_of.iter_mut().enumerate() {
            let corner =
                Point2::new(low.x + (k % columns) as f64 * cell_m, low.y + (k / columns) as f64 * cell_m);
            // A cell belongs to the region when any of nine points in it does.
            let belongs = (0..9)
                .any(|s| inside(corner.x + at(s % 3, 3, 0.0, cell_m), corner.y + at(s / 3, 3, 0.0, cell_m)));
            if belongs {
                let center = corner + Vector2::repeat(0.5 * cell_m);
                let body = Body { x_m: center.x, y_m: center.y, ..*average };
                let filled = (0..layers.views().len()).map(|c| Filled::of(layers, c, &body)).collect();
                *cell = Some(cells.len() as u32);
                cells.push(Cell { center, filled });
            }
        }
        Self { cell_m, low, columns, cells, cell_of, cumulative: Vec::new() }
    }

    /// Whether the region is empty.
    pub(super) fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Whether some cell would explain foreground.
    pub(super) fn is_weighed(&self) -> bool {
        !self.cumulative.is_empty()
    }

    /// Number of cells.
    pub(super) fn len(&self) -> usize {
        self.cells.len()
    }

    /// Rectangles of an average person in the middle of a cell, one a camera.
    pub(super) fn filled(&self, cell: usize) -> &[Filled] {
        &self.cells[cell].filled
    }

    /// Cells of the square around a cell, itself included, within `reach_m` metres, and at least its neighbours.
    pub(super) fn near(&self, cell: usize, reach_m: f64) -> impl Iterator<Item = usize> {
        let reach = (reach_m / self.cell_m).round().max(1.0) as isize;
        let (column, row) = self.square_of(&self.cells[cell].center);
        (-reach..=reach)
            .flat_map(move |rows| (-reach..=reach).map(move |columns| (columns, rows)))
            .filter_map(move |(columns, rows)| {
                let column = column.checked_add_signed(columns).filter(|c| *c < self.columns)?;
                let square = row.checked_add_signed(rows)? * self.columns + column;
                self.cell_of.get(square).copied().flatten().map(|i| i as usize)
            })
    }

    /// Area of one cell, m².
    pub(super) fn cell_area_m2(&self) -> f64 {
        self.cell_m * self.cell_m
    }

    /// Area of all cells, m².
    pub(super) fn area_m2(&self) -> f64 {
        self.cells.len() as f64 * self.cell_area_m2()
    }

    /// Mean area in pixels of an average person's innermost shape in each layer's camera, over the cells from which
    /// it is in the image.
    pub(super) fn typical_px(&self, layers: &Layers) -> Vec<f64> {
        (0..layers.count())
            .map(|layer| {
                let camera = layers.camera(layer);
                let seen =
                    self.cells.iter().map(|c| f64::from(c.filled[camera].area_px)).filter(|a| *a > 0.0);
                let (sum, n) = seen.fold((0.0, 0.0), |(sum, n), area| (sum + area, n + 1.0));
                if n > 0.0 { sum / n } else { 1.0 }
            })
            .collect()
    }

    /// Weights the cells by the unexplained foreground that a person there would explain.
    ///
    /// `log_gain` turns the newly covered pixels (all, foreground) of each camera into nats.
    pub(super) fn weigh(&mut self, left_over: &LeftOver, log_gain: impl Fn(usize, [u32; 2]) -> f64) {
        self.weigh_where(left_over, log_gain, |_, _| true);
    }

    /// Weights only the cells whose middle is within `reach_m` metres of one of these places, and in which some
    /// camera shows most of an unexplained person.
    pub(super) fn weigh_near(
        &mut self,
        places: &[Vector2<f64>],
        reach_m: f64,
        left_over: &LeftOver,
        log_gain: impl Fn(usize, [u32; 2]) -> f64,
    ) {
        let near = |cell: &Cell| places.iter().any(|place| (cell.center.coords - place).norm() < reach_m);
        self.weigh_where(left_over, log_gain, |_, cell| near(cell) && left_over.is_plain(&cell.filled));
    }

    /// Weights only the open cells; `is_open` has one entry a cell.
    pub(super) fn weigh_open(
        &mut self,
        is_open: &[bool],
        left_over: &LeftOver,
        log_gain: impl Fn(usize, [u32; 2]) -> f64,
    ) {
        self.weigh_where(left_over, log_gain, |i, _| is_open[i]);
    }

    /// Clears the weights: no cell would explain foreground.
    pub(super) fn forget(&mut self) {
        self.cumulative.clear();
    }

    fn weigh_where(
        &mut self,
        left_over: &LeftOver,
        log_gain: impl Fn(usize, [u32; 2]) -> f64,
        counts: impl Fn(usize, &Cell) -> bool,
    ) {
        let gains: Vec<f64> = self
            .cells
            .iter()
            .enumerate()
            .map(|(i, cell)| {
                if !counts(i, cell) {
                    return 0.0;
                }
                let seen = || left_over.at(&cell.filled);
                // Most places would explain no foreground.
                let explains = seen().any(|(_, [_, found])| found > 0);
                if explains { seen().map(|(camera, counts)| log_gain(camera, counts)).sum() } else { 0.0 }
            })
            .collect();
        self.cumulative.clear();
        let best = gains.iter().copied().fold(0.0, f64::max);
        if best <= 0.0 {
            return;
        }
        // The middle of a cell gains less than the best place in it, so the weights are tempered to a peak of about
        // five nats.
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

    /// Draws a place, metres: with probability `informed` by the weights, otherwise uniformly. The place may lie just
    /// outside the region, in a cell that straddles its border.
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
        self.cells[i].center + Vector2::new(dx, dy)
    }

    /// Density of [`Self::sample`] at a place, 1/m².
    pub(super) fn density(&self, x_m: f64, y_m: f64, informed: f64) -> f64 {
        let Some(i) = self.cell_at(x_m, y_m) else { return 0.0 };
        let uniform = 1.0 / self.cells.len() as f64;
        let share = if self.cumulative.is_empty() {
            uniform
        } else {
            let weight = self.cumulative[i] - if i == 0 { 0.0 } else { self.cumulative[i - 1] };
            informed * weight + (1.0 - informed) * uniform
        };
        share / self.cell_area_m2()
    }

    /// Column and row of the square of the bounding box that holds a place.
    fn square_of(&self, place: &Point2<f64>) -> (usize, usize) {
        let offset = (place - self.low) / self.cell_m;
        (offset.x as usize, offset.y as usize)
    }

    fn cell_at(&self, x_m: f64, y_m: f64) -> Option<usize> {
        let place = Point2::new(x_m, y_m);
        let (column, row) = self.square_of(&place);
        if x_m < self.low.x || y_m < self.low.y || column >= self.columns {
            return None;
        }
        let square = row * self.columns + column;
        self.cell_of.get(square).copied().flatten().map(|i| i as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::super::person::Person;
    use super::super::tests::{empty_room, masks, standing};
    use super::*;
    use crate::likelihood::{LikelihoodRule, Simulation, pack};
    use crate::method::mcmc::McmcOptions;
    use crate::silhouette::{Shape, Silhouette, View};
    use rand::SeedableRng;

    /// Proposal density at the true place of a person whom one camera places at a wrong distance, where an obstacle
    /// hides the wrong place from the other camera (`is_hidden`) or that camera sees that nobody stands there.
    fn density_at_truth(is_hidden: bool) -> f64 {
        let (truth, wrong) = (standing(3.125, 2.625), standing(3.71, 3.11));
        let mut stage = empty_room();
        let seen = masks(&stage, &[truth]);
        if is_hidden {
            let camera = &mut stage.cameras[1];
            for (u, v) in Silhouette::new(&View::new(camera), &Shape::REACH.of(&wrong)).pixels() {
                let at = (v * camera.width() + u) as usize;
                camera.static_z_m[at] = 0.5;
            }
        }
        let rule: LikelihoodRule = McmcOptions::default().likelihood;
        let views: Vec<View> = stage.cameras.iter().map(View::new).collect();
        let packed: Vec<_> =
            seen.iter().zip(&views).map(|(frame, view)| frame.mask.as_ref().map(|m| pack(m, view))).collect();
        let layers = Layers::new(views, rule.shapes());
        let mut simulation = Simulation::new(&layers);
        simulation.restart(&packed);
        let silhouettes = layers.silhouettes(&wrong, |_| true);
        simulation.insert(&silhouettes);
        let person =
            Person { key: 0, body: wrong, silhouettes, at_exit: false, known: None, tentative: false };
        let mut left_over = LeftOver::default();
        left_over.restart(&layers, &simulation, &[person]);
        let mut births = BirthMap::new(&layers, &standing(0.0, 0.0), stage.floor.bounds(), |_, _| true);
        // A foreground pixel gains half of what a pixel without foreground costs.
        births.weigh(&left_over, |_, [all, found]| 3.0 * f64::from(found) - 2.0 * f64::from(all));
        births.density(truth.x_m, truth.y_m, 1.0)
    }

    /// Draws fall into each cell as often as the density predicts, within five standard deviations of a binomial.
    #[test]
    fn places_are_drawn_as_the_density_says() {
        let stage = empty_room();
        let layers = Layers::new(stage.cameras.iter().map(View::new).collect(), &[Shape::CORE]);
        let inside = |x: f64, y: f64| (1.0..3.0).contains(&x) && (x + y) % 2.0 < 1.4;
        let mut births = BirthMap::new(&layers, &standing(0.0, 0.0), stage.floor.bounds(), inside);
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        for is_weighed in [false, true] {
            if is_weighed {
                let mut sum = 0.0;
                births.cumulative = births
                    .cells
                    .iter()
                    .map(|_| {
                        sum += rng.random::<f64>().powi(3);
                        sum
                    })
                    .collect();
                births.cumulative.iter_mut().for_each(|c| *c /= sum);
            }
            for informed in [0.0, 0.3, 0.8, 1.0] {
                const DRAWS: u32 = 200_000;
                let mut found = vec![0_u32; births.cells.len()];
                for _ in 0..DRAWS {
                    let place = births.sample(informed, &mut rng);
                    found[births.cell_at(place.x, place.y).unwrap()] += 1;
                }
                let (n, area) = (f64::from(DRAWS), births.cell_m * births.cell_m);
                let mut all = 0.0;
                for (cell, found) in births.cells.iter().zip(&found) {
                    let p = area * births.density(cell.center.x, cell.center.y, informed);
                    all += p;
                    let off = (f64::from(*found) - n * p).abs();
                    assert!(off <= 5.0 * (n * p * (1.0 - p)).sqrt() + 1.0, "{found} of {} expected", n * p);
                }
                assert!((all - 1.0).abs() < 1e-9, "a density sums up to 1, not {all}");
            }
        }
        assert!(births.density(-50.0, 0.0, 0.5) == 0.0 && births.density(4.0, 0.0, 0.5) == 0.0);
    }

    #[test]
    fn a_person_at_a_wrong_distance_in_one_camera_is_proposed_at_the_place_seen_by_another() {
        let even = 1.0 / 30.0;
        assert!(density_at_truth(true) > 5.0 * even, "{}", density_at_truth(true));
        // A prediction that both cameras can check explains the first camera's foreground, so that little is left to propose
        // the true place.
        assert!(density_at_truth(false) < density_at_truth(true) / 5.0, "{}", density_at_truth(false));
    }
}
