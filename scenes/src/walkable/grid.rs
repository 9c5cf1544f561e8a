//! A bitmap of the floor.

use std::collections::VecDeque;

use nalgebra::Point2;

use crate::polygon::Polygon;

/// Largest number of cells a side: a room of 100 m has cells of 5 cm.
const MOST_CELLS_A_SIDE: f64 = 2000.0;
/// Extent from which on a room is rather one in another unit than the metre …
const VAST_M: f64 = 1000.0;
/// … and the largest number of cells of its side: people wait for the warning, not for the map.
const MOST_CELLS_OF_VAST: f64 = 400.0;

/// Square cells on the floor, each set or not.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Lower left corner of the first cell, metres.
    pub origin: Point2<f64>,
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Cells along x.
    pub columns: usize,
    /// Cells along y.
    pub rows: usize,
    /// Row by row, y growing; within a row, x growing.
    pub bits: Vec<bool>,
}

impl Grid {
    /// An empty grid over all of the given bounds (smallest and largest corner), with cells of side `cell_m` or, if the
    /// bounds are very large, of a larger side. `None` without finite bounds.
    pub(super) fn around(
        bounds: impl IntoIterator<Item = (Point2<f64>, Point2<f64>)>,
        cell_m: f64,
    ) -> Option<Self> {
        let (low, high) = bounds.into_iter().reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))?;
        let extent = high - low;
        if !(extent.x.is_finite() && extent.y.is_finite() && extent.x >= 0.0 && extent.y >= 0.0) {
            return None;
        }
        let most = if extent.max() > VAST_M { MOST_CELLS_OF_VAST } else { MOST_CELLS_A_SIDE };
        let cell_m = cell_m.max(extent.max() / most);
        let cells = |length: f64| (length / cell_m).ceil().max(1.0) as usize;
        let (columns, rows) = (cells(extent.x), cells(extent.y));
        Some(Self { origin: low, cell_m, columns, rows, bits: vec![false; columns * rows] })
    }

    /// A grid of the same cells, none of them set.
    pub(super) fn cleared(&self) -> Self {
        self.with(vec![false; self.bits.len()])
    }

    /// A grid of the same cells with other bits.
    pub(super) fn with(&self, bits: Vec<bool>) -> Self {
        Self { bits, ..*self }
    }

    /// Index of the cell that holds a place.
    pub fn index_of(&self, p: &Point2<f64>) -> Option<usize> {
        let place = (p - self.origin) / self.cell_m;
        // The comparison is false for NaN, too.
        let inside =
            (0.0..self.columns as f64).contains(&place.x) && (0.0..self.rows as f64).contains(&place.y);
        inside.then(|| place.y as usize * self.columns + place.x as usize)
    }

    /// Tells whether the cell that holds a place is set; `false` outside the grid.
    pub fn contains(&self, p: &Point2<f64>) -> bool {
        self.index_of(p).is_some_and(|i| self.bits[i])
    }

    /// Middle of a cell, metres.
    pub fn center(&self, index: usize) -> Point2<f64> {
        let (column, row) = ((index % self.columns) as f64, (index / self.columns) as f64);
        self.origin + nalgebra::Vector2::new(column + 0.5, row + 0.5) * self.cell_m
    }

    /// Area of the set cells in square metres.
    pub fn area_m2(&self) -> f64 {
        self.bits.iter().filter(|bit| **bit).count() as f64 * self.cell_m * self.cell_m
    }

    /// Smallest and largest corner of the rectangle around the set cells, metres.
    pub fn bounds(&self) -> Option<(Point2<f64>, Point2<f64>)> {
        let half = nalgebra::Vector2::repeat(0.5 * self.cell_m);
        self.set_cells()
            .map(|i| (self.center(i) - half, self.center(i) + half))
            .reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))
    }

    /// Indices of the set cells.
    pub(super) fn set_cells(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.bits.len()).filter(|&i| self.bits[i])
    }

    /// Sets the cells whose middle lies in a polygon, row by row: where a row's middle line crosses the outline is found
    /// once, so that outlines of many corners take no longer than they must.
    pub(super) fn fill(&mut self, polygon: &Polygon) {
        let (low, high) = polygon.bounds();
        let cell = |p: f64, origin: f64, count: usize| {
            ((p - origin) / self.cell_m).floor().clamp(0.0, count as f64 - 1.0) as usize
        };
        let columns = cell(low.x, self.origin.x, self.columns)..=cell(high.x, self.origin.x, self.columns);
        for row in cell(low.y, self.origin.y, self.rows)..=cell(high.y, self.origin.y, self.rows) {
            let first = row * self.columns;
            let mut crossings = polygon.crossings_at(self.center(first).y);
            crossings.sort_by(f64::total_cmp);
            // A place is inside where an odd number of crossings lie to its right.
            let mut left = crossings.as_slice();
            for column in columns.clone() {
                let x = self.center(first + column).x;
                while let [nearest, rest @ ..] = left
                    && *nearest <= x
                {
                    left = rest;
                }
                self.bits[first + column] |= left.len() % 2 == 1;
            }
        }
    }

    /// The up to eight cells around a cell.
    fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        let (column, row) = ((index % self.columns) as i64, (index / self.columns) as i64);
        (-1..=1).flat_map(move |dy| (-1..=1).map(move |dx| (column + dx, row + dy))).filter_map(
            move |(x, y)| {
                let inside = (0..self.columns as i64).contains(&x) && (0..self.rows as i64).contains(&y);
                (inside && (x, y) != (column, row)).then(|| y as usize * self.columns + x as usize)
            },
        )
    }

    /// Cells, itself included, whose middle lies within `radius_m` of a cell's.
    pub(super) fn within(&self, index: usize, radius_m: f64) -> impl Iterator<Item = usize> + use<> {
        // Slightly enlarged, so that a whole number of cells is reached despite rounding.
        let cells = radius_m / self.cell_m + 1e-9;
        let (column, row) = ((index % self.columns) as i64, (index / self.columns) as i64);
        let (columns, rows) = (self.columns as i64, self.rows as i64);
        let reach = cells.floor() as i64;
        let on_row = move |dy: i64| {
            let half = (cells * cells - (dy * dy) as f64).max(0.0).sqrt().floor() as i64;
            let from = (column - half).max(0)..(column + half + 1).min(columns);
            from.map(move |x| ((row + dy) * columns + x) as usize)
        };
        ((-reach).max(-row)..=reach.min(rows - 1 - row)).flat_map(on_row)
    }

    /// Connected patches of set cells (diagonals connect), each as the indices of its cells.
    pub(super) fn patches(&self) -> Vec<Vec<usize>> {
        let mut seen = vec![false; self.bits.len()];
        let mut patches = Vec::new();
        for start in self.set_cells() {
            if std::mem::replace(&mut seen[start], true) {
                continue;
            }
            let mut patch = vec![start];
            let mut next = 0;
            while next < patch.len() {
                for neighbour in self.neighbours(patch[next]) {
                    if self.bits[neighbour] && !std::mem::replace(&mut seen[neighbour], true) {
                        patch.push(neighbour);
                    }
                }
                next += 1;
            }
            patches.push(patch);
        }
        patches
    }

    /// Set cells that can be reached from `starts` (which must be set, too) in at most `steps` steps from cell to cell,
    /// diagonals included.
    pub(super) fn reached_from(&self, starts: &Self, steps: usize) -> Self {
        let mut reached = self.cleared();
        let mut queue = VecDeque::new();
        for i in self.set_cells().filter(|&i| starts.bits[i]) {
            reached.bits[i] = true;
            queue.push_back((i, 0));
        }
        while let Some((i, taken)) = queue.pop_front() {
            if taken == steps {
                continue;
            }
            for neighbour in self.neighbours(i) {
                if self.bits[neighbour] && !std::mem::replace(&mut reached.bits[neighbour], true) {
                    queue.push_back((neighbour, taken + 1));
                }
            }
        }
        reached
    }

    /// The cells that are not set.
    pub(super) fn inverted(&self) -> Self {
        self.with(self.bits.iter().map(|bit| !bit).collect())
    }

    /// Morphological closing: fills gaps and holes narrower than twice `radius_m`.
    pub(super) fn closed(&self, radius_m: f64) -> Self {
        self.dilated(radius_m).inverted().dilated(radius_m).inverted()
    }

    /// Morphological dilation: cells with a set cell within `radius_m` of theirs, middle to middle.
    pub(super) fn dilated(&self, radius_m: f64) -> Self {
        let mut out = self.clone();
        for i in self.set_cells() {
            // A cell whose neighbours are all set adds nothing that they do not.
            if self.neighbours(i).filter(|&n| self.bits[n]).count() < 8 {
                for k in self.within(i, radius_m) {
                    out.bits[k] = true;
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn random(share: f64, seed: u64) -> Grid {
        let corner = Point2::new(-1.0, 2.0);
        let mut grid = Grid::around([(corner, corner + nalgebra::Vector2::new(1.6, 1.1))], 0.1).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        grid.bits.iter_mut().for_each(|bit| *bit = rng.random_bool(share));
        grid
    }

    #[test]
    fn places_and_cells_agree() {
        let grid = random(0.5, 1);
        assert_eq!((grid.columns, grid.rows), (16, 11));
        for i in 0..grid.bits.len() {
            assert_eq!(grid.index_of(&grid.center(i)), Some(i));
        }
        for (x, y) in [(-1.01, 2.5), (0.61, 2.5), (0.0, 1.99), (0.0, 3.11), (f64::NAN, 2.5)] {
            assert_eq!(grid.index_of(&Point2::new(x, y)), None);
        }
        assert!(Grid::around([], 0.1).is_none());
        assert!(Grid::around([(Point2::origin(), Point2::new(f64::INFINITY, 1.0))], 0.1).is_none());
        // A continent has larger cells, not more.
        let vast = Grid::around([(Point2::origin(), Point2::new(1e7, 10.0))], 0.05).unwrap();
        assert!(vast.bits.len() <= 4000);
    }

    #[test]
    fn filling_sets_the_cells_whose_middles_are_inside() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        for corners in [3, 4, 7, 40, 500] {
            // Outlines that cross themselves and leave the grid.
            let corner = |_| Point2::new(2.4 * rng.random::<f64>() - 1.4, 2.0 * rng.random::<f64>() + 1.6);
            let polygon = Polygon((0..corners).map(corner).collect());
            let mut grid = random(0.1, 9);
            let before = grid.clone();
            grid.fill(&polygon);
            for i in 0..grid.bits.len() {
                assert_eq!(
                    grid.bits[i],
                    before.bits[i] || polygon.contains(&grid.center(i)),
                    "{corners} {i}"
                );
            }
        }
    }

    #[test]
    fn dilation_is_what_it_says() {
        for (share, radius) in [(0.05, 0.0), (0.1, 0.1), (0.3, 0.2), (0.9, 0.25)] {
            let grid = random(share, 2);
            let fast = grid.dilated(radius);
            for i in 0..grid.bits.len() {
                let near = |k: usize| (grid.center(k) - grid.center(i)).norm() <= radius + 1e-6;
                assert_eq!(fast.bits[i], grid.set_cells().any(near));
                let within: Vec<usize> = (0..grid.bits.len()).filter(|&k| near(k)).collect();
                assert_eq!(grid.within(i, radius).collect::<Vec<_>>(), within);
            }
        }
    }

    #[test]
    fn patches_part_the_set_cells_and_steps_count() {
        let grid = random(0.4, 3);
        let patches = grid.patches();
        let mut all: Vec<usize> = patches.iter().flatten().copied().collect();
        all.sort_unstable();
        assert_eq!(all, grid.set_cells().collect::<Vec<_>>());
        for (i, a) in patches.iter().enumerate() {
            for b in &patches[..i] {
                let touching = |&p: &usize| grid.neighbours(p).any(|n| b.contains(&n));
                assert!(!a.iter().any(touching), "two patches touch");
            }
            // Enough steps reach the whole patch and nothing else.
            let mut start = grid.cleared();
            start.bits[a[0]] = true;
            let reached = grid.reached_from(&start, grid.bits.len());
            assert_eq!(reached.set_cells().count(), a.len());
            assert!(a.iter().all(|&p| reached.bits[p]));
            assert_eq!(grid.reached_from(&start, 0).set_cells().collect::<Vec<_>>(), [a[0]]);
        }
        let full = grid.with(vec![true; grid.bits.len()]);
        let mut corner = grid.cleared();
        corner.bits[0] = true;
        // A square of four cells a side: diagonals are steps.
        assert_eq!(full.reached_from(&corner, 3).set_cells().count(), 16);
    }

    #[test]
    fn closing_fills_holes_and_keeps_outlines() {
        let mut grid = random(0.0, 4);
        grid.fill(&Polygon::rectangle(Point2::new(-0.8, 2.2), Point2::new(0.2, 2.8)));
        let whole = grid.clone();
        assert_eq!(whole.set_cells().count(), 60);
        let middle = grid.index_of(&Point2::new(-0.25, 2.45)).unwrap();
        grid.bits[middle] = false;
        assert_eq!(grid.closed(0.1), whole);
        let (low, high) = whole.bounds().unwrap();
        assert!((low - Point2::new(-0.8, 2.2)).norm() < 1e-9 && (high - Point2::new(0.2, 2.8)).norm() < 1e-9);
        assert!(grid.cleared().bounds().is_none());
    }
}
