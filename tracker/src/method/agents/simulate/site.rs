//! Simulated stations: their places, views and overlaps, and walls.

use std::f64::consts::TAU;

use nalgebra::{Point2, Rotation2, Vector2, point, vector};

use super::super::{FieldOfView, StationId};
use super::{Layout, Options};

/// Radius of the circle on which the stations of a hall stand, metres.
pub(super) const HALL_RADIUS_M: f64 = 10.0;
/// Distance between neighbouring stations of a corridor along its middle, metres.
const SPACING_M: f64 = 8.0;
/// Range of a station of a corridor, metres: its view overlaps those of two neighbours on each side.
const CORRIDOR_RANGE_M: f64 = 9.0;
/// Half of a corridor's width, metres.
pub(super) const HALF_WIDTH_M: f64 = 4.0;
/// Spacing of the grid on which overlaps of views are sampled, metres.
const GRID_M: f64 = 0.5;

/// Simulated camera of a station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedStation {
    /// Place of the camera, metres.
    pub position: Point2<f64>,
    /// Direction of view, unit length.
    pub heading: Vector2<f64>,
    /// Half of the opening angle, degrees; 180 sees all around.
    pub half_opening_deg: f64,
    /// Range, metres; may be infinite.
    pub range_m: f64,
}

impl SimulatedStation {
    fn sees(&self, place: Point2<f64>) -> bool {
        let ray = place - self.position;
        let distance = ray.norm();
        distance <= self.range_m
            && (self.half_opening_deg >= 180.0
                || ray.dot(&self.heading) >= self.half_opening_deg.to_radians().cos() * distance)
    }
}

/// Both ends of a wall, metres.
pub type Wall = [Point2<f64>; 2];

/// Stations and walls, the same in all trials.
#[derive(Debug, Clone, PartialEq)]
pub struct Site {
    /// The stations, by [`StationId`].
    pub stations: Vec<SimulatedStation>,
    /// Walls, which occlude people and block their ways.
    pub walls: Vec<Wall>,
    /// Radius of the circle of stations, metres; in a corridor that of the middle of the ring.
    pub radius_m: f64,
    /// For each station the indices of those with overlapping views, ascending.
    overlapping: Vec<Vec<usize>>,
    /// For each station the indices of those whose packets it receives, ascending.
    heard: Vec<Vec<usize>>,
}

impl Site {
    /// Creates the stations and walls of a layout.
    pub fn new(options: &Options) -> Self {
        let count = options.stations;
        let (radius_m, half_opening_deg, range_m) = match options.layout {
            Layout::Corridor => (SPACING_M * count as f64 / TAU, 180.0, CORRIDOR_RANGE_M),
            _ if options.has_partial_views => (HALL_RADIUS_M, 40.0, 16.0),
            _ => (HALL_RADIUS_M, 180.0, f64::INFINITY),
        };
        let stations: Vec<SimulatedStation> = (0..count)
            .map(|i| {
                let out = Rotation2::new(TAU * (i as f64 / count as f64 + 1.0 / 12.0)) * vector![1.0, 0.0];
                let position = Point2::from(out * radius_m);
                SimulatedStation { position, heading: -out, half_opening_deg, range_m }
            })
            .collect();
        let walls = if options.has_partial_views { hall_walls() } else { Vec::new() };
        let mut site =
            Self { stations, walls, radius_m, overlapping: vec![Vec::new(); count], heard: Vec::new() };
        for a in 0..count {
            for b in 0..a {
                if site.views_meet(a, b) {
                    site.overlapping[a].push(b);
                    site.overlapping[b].push(a);
                }
            }
        }
        site.overlapping.iter_mut().for_each(|o| o.sort_unstable());
        site.heard = (0..count).map(|a| site.nearest(a, options.neighbours)).collect();
        site
    }

    /// Stations whose packets a station receives: the nearest of those with overlapping views, ascending.
    pub fn heard_by(&self, station: usize) -> &[usize] {
        &self.heard[station]
    }

    /// Whether a station sees a place.
    pub fn sees(&self, station: usize, place: Point2<f64>) -> bool {
        let camera = &self.stations[station];
        camera.sees(place) && !self.walls.iter().any(|wall| is_crossed(wall, camera.position, place))
    }

    fn nearest(&self, station: usize, count: Option<usize>) -> Vec<usize> {
        let mut others = self.overlapping[station].clone();
        let distance =
            |other: usize| (self.stations[other].position - self.stations[station].position).norm();
        others.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)).then(a.cmp(b)));
        others.truncate(count.unwrap_or(usize::MAX));
        others.sort_unstable();
        others
    }

    fn views_meet(&self, a: usize, b: usize) -> bool {
        let (from, to) = (self.stations[a].position, self.stations[b].position);
        let range_m = self.stations[a].range_m + self.stations[b].range_m;
        if !range_m.is_finite() {
            return true;
        }
        if (to - from).norm() > range_m {
            return false;
        }
        let reach = (self.stations[a].range_m / GRID_M) as i32;
        (-reach..=reach)
            .flat_map(|i| (-reach..=reach).map(move |j| from + vector![f64::from(i), f64::from(j)] * GRID_M))
            .any(|place| self.sees(a, place) && self.sees(b, place))
    }
}

impl FieldOfView for Site {
    fn visible(&self, station: StationId, place: Point2<f64>, _height_m: f64) -> f64 {
        let station = usize::from(station.0);
        if station < self.stations.len() && self.sees(station, place) { 1.0 } else { 0.0 }
    }

    fn overlap(&self, a: StationId, b: StationId) -> bool {
        self.overlapping.get(usize::from(a.0)).is_some_and(|o| o.binary_search(&usize::from(b.0)).is_ok())
    }
}

/// Creates four walls around the middle of the hall.
fn hall_walls() -> Vec<Wall> {
    (0..4)
        .map(|i| {
            let turn = Rotation2::new(TAU * (f64::from(i) / 4.0 + 0.05));
            [turn * point![3.5, -1.5], turn * point![3.5, 1.5]]
        })
        .collect()
}

/// Whether the straight way between two places crosses a wall.
pub(super) fn is_crossed(wall: &Wall, from: Point2<f64>, to: Point2<f64>) -> bool {
    let (way, along) = (to - from, wall[1] - wall[0]);
    let side = |p: Point2<f64>| along.perp(&(p - wall[0])) > 0.0;
    let wall_side = |p: Point2<f64>| way.perp(&(p - from)) > 0.0;
    side(from) != side(to) && wall_side(wall[0]) != wall_side(wall[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stations_of_a_hall_see_everything() {
        let site = Site::new(&Options::published(Layout::Once));
        for station in 0..6 {
            assert!(site.sees(station, point![0.0, 0.0]) && site.sees(station, point![-9.0, 9.0]));
            assert_eq!(site.heard_by(station).len(), 5);
            assert!((site.stations[station].position.coords.norm() - 10.0).abs() < 1e-12);
        }
    }

    #[test]
    fn walls_hide_and_sectors_end() {
        let site = Site::new(&Options::hard());
        for station in 0..site.stations.len() {
            let camera = site.stations[station];
            assert!(!site.sees(station, camera.position - camera.heading), "behind the camera");
            let hidden = site.walls.iter().any(|wall| {
                let middle = nalgebra::center(&wall[0], &wall[1]);
                let behind = middle + (middle - camera.position).normalize() * 0.3;
                camera.sees(behind) && !site.sees(station, behind)
            });
            assert!(hidden, "station {station}");
        }
    }

    #[test]
    fn a_corridor_has_the_same_overlap_at_any_length() {
        for stations in [10, 50, 200] {
            let site = Site::new(&Options::corridor(stations, 2 * stations));
            for station in 0..stations {
                assert_eq!(site.heard_by(station).len(), 4, "{stations} stations");
            }
        }
    }
}
