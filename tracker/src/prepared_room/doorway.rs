//! Floor behind the doors: the part of the floor whose shortest way leads through a zone.

use std::collections::VecDeque;

use nalgebra::{Point2, Vector2};
use scenes::room::Zone;
use scenes::walkable::Grid;

/// Least detour, metres: a place lies behind a zone when every other way is longer than the way through it by more than
/// this.
const DETOUR_M: f64 = 1.5;
/// Length of wall assumed beside a door, metres, even where the reconstruction has holes. A room that goes on around a
/// corner nearer than that is still reached with a small detour.
const WALL_M: f64 = 2.0;
/// Length of wall required on either side of a door, metres. A zone without it may stand for a staircase in the middle
/// of a hall; a side of a zone with wall at one end alone is perpendicular to the wall.
const AT_WALL_M: f64 = 0.5;
/// Step along the wall's line, cells.
const LINE_STEP: f64 = 0.5;

/// Walkable cells behind a zone: cells that cannot be reached from the middle of the room without crossing a zone, or
/// only by a detour. A reconstructed wall has holes, so a corridor may touch the room around a corner, and right beside
/// the door.
pub(super) fn beyond_zones(grid: &Grid, zones: &[Zone]) -> Vec<bool> {
    let in_zone: Vec<bool> =
        (0..grid.bits.len()).map(|i| zones.iter().any(|z| z.polygon.contains(&grid.center(i)))).collect();
    let is_room = |i: usize| grid.bits[i] && !in_zone[i];
    let Some(middle) = middle_of_largest_region(grid, is_room) else { return vec![false; grid.bits.len()] };
    let through = steps_from(grid, middle, |i| grid.bits[i]);
    let mut wall = vec![false; grid.bits.len()];
    for i in zones.iter().flat_map(|zone| wall_beside(grid, zone)) {
        wall[i] = true;
    }
    let around = steps_from(grid, middle, |i| is_room(i) && !wall[i]);
    let detour = (DETOUR_M / grid.cell_m).ceil() as usize;
    (0..grid.bits.len())
        .map(|i| {
            let is_detour = |through: usize| around[i].is_none_or(|around| around > through + detour);
            is_room(i) && through[i].is_some_and(is_detour)
        })
        .collect()
}

/// Cells of the wall on both sides of a zone's door; empty for a zone that is in no wall. The door is the side of the
/// zone that has floor beyond it, wall at both ends and, of several such sides, the most wall.
fn wall_beside(grid: &Grid, zone: &Zone) -> Vec<usize> {
    let leads_out = |a: &Point2<f64>, b: &Point2<f64>| {
        let Some(across) = Vector2::new(b.y - a.y, a.x - b.x).try_normalize(0.0) else { return false };
        [across, -across]
            .map(|step| nalgebra::center(a, b) + step * (2.0 * grid.cell_m))
            .iter()
            .any(|place| !zone.polygon.contains(place) && grid.contains(place))
    };
    let doors = zone.polygon.edges().filter(|(a, b)| leads_out(a, b));
    let at_wall = (AT_WALL_M / (LINE_STEP * grid.cell_m)).ceil() as usize;
    let sides = doors.filter_map(|(a, b)| {
        let ends = [along(b, a, grid.cell_m), along(a, b, grid.cell_m)];
        let walls = ends.each_ref().map(|end| end.iter().filter(|place| !grid.contains(place)).count());
        walls.iter().all(|wall| *wall >= at_wall).then(|| (walls.iter().sum::<usize>(), ends.concat()))
    });
    let wall = sides.max_by_key(|(walls, _)| *walls);
    wall.iter().flat_map(|(_, beside)| beside).filter_map(|place| grid.index_of(place)).collect()
}

/// Places on the line from `a` through `b`, beginning at `b`, for the assumed length of a wall; dense enough that no
/// path from cell to cell crosses it.
fn along(a: Point2<f64>, b: Point2<f64>, cell_m: f64) -> Vec<Point2<f64>> {
    let step_m = LINE_STEP * cell_m;
    let direction = (b - a).normalize();
    (0..=(WALL_M / step_m) as usize).map(|i| b + direction * (i as f64 * step_m)).collect()
}

/// The cell of the largest connected region that is nearest to the region's centroid.
fn middle_of_largest_region(grid: &Grid, is_free: impl Fn(usize) -> bool + Copy) -> Option<usize> {
    let mut visited = vec![false; grid.bits.len()];
    let mut largest: Vec<usize> = Vec::new();
    for start in 0..grid.bits.len() {
        if visited[start] || !is_free(start) {
            continue;
        }
        let region: Vec<usize> = steps_from(grid, start, is_free)
            .iter()
            .enumerate()
            .filter_map(|(i, steps)| steps.map(|_| i))
            .inspect(|i| visited[*i] = true)
            .collect();
        if region.len() > largest.len() {
            largest = region;
        }
    }
    let sum: Vector2<f64> = largest.iter().map(|i| grid.center(*i).coords).sum();
    let centroid = Point2::from(sum / largest.len().max(1) as f64);
    let distance = |i: &usize| (grid.center(*i) - centroid).norm();
    largest.into_iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// Number of steps on the shortest path from a cell to each other cell; `None` where there is no path.
fn steps_from(grid: &Grid, start: usize, is_free: impl Fn(usize) -> bool) -> Vec<Option<usize>> {
    let mut steps = vec![None; grid.bits.len()];
    steps[start] = Some(0);
    let mut queue = VecDeque::from([(start, 0)]);
    while let Some((i, so_far)) = queue.pop_front() {
        for n in neighbours(grid, i) {
            if steps[n].is_none() && is_free(n) {
                steps[n] = Some(so_far + 1);
                queue.push_back((n, so_far + 1));
            }
        }
    }
    steps
}

/// The cells that share an edge with a cell.
fn neighbours(grid: &Grid, i: usize) -> impl Iterator<Item = usize> {
    let (column, row, columns, rows) = (i % grid.columns, i / grid.columns, grid.columns, grid.rows);
    let left = (column > 0).then(|| i - 1);
    let right = (column + 1 < columns).then_some(i + 1);
    let below = (row > 0).then(|| i - columns);
    let above = (row + 1 < rows).then_some(i + columns);
    [left, right, below, above].into_iter().flatten()
}
