//! Free floor of a synthetic room: a grid of places for the middle of a person, exact from the furniture's footprints.

use std::collections::VecDeque;

use glam::Vec3;
use nalgebra::{Point2, Vector2};

use super::furniture::Furniture;
use super::shell::Door;
use scenes::polygon::Polygon;

/// Side of a cell.
pub(super) const CELL_M: f64 = 0.1;

/// Distance that the middle of a person keeps from walls and furniture.
pub(super) const CLEARANCE_M: f64 = 0.32;

/// A cell of the floor.
pub(super) type FloorCell = (i16, i16);

/// The free floor of a room and of the passages behind its doors.
#[derive(Debug, Clone)]
pub(super) struct FreeFloor {
    origin: Point2<f64>,
    columns: i16,
    rows: i16,
    free: Vec<bool>,
}

impl FreeFloor {
    /// The floor that is `clearance` metres from every wall and piece of furniture.
    pub(super) fn new(size: Vec3, doors: &[Door], furniture: &[Furniture], clearance: f64) -> Self {
        let rim = Vector2::new(2.0, 2.0);
        let high = Point2::new(f64::from(size.x), f64::from(size.y));
        let origin = Point2::origin() - rim;
        let columns = ((high.x + 2.0 * rim.x) / CELL_M) as i16;
        let rows = ((high.y + 2.0 * rim.y) / CELL_M) as i16;
        let inset = Vector2::new(clearance, clearance);
        let open: Vec<Polygon> = std::iter::once(Polygon::rectangle(Point2::origin() + inset, high - inset))
            .chain(doors.iter().map(|door| door.passage(clearance as f32)))
            .collect();
        let mut floor = Self { origin, columns, rows, free: Vec::new() };
        floor.free = (0..rows)
            .flat_map(|j| (0..columns).map(move |i| (i, j)))
            .map(|cell| {
                let p = floor.center(cell);
                open.iter().any(|polygon| polygon.contains(&p))
                    && furniture.iter().all(|piece| piece.footprint.distance_m(&p) > clearance)
            })
            .collect();
        floor
    }

    pub(super) fn center(&self, (i, j): FloorCell) -> Point2<f64> {
        self.origin + Vector2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) * CELL_M
    }

    pub(super) fn cell(&self, p: &Point2<f64>) -> FloorCell {
        let offset = (p - self.origin) / CELL_M;
        (offset.x.floor() as i16, offset.y.floor() as i16)
    }

    pub(super) fn is_free(&self, (i, j): FloorCell) -> bool {
        (0..self.columns).contains(&i)
            && (0..self.rows).contains(&j)
            && self.free[usize::from(j as u16) * usize::from(self.columns as u16) + usize::from(i as u16)]
    }

    /// Free cells, row by row.
    pub(super) fn free_cells(&self) -> impl Iterator<Item = FloorCell> + '_ {
        (0..self.rows).flat_map(|j| (0..self.columns).map(move |i| (i, j))).filter(|c| self.is_free(*c))
    }

    /// The free cells that can be reached from a place.
    pub(super) fn reachable(&self, from: &Point2<f64>) -> Vec<FloorCell> {
        let start = self.cell(from);
        let mut seen = vec![false; self.free.len()];
        let mut found = Vec::new();
        let mut queue = VecDeque::from([start]);
        while let Some(cell) = queue.pop_front() {
            let (i, j) = cell;
            if !self.is_free(cell) {
                continue;
            }
            let index = usize::from(j as u16) * usize::from(self.columns as u16) + usize::from(i as u16);
            if std::mem::replace(&mut seen[index], true) {
                continue;
            }
            found.push(cell);
            queue.extend([(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)]);
        }
        found
    }

    /// Tells whether the straight way between two places is free.
    pub(super) fn is_clear(&self, a: &Point2<f64>, b: &Point2<f64>) -> bool {
        let steps = ((b - a).norm() / (0.5 * CELL_M)).ceil().max(1.0) as usize;
        (0..=steps).all(|i| self.is_free(self.cell(&(a + (b - a) * (i as f64 / steps as f64)))))
    }
}
