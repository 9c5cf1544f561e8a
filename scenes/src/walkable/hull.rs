//! The convex hull of places on the floor.

use nalgebra::Point2;

use crate::polygon::Polygon;

/// The smallest convex polygon around the points, counter-clockwise (Andrew's monotone chain). Fewer than three
/// corners when all points lie on a line.
pub(super) fn convex(mut points: Vec<Point2<f64>>) -> Polygon {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let turn = |a: Point2<f64>, b: Point2<f64>, c: Point2<f64>| (b - a).perp(&(c - a));
    let half = |points: &mut dyn Iterator<Item = Point2<f64>>| {
        let mut chain: Vec<Point2<f64>> = Vec::new();
        for p in points {
            while chain.len() > 1 && turn(chain[chain.len() - 2], chain[chain.len() - 1], p) <= 0.0 {
                chain.pop();
            }
            chain.push(p);
        }
        // The last point opens the other half.
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    Polygon(hull)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_square_with_points_in_it_and_on_its_edges() {
        let points: Vec<Point2<f64>> =
            (0..25).map(|i| Point2::new(f64::from(i % 5), f64::from(i / 5))).collect();
        let hull = convex(points);
        assert_eq!(hull.0.len(), 4);
        assert!((hull.area() - 16.0).abs() < 1e-12);
        assert!(convex(vec![]).0.is_empty());
        assert!(convex(vec![Point2::origin(); 3]).0.len() < 3);
        assert!(convex((0..4).map(|i| Point2::new(f64::from(i), 1.0)).collect()).0.len() < 3);
    }
}
