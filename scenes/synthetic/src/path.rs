//! People's paths: from a door through waypoints to a door, around furniture and around each other.
//!
//! People are planned one after the other by A* in space and time, so that each finds a way around those planned before
//! (D. Silver, "Cooperative pathfinding", AIIDE 2005); lattice corners are then smoothed away.

use glam::Vec2;
use nalgebra::{Point2, Vector2};
use pathfinding::directed::astar::astar;

use super::floor::{CELL_M, FloorCell, FreeFloor};
use super::gait::WalkedLine;

/// Time of a planning step.
pub(super) const PLAN_STEP_S: f64 = 0.25;
/// Distance between people's middles in the plan.
const APART_M: f64 = 0.8;
/// Cost of one step, within which a person has reached the goal.
const ARRIVED: u32 = 250;
/// Longest way from stop to stop, in planning steps.
const LONGEST_STEPS: usize = 320;
/// Time between the samples of a finished trajectory.
const SAMPLE_S: f64 = 0.025;
/// Standard deviation in time of the filter that rounds corners.
const SMOOTHING_S: f64 = 0.3;

/// Place of a person over time.
#[derive(Debug, Clone)]
pub(super) struct Trajectory {
    start_s: f64,
    /// Place every `SAMPLE_S` seconds.
    places: Vec<Point2<f64>>,
    /// Distance walked until each sample, metres.
    way_m: Vec<f64>,
}

/// A stop on a person's way.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stop {
    pub place: Point2<f64>,
    /// Duration of the stay.
    pub stay_s: f64,
}

/// A person's planned path: the step at which they appear and their place at each planning step.
pub(super) type PlannedPath = (usize, Vec<Point2<f64>>);

/// Plans a person's places from a step on; `None` if there is no way that keeps off everybody else.
pub(super) fn plan(
    floor: &FreeFloor,
    others: &[PlannedPath],
    first_step: usize,
    stops: &[Stop],
    speed_m_s: f64,
) -> Option<PlannedPath> {
    let moves = moves(speed_m_s);
    let is_apart = |cell: FloorCell, step: usize| {
        let p = floor.center(cell);
        others.iter().all(|(start, places)| {
            let there = step.checked_sub(*start).and_then(|i| places.get(i));
            there.is_none_or(|q| (p - q).norm() > APART_M)
        })
    };
    let mut cells = vec![floor.cell(&stops.first()?.place)];
    // Without any way through the empty room, the search in time would take long.
    let reachable = floor.reachable(&stops.first()?.place);
    for stop in stops.iter().skip(1) {
        let goal = floor.cell(&stop.place);
        let arrived = |&(cell, _): &(FloorCell, usize)| distance(cell, goal) <= ARRIVED;
        let from = (*cells.last()?, first_step + cells.len() - 1);
        let latest = from.1 + LONGEST_STEPS;
        // Nor is there a way where people stand around the goal until the latest step.
        let around: Vec<FloorCell> = reachable.iter().filter(|cell| arrived(&(**cell, 0))).copied().collect();
        let is_open = |step| around.iter().any(|cell| is_apart(*cell, step));
        if around.is_empty() || !arrived(&from) && !(from.1 + 1..=latest).any(is_open) {
            return None;
        }
        let successors = |&(cell, step): &(FloorCell, usize)| {
            let allowed = step < latest;
            let next = moves
                .iter()
                .filter(move |_| allowed)
                .map(move |(di, dj, cost)| ((cell.0 + di, cell.1 + dj), step + 1, *cost));
            let fitting = next.filter(|(to, step, _)| {
                floor.is_free(*to)
                    && is_apart(*to, *step)
                    && floor.is_clear(&floor.center(cell), &floor.center(*to))
            });
            fitting.map(|(to, step, cost)| ((to, step), cost)).collect::<Vec<_>>()
        };
        let left = |&(cell, _): &(FloorCell, usize)| distance(cell, goal).saturating_sub(ARRIVED);
        let (found, _) = astar(&from, successors, left, arrived)?;
        cells.extend(found.into_iter().skip(1).map(|(cell, _)| cell));
        let here = *cells.last()?;
        for _ in 0..(stop.stay_s / PLAN_STEP_S) as usize {
            let step = first_step + cells.len();
            if !is_apart(here, step) {
                break;
            }
            cells.push(here);
        }
    }
    let places = cells.into_iter().map(|cell| floor.center(cell)).collect();
    Some((first_step, places))
}

/// Cost of the straight way between two cells: a hundred a cell, rounded down, so that it never overestimates.
fn distance(a: FloorCell, b: FloorCell) -> u32 {
    (100.0 * f64::from(a.0 - b.0).hypot(f64::from(a.1 - b.1))) as u32
}

/// Moves of one planning step: going about as far as the speed allows, going slowly, waiting.
fn moves(speed_m_s: f64) -> Vec<(i16, i16, u32)> {
    let reach = speed_m_s * PLAN_STEP_S / CELL_M;
    let limit = reach.ceil() as i16 + 1;
    let square = (-limit..=limit).flat_map(|i| (-limit..=limit).map(move |j| (i, j)));
    square
        .filter_map(|(i, j)| {
            let length = f64::from(i).hypot(f64::from(j));
            // Slow steps cost more than their length, so that people walk briskly where they can.
            let cost = 100.0 * length + 12.0 * (reach - length).max(0.0);
            (length <= reach + 0.5).then_some((i, j, cost.ceil() as u32))
        })
        .collect()
}

impl Trajectory {
    /// Smooths a plan.
    pub(super) fn new((first_step, places): &PlannedPath) -> Self {
        let duration_s = (places.len().saturating_sub(1)) as f64 * PLAN_STEP_S;
        let count = (duration_s / SAMPLE_S).round() as usize + 1;
        let linear = |time_s: f64| {
            let at = (time_s / PLAN_STEP_S).clamp(0.0, places.len() as f64 - 1.0);
            let i = (at as usize).min(places.len().saturating_sub(2));
            let next = places[(i + 1).min(places.len() - 1)];
            places[i] + (next - places[i]) * (at - i as f64)
        };
        // Beyond the ends the line continues as its mirror image, so that the ends stay in place.
        let reach = (3.0 * SMOOTHING_S / SAMPLE_S) as i64;
        let mirrored = |time_s: f64| match time_s {
            t if t < 0.0 => places[0] + (places[0] - linear(-t)),
            t if t > duration_s => {
                let last = linear(duration_s);
                last + (last - linear(2.0 * duration_s - t))
            }
            t => linear(t),
        };
        let weights: Vec<f64> =
            (-reach..=reach).map(|k| (-0.5 * (k as f64 * SAMPLE_S / SMOOTHING_S).powi(2)).exp()).collect();
        let total: f64 = weights.iter().sum();
        let smooth: Vec<Point2<f64>> = (0..count)
            .map(|i| {
                let sum: Vector2<f64> = (-reach..=reach)
                    .zip(&weights)
                    .map(|(k, w)| mirrored((i as i64 + k) as f64 * SAMPLE_S).coords * *w)
                    .sum();
                Point2::from(sum / total)
            })
            .collect();
        let mut way_m = vec![0.0];
        for pair in smooth.windows(2) {
            way_m.push(way_m[way_m.len() - 1] + (pair[1] - pair[0]).norm());
        }
        Self { start_s: *first_step as f64 * PLAN_STEP_S, places: smooth, way_m }
    }

    /// First and last moment, seconds.
    pub(super) fn span_s(&self) -> (f64, f64) {
        (self.start_s, self.start_s + (self.places.len() - 1) as f64 * SAMPLE_S)
    }

    /// Place, metres walked and speed at a moment; `None` before the first and after the last.
    pub(super) fn at_time(&self, time_s: f64) -> Option<(Point2<f64>, f64, f64)> {
        let at = (time_s - self.start_s) / SAMPLE_S;
        if !(0.0..=(self.places.len() - 1) as f64).contains(&at) {
            return None;
        }
        let i = (at as usize).min(self.places.len().saturating_sub(2));
        let j = (i + 1).min(self.places.len() - 1);
        let t = at - i as f64;
        let place = self.places[i] + (self.places[j] - self.places[i]) * t;
        let way = self.way_m[i] + (self.way_m[j] - self.way_m[i]) * t;
        Some((place, way, (self.way_m[j] - self.way_m[i]) / SAMPLE_S))
    }

    /// Place after a distance, straight on beyond the ends.
    fn at_way(&self, way_m: f64) -> Point2<f64> {
        let last = self.places.len() - 1;
        let total = self.way_m[last];
        let along = |from: Point2<f64>, to: Point2<f64>| (to - from).try_normalize(1e-9).unwrap_or_default();
        if way_m <= 0.0 {
            let ahead = self.places[self.way_m.partition_point(|w| *w < 0.1).min(last)];
            return self.places[0] + along(self.places[0], ahead) * way_m;
        }
        if way_m >= total {
            let behind = self.places[self.way_m.partition_point(|w| *w < total - 0.1).min(last)];
            return self.places[last] + along(behind, self.places[last]) * (way_m - total);
        }
        let j = self.way_m.partition_point(|w| *w < way_m).clamp(1, last);
        let step = self.way_m[j] - self.way_m[j - 1];
        let t = if step > 0.0 { (way_m - self.way_m[j - 1]) / step } else { 0.0 };
        self.places[j - 1] + (self.places[j] - self.places[j - 1]) * t
    }
}

impl WalkedLine for Trajectory {
    fn at(&self, way_m: f32) -> (Vec2, Vec2) {
        /// Length of the chord whose direction is taken: people do not turn on the spot in an instant.
        const CHORD_M: f64 = 0.36;
        let way_m = f64::from(way_m);
        let single = |p: Point2<f64>| Vec2::new(p.x as f32, p.y as f32);
        let place = single(self.at_way(way_m));
        let chord = single(self.at_way(way_m + 0.5 * CHORD_M)) - single(self.at_way(way_m - 0.5 * CHORD_M));
        (place, chord.normalize_or(Vec2::X))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn hall() -> FreeFloor {
        FreeFloor::new(Vec3::new(8.0, 5.0, 3.0), &[], &[], 0.3)
    }

    fn stop(x: f64, y: f64) -> Stop {
        Stop { place: Point2::new(x, y), stay_s: 0.0 }
    }

    #[test]
    fn alone_one_walks_nearly_straight_at_the_speed_asked_for() {
        let plan = plan(&hall(), &[], 4, &[stop(0.6, 0.6), stop(7.3, 4.1)], 1.2).unwrap();
        let trajectory = Trajectory::new(&plan);
        let (start, end) = trajectory.span_s();
        let straight = 6.7_f64.hypot(3.5);
        let walked = *trajectory.way_m.last().unwrap();
        assert!((start - 1.0).abs() < 1e-9);
        assert!(walked < 1.06 * straight && walked > straight - 0.4, "{walked} m instead of {straight}");
        let speed = walked / (end - start);
        assert!((speed - 1.2).abs() < 0.2, "{speed}");
        assert!(trajectory.at_time(start - 0.01).is_none() && trajectory.at_time(end + 0.01).is_none());
    }

    #[test]
    fn people_who_meet_head_on_walk_around_each_other() {
        let floor = hall();
        let first = plan(&floor, &[], 0, &[stop(0.6, 2.5), stop(7.3, 2.5)], 1.2).unwrap();
        let second =
            plan(&floor, std::slice::from_ref(&first), 0, &[stop(7.3, 2.5), stop(0.6, 2.5)], 1.2).unwrap();
        let (a, b) = (Trajectory::new(&first), Trajectory::new(&second));
        let gap = (0..400)
            .filter_map(|i| {
                let t = f64::from(i) * 0.02;
                Some((a.at_time(t)?.0 - b.at_time(t)?.0).norm())
            })
            .fold(f64::MAX, f64::min);
        assert!(gap > 0.55 && gap < 2.0, "they pass at {gap} m");
    }

    #[test]
    fn the_way_is_continuous_and_goes_on_beyond_its_ends() {
        let stops = [stop(0.6, 0.6), Stop { stay_s: 2.0, ..stop(4.0, 4.0) }, stop(7.3, 0.8)];
        let trajectory = Trajectory::new(&plan(&hall(), &[], 0, &stops, 1.1).unwrap());
        let total = *trajectory.way_m.last().unwrap() as f32;
        let count = 3000;
        let mut last: Option<(Vec2, Vec2)> = None;
        for i in 0..=count {
            let way = -1.0 + (total + 2.0) * i as f32 / count as f32;
            let (place, direction) = trajectory.at(way);
            if let Some((before, turned)) = last {
                let step = (total + 2.0) / count as f32;
                assert!((place - before).length() < 1.05 * step + 1e-4);
                assert!(
                    direction.angle_to(turned).abs() < 0.2,
                    "turns {} at once",
                    direction.angle_to(turned)
                );
            }
            last = Some((place, direction));
        }
    }

    #[test]
    fn a_place_where_somebody_stands_is_gone_to_when_they_leave() {
        let floor = hall();
        // The first stands at the goal for 50 s, or for longer than anybody waits.
        let until = |stay_s| {
            let standing = [stop(4.0, 2.5), Stop { stay_s, ..stop(4.2, 2.5) }, stop(7.3, 4.0)];
            let first = plan(&floor, &[], 0, &standing, 1.2).unwrap();
            plan(&floor, &[first], 0, &[stop(0.6, 2.5), stop(4.2, 2.5)], 1.2)
        };
        let (_, places) = until(50.0).unwrap();
        assert!((190..=220).contains(&places.len()), "{} steps", places.len());
        assert!(until(100.0).is_none());
    }

    #[test]
    fn without_a_way_there_is_no_plan() {
        assert!(plan(&hall(), &[], 0, &[stop(0.6, 0.6), stop(20.0, 0.6)], 1.0).is_none());
        assert!(plan(&hall(), &[], 0, &[], 1.0).is_none());
    }
}
