//! Geometry of borders: signed distances to areas and lines, and the places at which a path meets them.

use nalgebra::{Point2, Vector2};
use scenes::polygon::Polygon;
use scenes::room::{Line, Room};

/// Resolution of the search for an area's deepest place: cells along the longer side of its bounds.
const DEPTH_CELLS: u32 = 48;

/// A position relative to a border.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Offset {
    /// Distance from the border, metres: positive on the inner side.
    pub signed_m: f64,
    /// Direction across the border at its nearest place; a unit vector, or zero on the border itself.
    pub across: Vector2<f64>,
}

/// A zone or a region. Zones with the same name are one area.
#[derive(Debug, Clone)]
pub(super) struct Area {
    pub name: String,
    polygons: Vec<Polygon>,
    /// Duration after which a stay is an event, seconds.
    pub dwell_s: Option<f64>,
    /// Largest distance of an inner place from the border, metres.
    pub depth_m: f64,
}

impl Area {
    /// Zones, then regions, in file order.
    pub(super) fn of_room(room: &Room) -> Vec<Self> {
        let mut areas: Vec<Self> = Vec::new();
        for zone in &room.zones {
            if let Some(same) = areas.iter_mut().find(|area| area.name == zone.name) {
                same.polygons.push(zone.polygon.clone());
                same.depth_m = same.deepest_m();
            } else {
                areas.push(Self::new(&zone.name, zone.polygon.clone(), None));
            }
        }
        areas.extend(room.regions.iter().map(|r| Self::new(&r.name, r.polygon.clone(), r.dwell_s)));
        areas
    }

    fn new(name: &str, polygon: Polygon, dwell_s: Option<f64>) -> Self {
        let mut area = Self { name: name.to_owned(), polygons: vec![polygon], dwell_s, depth_m: 0.0 };
        area.depth_m = area.deepest_m();
        area
    }

    /// Offset of a position from the area's border.
    pub(super) fn offset(&self, place: &Point2<f64>) -> Offset {
        let each = self.polygons.iter().map(|polygon| {
            let (distance_m, across) = nearest(place, polygon.edges());
            let signed_m = if polygon.contains(place) { distance_m } else { -distance_m };
            Offset { signed_m, across }
        });
        // The distance to a union is at least the largest one; exact outside, and inside while its parts do not overlap.
        each.max_by(|a, b| a.signed_m.total_cmp(&b.signed_m))
            .unwrap_or(Offset { signed_m: f64::NEG_INFINITY, across: Vector2::zeros() })
    }

    fn deepest_m(&self) -> f64 {
        let of_polygon = |polygon: &Polygon| {
            let (low, high) = polygon.bounds();
            let step = (high - low).max() / f64::from(DEPTH_CELLS);
            let cells = (0..DEPTH_CELLS).flat_map(|i| (0..DEPTH_CELLS).map(move |j| (i, j)));
            let centers =
                cells.map(|(i, j)| low + Vector2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) * step);
            centers.map(|p| self.offset(&p).signed_m).fold(0.0, f64::max)
        };
        self.polygons.iter().map(of_polygon).fold(0.0, f64::max)
    }
}

/// Distance of a position from a line, metres, and the direction across the line there.
pub(super) fn offset_from_line(line: &Line, place: &Point2<f64>) -> Offset {
    let (signed_m, across) = nearest(place, line.pieces());
    Offset { signed_m, across }
}

/// A place at which a path meets a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meeting {
    /// Share of the path before the place, 0 to 1.
    pub share: f64,
    /// Whether the path goes from the line's left to its right.
    pub is_inward: bool,
}

/// Places at which the straight path between two positions meets a line, in the path's order. A path through a point
/// of the line meets one of the two pieces that share it.
pub(super) fn meetings(line: &Line, from: &Point2<f64>, to: &Point2<f64>) -> Vec<Meeting> {
    let way = to - from;
    let mut found: Vec<Meeting> = line
        .pieces()
        .filter_map(|(a, b)| {
            let piece = b - a;
            // Left of a piece is positive. Zero belongs to the left, so that every place has one side.
            let (before, after) = (piece.perp(&(from - a)), piece.perp(&(to - a)));
            let (first, second) = (way.perp(&(a - from)), way.perp(&(b - from)));
            let is_met = (before >= 0.0) != (after >= 0.0) && (first >= 0.0) != (second >= 0.0);
            is_met.then(|| Meeting { share: before / (before - after), is_inward: before >= 0.0 })
        })
        .collect();
    found.sort_by(|a, b| a.share.total_cmp(&b.share));
    found
}

/// Distance to the nearest of some segments, and the unit vector from there to the place.
fn nearest(
    place: &Point2<f64>,
    segments: impl Iterator<Item = (Point2<f64>, Point2<f64>)>,
) -> (f64, Vector2<f64>) {
    let away = segments.map(|(a, b)| {
        let along = b - a;
        let length2 = along.norm_squared();
        let share = if length2 > 0.0 { ((place - a).dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
        place - (a + along * share)
    });
    let nearest = away.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    let nearest = nearest.unwrap_or_else(|| Vector2::repeat(f64::INFINITY));
    let distance_m = nearest.norm();
    (distance_m, if distance_m > 0.0 { nearest / distance_m } else { Vector2::zeros() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;
    use scenes::room::{Region, Zone, ZoneKind};

    fn rectangle(x: f64) -> Polygon {
        Polygon::rectangle(Point2::new(x, 0.0), Point2::new(x + 4.0, 2.0))
    }

    #[test]
    fn areas_know_their_depth_and_zones_of_one_name_are_one() {
        let zone = |name: &str, x| Zone { name: name.into(), polygon: rectangle(x), kind: ZoneKind::Both };
        let room = Room {
            zones: vec![zone("door", 0.0), zone("gate", 20.0), zone("door", 10.0)],
            regions: vec![Region { name: "shelf".into(), polygon: rectangle(5.0), dwell_s: Some(3.0) }],
            ..Room::default()
        };
        let areas = Area::of_room(&room);
        let names: Vec<&str> = areas.iter().map(|area| area.name.as_str()).collect();
        assert_eq!(names, ["door", "gate", "shelf"]);
        assert_relative_eq!(areas[2].depth_m, 1.0, epsilon = 0.05);
        for (x, signed_m) in [(1.0, 0.5), (10.3, 0.3), (-0.2, -0.2), (7.0, -3.0)] {
            assert_relative_eq!(areas[0].offset(&Point2::new(x, 0.5)).signed_m, signed_m, epsilon = 1e-12);
        }
        let outside = areas[0].offset(&Point2::new(2.0, 2.5));
        assert_relative_eq!(outside.across, Vector2::y(), epsilon = 1e-12);
    }

    #[test]
    fn inward_is_from_left_to_right_walking_along_the_line() {
        // The line runs north: its left is west.
        let line = Line { name: "gate".into(), points: vec![Point2::new(0.0, 0.0), Point2::new(0.0, 2.0)] };
        let met = meetings(&line, &Point2::new(-1.0, 1.0), &Point2::new(3.0, 1.0));
        assert_eq!(met, [Meeting { share: 0.25, is_inward: true }]);
        assert!(!meetings(&line, &Point2::new(3.0, 1.0), &Point2::new(-1.0, 1.0))[0].is_inward);
        assert!(meetings(&line, &Point2::new(-1.0, 3.0), &Point2::new(3.0, 3.0)).is_empty(), "past its end");
    }

    proptest! {
        /// A closed way around meets any line as often inward as outward unless an end of the line is inside it; and a
        /// way cut into steps meets it as often as the whole, on and through its points, too.
        #[test]
        fn steps_meet_a_line_as_often_as_the_whole_way(
            corners in prop::collection::vec((-3_i32..=3, -3_i32..=3), 2..6),
            from in (-4_i32..=4, -4_i32..=4),
            to in (-4_i32..=4, -4_i32..=4),
            steps in 1_i32..7,
        ) {
            let point = |(x, y): (i32, i32)| Point2::new(f64::from(x), f64::from(y));
            let mut points: Vec<Point2<f64>> = corners.into_iter().map(point).collect();
            points.dedup();
            let line = Line { name: "a".into(), points };
            let (from, to) = (point(from), point(to));
            // Off the grid's lines by irrational shares, so that rounding decides nothing.
            let from = from + Vector2::new(0.001 * 5_f64.sqrt(), -0.001 * 7_f64.sqrt());
            let to = to + Vector2::new(0.001 * 2_f64.sqrt(), 0.001 * 3_f64.sqrt());
            let net = |met: Vec<Meeting>| met.iter().map(|m| if m.is_inward { 1 } else { -1 }).sum::<i32>();
            let whole = net(meetings(&line, &from, &to));
            let at = |i: i32| from + (to - from) * (f64::from(i) / f64::from(steps));
            let in_steps: i32 = (0..steps).map(|i| net(meetings(&line, &at(i), &at(i + 1)))).sum();
            prop_assert_eq!(whole, in_steps);
            prop_assert_eq!(net(meetings(&line, &to, &from)), -whole);
        }
    }
}
