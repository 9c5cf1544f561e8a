//! Outline of a region sampled in cells, as closed lines.

use std::collections::BTreeMap;

use nalgebra::Point2;

/// Outlines of the region in which `inside` holds, sampled at the centres of square cells over a box.
///
/// Closed lines in metres, the inside on their left, corners cut once so that steps do not look like a saw. Regions
/// that reach the box's rim end there.
pub(super) fn outlines(
    inside: impl Fn(Point2<f64>) -> bool,
    low: Point2<f64>,
    high: Point2<f64>,
    cell_m: f64,
) -> Vec<Vec<Point2<f64>>> {
    let columns = ((high.x - low.x) / cell_m).ceil().max(0.0) as i64;
    let rows = ((high.y - low.y) / cell_m).ceil().max(0.0) as i64;
    let cells: Vec<(i64, i64)> = (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))).collect();
    let center = |index: i64, low: f64| low + (index as f64 + 0.5) * cell_m;
    let is_inside: Vec<bool> =
        cells.iter().map(|(i, j)| inside(Point2::new(center(*i, low.x), center(*j, low.y)))).collect();
    let cell = |i: i64, j: i64| {
        (0..columns).contains(&i) && (0..rows).contains(&j) && is_inside[(j * columns + i) as usize]
    };
    // Edges between inside and outside, from corner to corner, counter-clockwise around the inside.
    let mut next: BTreeMap<(i64, i64), Vec<(i64, i64)>> = BTreeMap::new();
    for (i, j) in cells.iter().copied().filter(|(i, j)| cell(*i, *j)) {
        let sides = [
            (cell(i, j - 1), (i, j), (i + 1, j)),
            (cell(i + 1, j), (i + 1, j), (i + 1, j + 1)),
            (cell(i, j + 1), (i + 1, j + 1), (i, j + 1)),
            (cell(i - 1, j), (i, j + 1), (i, j)),
        ];
        for (_, from, to) in sides.into_iter().filter(|(neighbour, ..)| !neighbour) {
            next.entry(from).or_default().push(to);
        }
    }
    let mut lines = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let (mut corners, mut at) = (vec![start], start);
        while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
            if next.get(&at).is_some_and(Vec::is_empty) {
                next.remove(&at);
            }
            at = to;
            if at == start {
                break;
            }
            corners.push(at);
        }
        lines.push(cut_corners(&corners, low, cell_m));
    }
    lines
}

/// Converts corners in cells to a line through the middles of its edges, in metres.
fn cut_corners(corners: &[(i64, i64)], low: Point2<f64>, cell_m: f64) -> Vec<Point2<f64>> {
    let metres = |(i, j): (i64, i64)| Point2::new(low.x + i as f64 * cell_m, low.y + j as f64 * cell_m);
    let edges = corners.iter().zip(corners.iter().cycle().skip(1));
    edges.map(|(a, b)| nalgebra::center(&metres(*a), &metres(*b))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polygon::Polygon;

    #[test]
    fn outlines_enclose_the_regions_area() {
        let inside = |p: Point2<f64>| {
            let ring = (0.5..1.5).contains(&p.coords.norm());
            ring || (p - Point2::new(3.0, 0.0)).norm() < 0.4
        };
        let mut areas: Vec<f64> = outlines(inside, Point2::new(-2.0, -2.0), Point2::new(4.0, 2.0), 0.02)
            .into_iter()
            .map(|line| Polygon(line).area())
            .collect();
        areas.sort_unstable_by(f64::total_cmp);
        let expected = [0.16, 0.25, 2.25].map(|r2| r2 * std::f64::consts::PI);
        assert_eq!(areas.len(), 3);
        for (area, expected) in areas.iter().zip(expected) {
            assert!((area - expected).abs() < 0.03 * expected, "{area} instead of {expected}");
        }
    }

    #[test]
    fn touching_corners_and_the_rim_end_lines_properly() {
        let checkers = |p: Point2<f64>| (p.x.floor() as i64 + p.y.floor() as i64) % 2 == 0;
        let lines = outlines(checkers, Point2::origin(), Point2::new(4.0, 4.0), 1.0);
        let edges: usize = lines.iter().map(Vec::len).sum();
        assert_eq!(edges, 8 * 4, "each of the 8 squares keeps its four edges");
        assert_eq!(outlines(|_| true, Point2::origin(), Point2::new(4.0, 4.0), 0.5).len(), 1);
        assert!(outlines(|_| false, Point2::origin(), Point2::new(4.0, 4.0), 0.5).is_empty());
    }
}
