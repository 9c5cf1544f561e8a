//! Walls of a room as straight lines on the floor, to which drawn corners snap.
//!
//! A Hough transform (R. Duda, P. Hart, "Use of the Hough transformation to detect lines and curves in pictures", 1972)
//! over points of the upright surfaces. Their normals are known, so each votes for the directions near its own alone. The
//! line with the most votes is fitted to its points, cut where nothing stands, and its points are taken out, until no
//! line is long enough. Fronts of cupboards count as walls.

use std::collections::HashMap;
use std::f64::consts::PI;

use nalgebra::{Matrix2, Point2, SymmetricEigen, Vector2};
use serde::Serialize;

use crate::geometry::Geometry;
use crate::geometry::sample::each_sample;

/// Spacing of the points on the surfaces, metres.
const SPACING_M: f32 = 0.05;
/// Heights between which surfaces count: above skirtings and rubbish, below lamps. Metres.
const HEIGHTS_M: std::ops::Range<f32> = 0.3..2.2;
/// Largest vertical component of an upright surface's normal: 20° of noise.
const UPRIGHT_NORMAL_Z: f32 = 0.34;
/// Number of directions over 180°.
const DIRECTIONS: usize = 180;
/// Directions on each side of its normal for which a point votes.
const SPREAD: usize = 4;
/// Width of a line's votes, metres.
const OFFSET_M: f64 = 0.02;
/// Distance from a line within which points belong to it, metres.
const THICKNESS_M: f64 = 0.06;
/// Cosine of the largest angle between a line's normal and that of a point on it: 20°.
const SAME_DIRECTION: f64 = 0.94;
/// Length of the cells along a line in which there is wall, or only strays, metres.
const CELL_M: f64 = 0.1;
/// Gap that ends a wall, metres: a door is wider.
const GAP_M: f64 = 0.5;
/// Length below which a piece is no wall, metres.
const LEAST_LENGTH_M: f64 = 0.5;
/// Least height of surface over a wall's length, on average, metres.
const LEAST_HEIGHT_M: f64 = 0.3;
/// Largest number of walls.
const MOST_WALLS: usize = 100;
/// Extent of a room beyond which nothing votes, metres: strays must not exhaust memory.
const REACH_M: f64 = 500.0;
/// Distance from the ends of two walls to where their lines meet within which they are a corner, metres.
const CORNER_M: f64 = 0.3;

/// A straight wall, from end to end, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub(super) struct Wall(pub [Point2<f64>; 2]);

/// A point of an upright surface.
struct WallPoint {
    place: Point2<f64>,
    normal: Vector2<f64>,
    area_m2: f64,
}

impl WallPoint {
    /// Directions for which the point votes, as indices of normals over 180°, and its offsets along them.
    fn votes(&self) -> impl Iterator<Item = (usize, i64)> + '_ {
        let own =
            (self.normal.y.atan2(self.normal.x).rem_euclid(PI) / PI * DIRECTIONS as f64).round() as usize;
        (0..=2 * SPREAD).map(move |i| {
            let direction = (own + DIRECTIONS + i - SPREAD) % DIRECTIONS;
            (direction, (normal_of(direction).dot(&self.place.coords) / OFFSET_M).round() as i64)
        })
    }
}

fn normal_of(direction: usize) -> Vector2<f64> {
    let angle = PI * direction as f64 / DIRECTIONS as f64;
    Vector2::new(angle.cos(), angle.sin())
}

/// Walls of a geometry, the longest votes first.
pub(super) fn walls(geometry: &Geometry) -> Vec<Wall> {
    let mut points = points(geometry);
    let most = (REACH_M * std::f64::consts::SQRT_2 / OFFSET_M).ceil() as i64 + 1;
    let reach =
        points.iter().flat_map(WallPoint::votes).map(|(_, offset)| offset.abs()).max().unwrap_or(0).min(most)
            + 1;
    let columns = (2 * reach + 1) as usize;
    let mut votes_m2 = vec![0.0; DIRECTIONS * columns];
    let cell = |(direction, offset): (usize, i64)| direction * columns + (offset + reach) as usize;
    for point in &points {
        for vote in point.votes() {
            votes_m2[cell(vote)] += point.area_m2;
        }
    }
    let mut walls = Vec::new();
    while walls.len() < MOST_WALLS {
        let best = (0..votes_m2.len()).max_by(|a, b| votes_m2[*a].total_cmp(&votes_m2[*b]));
        let Some(best) = best.filter(|i| votes_m2[*i] > 0.5 * LEAST_LENGTH_M * LEAST_HEIGHT_M) else { break };
        let normal = normal_of(best / columns);
        let offset_m = ((best % columns) as i64 - reach) as f64 * OFFSET_M;
        let (on_line, others) = points.into_iter().partition::<Vec<_>, _>(|point| {
            (normal.dot(&point.place.coords) - offset_m).abs() <= THICKNESS_M
                && point.normal.dot(&normal).abs() >= SAME_DIRECTION
        });
        points = others;
        if on_line.is_empty() {
            // Votes without points, left by rounding.
            votes_m2[best] = 0.0;
            continue;
        }
        for point in &on_line {
            for vote in point.votes() {
                votes_m2[cell(vote)] -= point.area_m2;
            }
        }
        walls.extend(pieces(on_line, normal));
    }
    join_corners(&mut walls);
    walls
}

fn points(geometry: &Geometry) -> Vec<WallPoint> {
    let mut points = Vec::new();
    each_sample(geometry, SPACING_M, &mut |p, normal, area| {
        let place = Point2::new(f64::from(p.x), f64::from(p.y));
        let flat = Vector2::new(f64::from(normal.x), f64::from(normal.y));
        let is_upright = normal.z.abs() <= UPRIGHT_NORMAL_Z && HEIGHTS_M.contains(&p.z);
        if is_upright && place.coords.amax() < REACH_M {
            points.push(WallPoint { place, normal: flat.normalize(), area_m2: f64::from(area) });
        }
    });
    points
}

/// Pieces of a line where enough stands along it.
fn pieces(mut points: Vec<WallPoint>, normal: Vector2<f64>) -> Vec<Wall> {
    let along = Vector2::new(-normal.y, normal.x);
    let share = |point: &WallPoint| along.dot(&point.place.coords);
    let cell = |point: &WallPoint| (share(point) / CELL_M).floor() as i64;
    let mut areas_m2: HashMap<i64, f64> = HashMap::new();
    for point in &points {
        *areas_m2.entry(cell(point)).or_default() += point.area_m2;
    }
    points.retain(|point| areas_m2[&cell(point)] >= 0.5 * CELL_M * LEAST_HEIGHT_M);
    points.sort_by(|a, b| share(a).total_cmp(&share(b)));
    let follows = |a: &WallPoint, b: &WallPoint| share(b) - share(a) <= GAP_M;
    points.chunk_by(follows).filter_map(fitted).collect()
}

/// Line of least squares through points, between the first and the last.
fn fitted(points: &[WallPoint]) -> Option<Wall> {
    let area_m2: f64 = points.iter().map(|p| p.area_m2).sum();
    let middle = points.iter().map(|p| p.place.coords * p.area_m2).sum::<Vector2<f64>>() / area_m2;
    let moment: Matrix2<f64> = points
        .iter()
        .map(|p| p.place.coords - middle)
        .zip(points)
        .map(|(d, p)| d * d.transpose() * p.area_m2)
        .sum();
    let eigen = SymmetricEigen::new(moment);
    let along = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into_owned();
    let shares = points.iter().map(|p| along.dot(&(p.place.coords - middle)));
    let (low, high) = shares.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), s| (l.min(s), h.max(s)));
    let is_wall = high - low >= LEAST_LENGTH_M && area_m2 >= LEAST_HEIGHT_M * (high - low);
    is_wall.then(|| Wall([low, high].map(|share| Point2::from(middle + along * share))))
}

/// Moves ends of walls that meet at a corner into it.
fn join_corners(walls: &mut [Wall]) {
    for i in 0..walls.len() {
        for j in i + 1..walls.len() {
            let Some(corner) = meeting(&walls[i], &walls[j]) else { continue };
            let near = [i, j].map(|wall| walls[wall].0.map(|end| (end - corner).norm()));
            let end = near.map(|[first, last]| usize::from(last < first));
            if near[0][end[0]] <= CORNER_M && near[1][end[1]] <= CORNER_M {
                walls[i].0[end[0]] = corner;
                walls[j].0[end[1]] = corner;
            }
        }
    }
}

/// Place where the lines of two walls meet; `None` for nearly parallel ones.
fn meeting(Wall([a, b]): &Wall, Wall([c, d]): &Wall) -> Option<Point2<f64>> {
    let (first, second) = ((b - a).normalize(), (d - c).normalize());
    let sine = first.perp(&second);
    (sine.abs() > 0.3).then(|| a + first * ((c - a).perp(&second) / sine))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{push_box, scene};
    use super::*;
    use crate::geometry::{Disc, Mesh};
    use glam::Vec3;
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, Normal};
    use rand_pcg::Pcg64Mcg;

    /// Tells whether a wall goes from one place to the other, to a tolerance in metres.
    fn goes(wall: &Wall, from: (f64, f64), to: (f64, f64), tolerance: f64) -> bool {
        let near = |p: Point2<f64>, (x, y): (f64, f64)| (p - Point2::new(x, y)).norm() <= tolerance;
        let [a, b] = wall.0;
        (near(a, from) && near(b, to)) || (near(b, from) && near(a, to))
    }

    #[test]
    fn the_sides_of_a_box_are_walls_that_meet_in_its_corners() {
        let geometry = scene(&[(Vec3::new(1.0, 2.0, 0.0), Vec3::new(4.0, 3.0, 2.5))]);
        let walls = walls(&geometry);
        let corners = [(1.0, 2.0), (4.0, 2.0), (4.0, 3.0), (1.0, 3.0)];
        for (i, from) in corners.iter().enumerate() {
            let to = corners[(i + 1) % 4];
            assert!(walls.iter().any(|wall| goes(wall, *from, to, 0.02)), "{from:?} {to:?} in {walls:?}");
        }
        assert_eq!(walls.len(), 4, "{walls:?}");
    }

    #[test]
    fn low_and_lying_things_are_no_walls() {
        let mut mesh = Mesh::default();
        push_box(&mut mesh, Vec3::new(-2.0, -2.0, 0.0), Vec3::new(2.0, 2.0, 0.25));
        push_box(&mut mesh, Vec3::new(-2.0, -2.0, 2.3), Vec3::new(2.0, 2.0, 2.5));
        assert_eq!(walls(&Geometry::Mesh(mesh)), []);
        assert_eq!(walls(&Geometry::Discs(Vec::new())), []);
    }

    /// Discs with a noise of 1 cm and 5° on two oblique walls, one of them with a door of a metre; furniture at random.
    #[test]
    fn noisy_walls_are_found_and_cut_at_doors() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        let (place, tilt) = (Normal::new(0.0, 0.01).unwrap(), Normal::new(0.0, 0.09).unwrap());
        let mut discs = Vec::new();
        let mut disc = |center: Vec3, normal: Vec3, rng: &mut Pcg64Mcg| {
            let noise = |d: &Normal<f64>, rng: &mut Pcg64Mcg| {
                Vec3::from_array([(); 3].map(|()| d.sample(rng) as f32))
            };
            let center = center + noise(&place, rng);
            let normal = (normal + noise(&tilt, rng)).normalize();
            discs.push(Disc { center, normal, radius: 0.02, color: [0; 3], filled: false, confidence: 1.0 });
        };
        let along = Vec3::new(0.6, 0.8, 0.0);
        let across = Vec3::new(-0.8, 0.6, 0.0);
        for i in 0..100 {
            for j in 0..40 {
                let (s, z) = (i as f32 * 0.04, 0.1 + j as f32 * 0.05);
                if !(1.5..2.5).contains(&s) {
                    disc(along * s + Vec3::Z * z, across, &mut rng);
                }
                disc(across * s + Vec3::Z * z, along, &mut rng);
            }
        }
        for _ in 0..2000 {
            let [x, y, z, nx, ny] = [(); 5].map(|()| rng.random::<f32>());
            let center = Vec3::new(4.0 * x - 1.0, 1.0 + 3.0 * y, 1.5 * z);
            disc(center, Vec3::new(nx - 0.5, ny - 0.5, 0.01), &mut rng);
        }
        let walls = walls(&Geometry::Discs(discs));
        for (from, to) in [
            ((0.0, 0.0), (0.6 * 1.48, 0.8 * 1.48)),
            ((0.6 * 2.52, 0.8 * 2.52), (0.6 * 3.96, 0.8 * 3.96)),
            ((0.0, 0.0), (-0.8 * 3.96, 0.6 * 3.96)),
        ] {
            assert!(walls.iter().any(|wall| goes(wall, from, to, 0.06)), "{from:?} {to:?} in {walls:?}");
        }
        assert!(walls.len() <= 5, "{walls:?}");
    }
}
