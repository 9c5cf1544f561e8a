//! The floor: positions that people can occupy, where tracks may begin and end, and doorsteps.
//!
//! A person in a doorway is seen before they enter the room and after they leave it. The floor behind a zone is
//! therefore a *doorstep*: people may stand there, come from there and vanish there, but they are not in the room and
//! are not reported. Without doorsteps a tracker would place a person seen through the door inside the room. Two kinds
//! of floor are doorsteps: walkable floor that is best reached through a zone (a corridor that the cameras saw), and
//! floor outside the room's outline close to a zone (a corridor that they did not see).

use nalgebra::{Point2, Vector2};
use scenes::polygon::Polygon;
use scenes::room::{Zone, ZoneKind};
use scenes::walkable::WalkableMap;

use super::doorway::beyond_zones;

/// Extent of an unseen doorstep from its zone, metres: about as far as a camera sees through a door at an angle.
const DOORSTEP_M: f64 = 1.5;
/// Half the width of a body, metres.
const BODY_M: f64 = 0.3;

/// Quantiles of the standard normal distribution at 1/22, 3/22, … 21/22: the medians of eleven equally probable parts.
const EQUAL_PARTS: [f64; 11] = [
    -1.690_622, -1.096_804, -0.747_859, -0.472_789, -0.229_884, 0.0, 0.229_884, 0.472_789, 0.747_859,
    1.096_804, 1.690_622,
];

/// The set of positions that people can occupy.
#[derive(Debug, Clone)]
pub struct Floor {
    walkable: WalkableMap,
    /// Walkable cells that are best reached through a zone, in the order of the map's grid; empty without a grid.
    beyond: Vec<bool>,
    zones: Vec<Zone>,
    /// Convex outline of the room's floor; `None` when the floor has no known end.
    outline: Option<Polygon>,
    bounds: (Point2<f64>, Point2<f64>),
}

impl Floor {
    /// Builds the floor of a room. A floor of unknown extent reaches as far as the places in `seen`.
    pub fn new(walkable: WalkableMap, zones: &[Zone], seen: &[Point2<f64>]) -> Self {
        let beyond = walkable.grid().map_or(Vec::new(), |grid| beyond_zones(grid, zones));
        let mut corners: Vec<Point2<f64>> = zones.iter().flat_map(|z| z.polygon.0.iter().copied()).collect();
        let outline = walkable.grid().map(|grid| {
            let inside = (0..grid.bits.len()).filter(|i| grid.bits[*i] && !beyond[*i]);
            let reach = 0.5 * grid.cell_m;
            corners.extend(inside.flat_map(|i| {
                [(-reach, -reach), (-reach, reach), (reach, -reach), (reach, reach)]
                    .map(|(dx, dy)| grid.center(i) + Vector2::new(dx, dy))
            }));
            Polygon::convex_hull(corners.clone())
        });
        if outline.is_none() {
            corners.extend_from_slice(seen);
        }
        let reach = Vector2::repeat(DOORSTEP_M);
        let first = corners.first().copied().unwrap_or_default();
        let (low, high) = corners.iter().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        Self { walkable, beyond, zones: zones.to_vec(), outline, bounds: (low - reach, high + reach) }
    }

    /// Whether a position is in the room and a person can stand there. A zone is always standable, because people were
    /// seen where it was drawn.
    pub fn is_inside(&self, x_m: f64, y_m: f64) -> bool {
        let p = Point2::new(x_m, y_m);
        (self.walkable.contains(x_m, y_m) && !self.is_beyond(&p))
            || self.zones.iter().any(|z| z.polygon.contains(&p))
    }

    /// Probability that a person is in the room and not on a doorstep, for a normally distributed position with mean
    /// `(x_m, y_m)` and standard deviations `sigma_m`: the share of the standable positions that is inside. 0 where no
    /// position is standable.
    pub fn share_inside(&self, x_m: f64, y_m: f64, sigma_m: [f64; 2]) -> f64 {
        let (mut standable, mut inside) = (0_u32, 0_u32);
        for u in EQUAL_PARTS {
            for v in EQUAL_PARTS {
                let (x, y) = (x_m + u * sigma_m[0], y_m + v * sigma_m[1]);
                if self.is_inside(x, y) {
                    inside += 1;
                    standable += 1;
                } else if self.is_standable(x, y) {
                    standable += 1;
                }
            }
        }
        f64::from(inside) / f64::from(standable.max(1))
    }

    /// Whether a person can stand at a position, in the room or on a doorstep.
    pub fn is_standable(&self, x_m: f64, y_m: f64) -> bool {
        self.walkable.contains(x_m, y_m) || self.near_zone(x_m, y_m, None)
    }

    /// Whether a track may begin at a position: in an entry zone or on its doorstep; anywhere in a room without zones.
    pub fn may_appear(&self, x_m: f64, y_m: f64) -> bool {
        self.zones.is_empty() || self.near_zone(x_m, y_m, Some(ZoneKind::Exit))
    }

    /// Whether a track may end at a position: in an exit zone or on its doorstep; anywhere in a room without zones.
    pub fn may_disappear(&self, x_m: f64, y_m: f64) -> bool {
        self.zones.is_empty() || self.near_zone(x_m, y_m, Some(ZoneKind::Entry))
    }

    /// Whether a body at a position touches an exit zone, or its doorstep: its middle may pass beside the zone.
    pub fn touches_exit(&self, x_m: f64, y_m: f64) -> bool {
        self.exit_distance_m(x_m, y_m) <= BODY_M
    }

    /// Distance to the nearest place at which a track may end, metres; 0 within an exit zone and on its doorstep.
    pub fn exit_distance_m(&self, x_m: f64, y_m: f64) -> f64 {
        if self.may_disappear(x_m, y_m) {
            return 0.0;
        }
        let p = Point2::new(x_m, y_m);
        let exits = self.zones.iter().filter(|zone| zone.kind != ZoneKind::Entry);
        exits.map(|zone| zone.polygon.distance_m(&p)).fold(f64::INFINITY, f64::min)
    }

    /// Smallest and largest corner of a box around all positions that people can occupy, metres.
    pub fn bounds(&self) -> (Point2<f64>, Point2<f64>) {
        self.bounds
    }

    /// Whether a position is in a zone that is not of the barred kind, or on its doorstep.
    fn near_zone(&self, x_m: f64, y_m: f64, barred: Option<ZoneKind>) -> bool {
        let p = Point2::new(x_m, y_m);
        let open = self.zones.iter().filter(|z| Some(z.kind) != barred);
        let nearest_m = open.map(|z| z.polygon.distance_m(&p)).fold(f64::INFINITY, f64::min);
        // Most positions are far from every zone, so the outline is tested only for the others.
        let outside = || self.outline.as_ref().is_some_and(|o| !o.contains(&p)) || self.is_beyond(&p);
        nearest_m <= 0.0 || (nearest_m <= DOORSTEP_M && outside())
    }

    fn is_beyond(&self, p: &Point2<f64>) -> bool {
        let cell = self.walkable.grid().and_then(|grid| grid.index_of(p));
        cell.is_some_and(|i| self.beyond[i])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
        Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1))
    }

    fn room(kind: ZoneKind) -> Floor {
        let zone = Zone { name: "door".into(), polygon: rectangle(5.0, 1.0, 6.0, 2.0), kind };
        Floor::new(WalkableMap::of_polygons(&[rectangle(0.0, 0.0, 6.0, 5.0)]), &[zone], &[])
    }

    /// A room of 6 × 5 m with more floor than that, and a door in its right side.
    fn room_with(door_to_m: f64, more: &[Polygon]) -> Floor {
        let door = rectangle(5.0, 1.0, door_to_m, 2.0);
        let zone = Zone { name: "door".into(), polygon: door, kind: ZoneKind::Both };
        let floor = [&[rectangle(0.0, 0.0, 6.0, 5.0)], more].concat();
        Floor::new(WalkableMap::of_polygons(&floor), &[zone], &[])
    }

    #[test]
    fn a_body_beside_an_exit_zone_touches_it() {
        let touches = |kind, x_m, y_m| room(kind).touches_exit(x_m, y_m);
        assert!(touches(ZoneKind::Both, 4.8, 1.5) && touches(ZoneKind::Exit, 5.5, 2.2));
        assert!(!touches(ZoneKind::Both, 4.6, 1.5) && !touches(ZoneKind::Entry, 4.8, 1.5));
        assert!(!room(ZoneKind::Both).may_disappear(4.8, 1.5));
    }

    #[test]
    fn a_corridor_behind_a_zone_is_a_doorstep_too() {
        // A corridor of 2 × 4 m behind a wall, which the zone alone leads through.
        let floor = room_with(6.1, &[rectangle(5.5, 1.2, 6.5, 1.8), rectangle(6.2, 0.0, 8.2, 4.0)]);
        assert!(floor.is_inside(5.5, 1.5) && floor.is_inside(5.5, 4.0) && floor.is_inside(0.1, 0.1));
        assert!(floor.is_standable(7.0, 3.0) && !floor.is_inside(7.0, 3.0) && !floor.is_inside(6.3, 1.5));
        assert!(floor.may_appear(6.8, 1.5) && floor.may_disappear(6.8, 1.5) && !floor.may_appear(7.9, 3.9));
    }

    #[test]
    fn a_corridor_that_touches_the_room_around_a_corner_is_still_behind_the_zone() {
        let floor = room_with(
            6.1,
            &[
                rectangle(5.5, 1.2, 6.5, 1.8),
                rectangle(6.2, 0.0, 8.2, 4.0),
                rectangle(5.8, 3.8, 6.4, 3.9), // a hole in the wall
            ],
        );
        assert!(!floor.is_inside(6.5, 1.5) && floor.may_disappear(6.5, 1.5));
        for (x, y) in [(5.5, 4.5), (4.5, 1.5), (5.9, 0.5), (5.9, 2.5)] {
            assert!(floor.is_inside(x, y), "{x} {y}");
        }
    }

    #[test]
    fn a_hole_in_the_wall_beside_a_door_is_wall() {
        let floor = room_with(
            6.0,
            &[
                rectangle(5.5, 1.0, 6.5, 2.0),
                rectangle(6.2, 0.0, 8.2, 4.0),
                rectangle(5.8, 2.0, 6.4, 2.6), // nothing was reconstructed of the wall beside the door
            ],
        );
        assert!(!floor.is_inside(6.5, 1.5) && !floor.is_inside(7.0, 3.0) && floor.may_disappear(6.5, 1.5));
        assert!(floor.is_inside(5.5, 1.5) && floor.is_inside(5.5, 2.5) && floor.is_inside(0.5, 4.5));
    }

    #[test]
    fn a_room_that_goes_on_around_a_corner_beside_the_door_is_room_there() {
        let floor = room_with(
            6.0,
            &[rectangle(5.5, 1.0, 6.5, 2.0), rectangle(6.2, 0.0, 8.2, 2.8), rectangle(5.9, 3.4, 9.0, 5.0)],
        );
        assert!(!floor.is_inside(6.5, 1.5) && !floor.is_inside(7.5, 2.5));
        for (x, y) in [(6.5, 3.6), (8.5, 3.6), (8.0, 4.5), (5.9, 3.0)] {
            assert!(floor.is_inside(x, y), "{x} {y}");
        }
    }

    /// The sides of a zone that are perpendicular to the wall are in no wall, so the floor along them is room.
    #[test]
    fn the_room_beside_a_zone_at_a_wall_with_nothing_behind_is_room() {
        let rooms = [
            (rectangle(5.0, 1.0, 6.0, 2.2), rectangle(0.0, 0.0, 6.0, 5.0)),
            (rectangle(1.4, 0.0, 3.0, 1.4), rectangle(0.0, 0.0, 7.7, 3.4)),
        ];
        for (polygon, outline) in rooms {
            let zone = Zone { name: "door".into(), polygon: polygon.clone(), kind: ZoneKind::Both };
            let floor = Floor::new(WalkableMap::of_polygons(std::slice::from_ref(&outline)), &[zone], &[]);
            for i in 0..76 * 49 {
                let (x, y) = (0.05 + 0.1 * f64::from(i % 76), 0.05 + 0.1 * f64::from(i / 76));
                let place = Point2::new(x, y);
                if outline.contains(&place) {
                    assert!(floor.is_inside(x, y), "{x} {y}");
                    assert_eq!(floor.may_appear(x, y), polygon.contains(&place), "{x} {y}");
                }
            }
        }
    }

    #[test]
    fn a_zone_in_the_middle_of_a_hall_is_in_no_wall() {
        let zone =
            Zone { name: "stairs".into(), polygon: rectangle(3.0, 2.0, 5.0, 3.0), kind: ZoneKind::Both };
        let floor = Floor::new(WalkableMap::of_polygons(&[rectangle(0.0, 0.0, 9.0, 5.0)]), &[zone], &[]);
        for (x, y) in [(2.9, 2.5), (5.1, 2.5), (4.0, 1.9), (4.0, 3.1), (8.5, 4.5)] {
            assert!(floor.is_inside(x, y), "{x} {y}");
        }
    }

    #[test]
    fn the_doorstep_lies_outside_the_room_next_to_the_zone() {
        let floor = room(ZoneKind::Both);
        assert!(floor.is_standable(6.5, 1.5) && !floor.is_inside(6.5, 1.5));
        assert!(floor.may_appear(6.5, 1.5) && floor.may_disappear(6.5, 1.5));
        assert!(floor.may_appear(5.5, 1.5) && floor.is_inside(5.5, 1.5));
        assert!(!floor.may_appear(4.5, 1.5), "next to the zone, but in the room");
        assert!(!floor.is_standable(6.5, 4.8) && !floor.is_standable(-0.1, 2.0));
        let (low, high) = floor.bounds();
        assert!(low.x <= 0.0 && high.x >= 6.5);
    }

    /// Along the wall with the door the share is that of the normal distribution; walls do not reduce it.
    #[test]
    fn the_share_inside_beside_a_door_is_the_normal_distributions() {
        let floor = room(ZoneKind::Both);
        // Standard deviations from the door's outer edge, and the distribution function there.
        for (sigmas, inside) in
            [(0.0, 0.5), (0.6, 0.725_75), (-1.0, 0.158_66), (2.5, 0.993_79), (-3.0, 0.001_35)]
        {
            let found = floor.share_inside(6.0 - 0.1 * sigmas, 1.5, [0.1, 0.03]);
            assert!((found - inside).abs() < 0.5 / 11.0 + 1e-9, "{found} of {inside}");
        }
        for (x, y) in [(3.0, 2.5), (5.5, 4.98), (0.02, 0.02), (5.97, 4.0)] {
            assert!((floor.share_inside(x, y, [0.1, 0.1]) - 1.0).abs() < 1e-12, "no door at {x} {y}");
        }
        assert!(
            floor.share_inside(-5.0, 2.5, [0.1, 0.1]) < 1e-12
                && floor.share_inside(6.5, 1.5, [0.1, 0.1]) < 1e-12
        );
    }

    #[test]
    fn one_way_zones_let_people_pass_one_way() {
        let entry = room(ZoneKind::Entry);
        assert!(entry.may_appear(5.5, 1.5) && !entry.may_disappear(5.5, 1.5));
        let exit = room(ZoneKind::Exit);
        assert!(!exit.may_appear(6.5, 1.5) && exit.may_disappear(6.5, 1.5) && exit.is_standable(6.5, 1.5));
    }

    #[test]
    fn without_zones_people_come_and_go_anywhere() {
        let floor = Floor::new(WalkableMap::of_polygons(&[rectangle(0.0, 0.0, 6.0, 5.0)]), &[], &[]);
        assert!(floor.may_appear(3.0, 3.0) && floor.may_disappear(3.0, 3.0) && !floor.is_standable(7.0, 3.0));
        let open =
            Floor::new(WalkableMap::everywhere(), &[], &[Point2::new(1.0, 1.0), Point2::new(9.0, 4.0)]);
        assert!(open.is_inside(50.0, 50.0) && open.bounds().1.x > 9.0);
    }
}
