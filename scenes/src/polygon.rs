//! Simple polygons on the floor: zones, walkable regions.

use nalgebra::{Point2, Vector2};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use shell::ranges::ROOM_M;

/// A simple polygon on the floor plane, in metres; either orientation, implicitly closed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Polygon(pub Vec<Point2<f64>>);

/// Defect of a place on the floor that is in no room.
pub(crate) fn coordinate_defect(place: &Point2<f64>) -> Option<String> {
    place.iter().find_map(|metres| ROOM_M.defect(*metres))
}

impl Polygon {
    /// The axis-aligned rectangle between two corners.
    pub fn rectangle(a: Point2<f64>, b: Point2<f64>) -> Self {
        Self(vec![a, Point2::new(b.x, a.y), b, Point2::new(a.x, b.y)])
    }

    /// The smallest convex polygon around the points, counter-clockwise (Andrew's monotone chain). Fewer than three
    /// corners when all points lie on a line.
    pub fn convex_hull(mut points: Vec<Point2<f64>>) -> Self {
        points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
        points.dedup();
        let half = |points: &mut dyn Iterator<Item = Point2<f64>>| {
            let mut chain: Vec<Point2<f64>> = Vec::new();
            for p in points {
                while let [.., a, b] = chain[..]
                    && (b - a).perp(&(p - a)) <= 0.0
                {
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
        Self(hull)
    }

    /// Defect for which the polygon is unusable: fewer than three corners, a corner outside of every room, or no area.
    pub fn defect(&self) -> Option<String> {
        if self.0.len() < 3 {
            return Some(format!("a polygon needs at least 3 corners, this one has {}", self.0.len()));
        }
        if !self.0.iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
            return Some("a corner is not a finite number".into());
        }
        let defect = |(i, corner): (usize, &Point2<f64>)| {
            Some(format!("corner {} {}", i + 1, coordinate_defect(corner)?))
        };
        if let Some(problem) = self.0.iter().enumerate().find_map(defect) {
            return Some(problem);
        }
        (self.area() < 1e-6).then(|| "the polygon has no area".into())
    }

    /// Indices from 0 of the first two edges that cross, touch, or run back over each other. `None` for a simple
    /// polygon.
    pub fn crossing(&self) -> Option<(usize, usize)> {
        let edges: Vec<_> = self.edges().collect();
        let meet = |i: usize, j: usize| {
            let ((a, b), (c, d)) = (edges[i], edges[j]);
            if b == c {
                return runs_back(a, b, d);
            }
            if d == a {
                return runs_back(c, d, b);
            }
            segments_meet(a, b, c, d)
        };
        (0..edges.len()).find_map(|i| (i + 1..edges.len()).find(|j| meet(i, *j)).map(|j| (i, j)))
    }

    /// Edges, in order, the closing one last.
    pub fn edges(&self) -> impl Iterator<Item = (Point2<f64>, Point2<f64>)> + '_ {
        self.0.iter().copied().zip(self.0.iter().copied().cycle().skip(1))
    }

    /// Area in square metres, in either orientation.
    pub fn area(&self) -> f64 {
        0.5 * self.edges().map(|(a, b)| a.x * b.y - b.x * a.y).sum::<f64>().abs()
    }

    /// Tells whether a point lies inside (crossing number; points on the border may fall on either side).
    pub fn contains(&self, p: &Point2<f64>) -> bool {
        self.each_crossing(p.y).filter(|x| p.x < *x).count() % 2 == 1
    }

    /// Values of x at which the outline crosses the line of that y, in the order of the edges.
    pub(crate) fn crossings_at(&self, y: f64) -> Vec<f64> {
        self.each_crossing(y).collect()
    }

    fn each_crossing(&self, y: f64) -> impl Iterator<Item = f64> + '_ {
        self.edges()
            .filter(move |(a, b)| (a.y > y) != (b.y > y))
            .map(move |(a, b)| a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x))
    }

    /// Distance to the polygon in metres: 0 inside.
    pub fn distance_m(&self, p: &Point2<f64>) -> f64 {
        if self.contains(p) {
            return 0.0;
        }
        self.edges().map(|(a, b)| distance_to_segment(p, &a, &b)).fold(f64::INFINITY, f64::min)
    }

    /// The smallest and the largest corner of the axis-aligned box around the polygon.
    pub fn bounds(&self) -> (Point2<f64>, Point2<f64>) {
        let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
        let mut high = -low;
        for p in &self.0 {
            low = low.inf(p);
            high = high.sup(p);
        }
        (low, high)
    }

    /// The centroid of the corners.
    pub fn center(&self) -> Point2<f64> {
        let sum: Vector2<f64> = self.0.iter().map(|p| p.coords).sum();
        Point2::from(sum / self.0.len().max(1) as f64)
    }

    /// Draws a point uniformly from the polygon's area, by rejection from its bounds.
    ///
    /// A polygon of no area yields its centre.
    pub fn sample(&self, rng: &mut impl Rng) -> Point2<f64> {
        /// Attempts with which a polygon that fills a thousandth of its bounds is hit with probability 1 − e⁻¹⁰.
        const ATTEMPTS: usize = 10_000;
        let (low, high) = self.bounds();
        for _ in 0..ATTEMPTS {
            let (s, t): (f64, f64) = (rng.random(), rng.random());
            let p = Point2::new(low.x + s * (high.x - low.x), low.y + t * (high.y - low.y));
            if self.contains(&p) {
                return p;
            }
        }
        self.center()
    }
}

/// Tells whether the way from `a` over `b` to `c` reverses at `b`.
fn runs_back(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>) -> bool {
    let (onto, from) = (b - a, c - b);
    onto.perp(&from) == 0.0 && onto.dot(&from) <= 0.0
}

/// Whether two segments share a point, ends included.
pub(crate) fn segments_meet(a: Point2<f64>, b: Point2<f64>, c: Point2<f64>, d: Point2<f64>) -> bool {
    let side = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| {
        let turn = (q - p).perp(&(r - p));
        if turn == 0.0 { 0.0 } else { turn.signum() }
    };
    let within = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| r == r.sup(&p.inf(&q)).inf(&p.sup(&q));
    let sides = [side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)];
    (sides[0] * sides[1] < 0.0 && sides[2] * sides[3] < 0.0)
        || (sides[0] == 0.0 && within(a, b, c))
        || (sides[1] == 0.0 && within(a, b, d))
        || (sides[2] == 0.0 && within(c, d, a))
        || (sides[3] == 0.0 && within(c, d, b))
}

fn distance_to_segment(p: &Point2<f64>, a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let along = b - a;
    let t = if along.norm_squared() > 0.0 { (p - a).dot(&along) / along.norm_squared() } else { 0.0 };
    (p - (a + along * t.clamp(0.0, 1.0))).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_beyond_every_room_are_refused_with_the_range() {
        for far in [10_000.5, -(2.0_f64.powi(31)), 2.0_f64.powi(63), 1e308] {
            let mut corners = Polygon::rectangle(Point2::origin(), Point2::new(1.0, 1.0)).0;
            corners[2].y = far;
            let line = Polygon(corners).defect().unwrap();
            assert!(line.contains("corner 3 is") && line.contains("-10000 to 10000 metres"), "{line}");
        }
        let largest = Polygon::rectangle(Point2::new(-1e4, -1e4), Point2::new(1e4, 1e4));
        assert_eq!(largest.defect(), None);
    }
    use approx::assert_relative_eq;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    /// An L: the unit square twice as large, without its upper right quarter.
    fn corner() -> Polygon {
        Polygon(
            [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
                .map(|(x, y)| Point2::new(x, y))
                .to_vec(),
        )
    }

    #[test]
    fn a_concave_polygon_knows_its_inside_area_and_distance() {
        let l = corner();
        assert_relative_eq!(l.area(), 3.0);
        assert!(l.contains(&Point2::new(0.5, 1.5)) && !l.contains(&Point2::new(1.5, 1.5)));
        assert_relative_eq!(l.distance_m(&Point2::new(1.5, 1.3)), 0.3, epsilon = 1e-12);
        assert_relative_eq!(l.distance_m(&Point2::new(3.0, 0.5)), 1.0, epsilon = 1e-12);
        assert_relative_eq!(l.distance_m(&Point2::new(0.1, 0.1)), 0.0);
        assert_eq!(l.bounds(), (Point2::new(0.0, 0.0), Point2::new(2.0, 2.0)));
    }

    #[test]
    fn samples_are_uniform_over_the_area() {
        let (l, mut rng) = (corner(), Pcg64Mcg::seed_from_u64(3));
        let n = 30_000;
        let upper = (0..n)
            .map(|_| l.sample(&mut rng))
            .inspect(|p| assert!(l.contains(p)))
            .filter(|p| p.y > 1.0)
            .count();
        // A third of the area; the binomial's standard deviation is 0.0027.
        assert_relative_eq!(upper as f64 / n as f64, 1.0 / 3.0, epsilon = 0.015);
    }

    #[test]
    fn defects_are_told() {
        let line = Polygon(vec![Point2::new(0.0, 0.0), Point2::new(1.0, 1.0), Point2::new(2.0, 2.0)]);
        let nan = Polygon(vec![Point2::new(f64::NAN, 0.0), Point2::new(1.0, 1.0), Point2::new(2.0, 0.0)]);
        for bad in [Polygon(vec![]), line, nan] {
            assert!(bad.defect().is_some());
        }
        assert_eq!(corner().defect(), None);
    }

    #[test]
    fn outlines_that_cross_touch_or_run_back_are_not_simple() {
        let crossing = |corners: &[(f64, f64)]| {
            Polygon(corners.iter().map(|(x, y)| Point2::new(*x, *y)).collect()).crossing()
        };
        assert_eq!(corner().crossing(), None);
        assert_eq!(crossing(&[(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]), None);
        // A corner in the middle of a straight edge is no defect.
        assert_eq!(crossing(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (0.0, 1.0)]), None);
        let bow_tie = [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)];
        assert_eq!(crossing(&bow_tie), Some((0, 2)));
        // A corner on another edge; a corner twice; an edge there and back; edges that lie on each other.
        assert_eq!(crossing(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 0.0), (0.0, 1.0)]), Some((0, 2)));
        assert!(crossing(&[(0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)]).is_some());
        assert_eq!(crossing(&[(0.0, 0.0), (2.0, 0.0), (1.0, 0.0), (0.0, 1.0)]), Some((0, 1)));
        let on_each_other = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (2.0, 0.0), (1.0, 0.0), (0.0, 1.0)];
        assert!(crossing(&on_each_other).is_some());
    }

    proptest! {
        /// Corners in order around a point make a simple polygon; two of a circle exchanged, one that crosses itself.
        #[test]
        fn stars_are_simple_until_two_corners_are_exchanged(
            radii in prop::collection::vec(0.5..2.0, 5..12),
            first in 0_usize..5,
        ) {
            let turn = std::f64::consts::TAU / radii.len() as f64;
            let at = |i: usize, r: f64| Point2::new(r * (turn * i as f64).cos(), r * (turn * i as f64).sin());
            let star = radii.iter().enumerate().map(|(i, r)| at(i, *r)).collect();
            prop_assert_eq!(Polygon(star).crossing(), None);
            let mut circle: Vec<_> = (0..radii.len()).map(|i| at(i, 1.0)).collect();
            let n = circle.len();
            circle.swap(first, (first + 1) % n);
            prop_assert!(Polygon(circle).crossing().is_some());
        }
    }

    #[test]
    fn hulls_hold_their_points() {
        let hull = Polygon::convex_hull([&corner().0[..], &[Point2::new(1.0, 0.0)]].concat());
        assert_eq!(hull.0.len(), 5);
        assert_relative_eq!(hull.area(), 3.5);
        let square =
            Polygon::convex_hull((0..25).map(|i| Point2::new(f64::from(i % 5), f64::from(i / 5))).collect());
        assert_eq!(square.0.len(), 4);
        assert_relative_eq!(square.area(), 16.0);
    }

    #[test]
    fn hulls_of_what_has_no_area_have_fewer_than_three_corners() {
        assert!(Polygon::convex_hull(vec![]).0.is_empty());
        assert!(Polygon::convex_hull(vec![Point2::origin(); 3]).0.len() < 3);
        assert!(Polygon::convex_hull((0..4).map(|i| Point2::new(f64::from(i), 1.0)).collect()).0.len() < 3);
    }
}
