//! Regions and lines: where people are counted and timed. They change nothing about the tracking.

use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use shell::ranges::INTERVAL_S;

use super::Zone;
use super::drawing::{MOST_CORNERS, name_defect, outline_defect};
use crate::polygon::{Polygon, coordinate_defect, segments_meet};

/// Name that the counts of the whole room have; no region or line may have it.
const WHOLE_ROOM: &str = "room";
/// Length below which a piece of a line has no direction, metres.
const LEAST_PIECE_M: f64 = 1e-3;

/// A region of the floor where people are counted and timed. Nobody appears or disappears because of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Name, unique among the zones, regions and lines of the room.
    pub name: String,
    /// Outline on the floor, metres.
    pub polygon: Polygon,
    /// Duration after which a stay is an event of its own, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dwell_s: Option<f64>,
}

/// A line on the floor at which people are counted. From its left to its right, walking along it, is *in*; back is
/// *out*.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Name, unique among the zones, regions and lines of the room.
    pub name: String,
    /// The line's points in their order, metres; at least two.
    pub points: Vec<Point2<f64>>,
}

impl Line {
    /// Pieces of the line, in order.
    pub fn pieces(&self) -> impl Iterator<Item = (Point2<f64>, Point2<f64>)> + '_ {
        self.points.windows(2).map(|pair| (pair[0], pair[1]))
    }

    /// Defect for which nobody can be counted at the line: fewer than two points, a number that is not finite, a piece
    /// without length, pieces that cross.
    pub fn defect(&self) -> Option<String> {
        let count = self.points.len();
        if count < 2 {
            return Some(format!("a line needs at least 2 points, this one has {count}; add one"));
        }
        if count > MOST_CORNERS {
            return Some(format!("it has {count} points; {MOST_CORNERS} are the most"));
        }
        if !self.points.iter().all(|p| p.x.is_finite() && p.y.is_finite()) {
            return Some("a point is not a finite number".into());
        }
        let defect = |(i, point)| Some(format!("point {} {}", i + 1, coordinate_defect(point)?));
        if let Some(problem) = self.points.iter().enumerate().find_map(defect) {
            return Some(problem);
        }
        let pieces: Vec<_> = self.pieces().collect();
        if let Some(i) = pieces.iter().position(|(a, b)| (b - a).norm() < LEAST_PIECE_M) {
            return Some(format!("points {} and {} are the same; remove one", i + 1, i + 2));
        }
        let meet = |i: usize, j: usize| {
            let ((a, b), (c, d)) = (pieces[i], pieces[j]);
            segments_meet(a, b, c, d)
        };
        // Neighbours share a point.
        let crossing =
            (0..pieces.len()).find_map(|i| (i + 2..pieces.len()).find(|j| meet(i, *j)).map(|j| (i, j)));
        crossing.map(|(i, j)| {
            format!(
                "it meets itself: the piece from point {} to {} and the one from {} to {}; left and right would be undefined, so move a point",
                i + 1,
                i + 2,
                j + 1,
                j + 2
            )
        })
    }
}

/// First defect of a room's regions and lines: its place, and the problem.
pub(super) fn defect(zones: &[Zone], regions: &[Region], lines: &[Line]) -> Option<(String, String)> {
    let mut taken: Vec<(&str, &str)> = zones.iter().map(|zone| (zone.name.as_str(), "zone")).collect();
    let mut named = |name, kind| {
        let defect = name_defect(name).or_else(|| {
            if name == WHOLE_ROOM {
                return Some("`room` is the name of the whole room's counts; take another".into());
            }
            let (_, other) = taken.iter().find(|(other, _)| *other == name)?;
            Some(format!("another {other} has the same name; rename one"))
        });
        taken.push((name, kind));
        defect
    };
    for (i, region) in regions.iter().enumerate() {
        let dwell = || {
            let problem = region.dwell_s.and_then(|seconds| INTERVAL_S.defect(seconds))?;
            Some(format!("dwell_s {problem}, or leave it out"))
        };
        if let Some(problem) =
            named(&region.name, "region").or_else(|| outline_defect(&region.polygon)).or_else(dwell)
        {
            return Some((format!("region {} (`{}`)", i + 1, region.name), problem));
        }
    }
    for (i, line) in lines.iter().enumerate() {
        if let Some(problem) = named(&line.name, "line").or_else(|| line.defect()) {
            return Some((format!("line {} (`{}`)", i + 1, line.name), problem));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room::{Room, RoomCamera, ZoneKind};
    use calib::{Camera, Intrinsics};
    use nalgebra::Isometry3;

    fn region(name: &str) -> Region {
        let polygon = Polygon::rectangle(Point2::origin(), Point2::new(1.0, 1.0));
        Region { name: name.into(), polygon, dwell_s: Some(3.0) }
    }

    fn line(name: &str, points: &[(f64, f64)]) -> Line {
        Line { name: name.into(), points: points.iter().map(|(x, y)| Point2::new(*x, *y)).collect() }
    }

    /// One-line error of a room with these markings and a zone `door`.
    fn refusal(regions: Vec<Region>, lines: Vec<Line>) -> Option<String> {
        let camera = Camera {
            intrinsics: Intrinsics::from_horizontal_fov(64, 48, 70.0),
            camera_from_world: Isometry3::identity(),
        };
        let door = Zone { name: "door".into(), polygon: region("").polygon, kind: ZoneKind::Both };
        let cameras = vec![RoomCamera { name: "cam".into(), camera, reference: None }];
        let room = Room { cameras, zones: vec![door], regions, lines, ..Room::default() };
        room.validate().err().map(|e| e.to_string())
    }

    #[test]
    fn usable_markings_are_accepted() {
        let bent = line("bent", &[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        assert_eq!(
            refusal(
                vec![region("counter"), region("shelf")],
                vec![line("a", &[(0.0, 0.0), (1.0, 0.0)]), bent]
            ),
            None
        );
    }

    #[test]
    fn each_defect_is_named_with_its_place_and_mend() {
        let bow_tie = Polygon(
            [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)].map(|(x, y)| Point2::new(x, y)).to_vec(),
        );
        let good = || line("gate", &[(0.0, 0.0), (1.0, 0.0)]);
        let of_polygon = |polygon| Region { polygon, ..region("a") };
        let regions = [
            (
                of_polygon(Polygon(vec![Point2::origin(); 2])),
                "region 1 (`a`): a polygon needs at least 3 corners",
            ),
            (of_polygon(Polygon(vec![Point2::new(f64::NAN, 0.0); 3])), "region 1 (`a`)"),
            (of_polygon(bow_tie), "its outline meets itself"),
            (Region { dwell_s: Some(0.0), ..region("a") }, "dwell_s is 0"),
            (Region { dwell_s: Some(f64::NAN), ..region("a") }, "dwell_s is NaN"),
            (region(" "), "has no name"),
            (region("a\nb"), "line break"),
            (region("door"), "another zone has the same name"),
            (region("room"), "the whole room"),
        ];
        for (region, words) in regions {
            let said = refusal(vec![region], vec![good()]).unwrap();
            assert!(said.contains(words), "{said}");
        }
        assert!(
            refusal(vec![region("a"), region("a")], vec![])
                .unwrap()
                .contains("region 2 (`a`): another region")
        );
        let lines = [
            (line("a", &[(0.0, 0.0)]), "line 1 (`a`): a line needs at least 2 points, this one has 1"),
            (line("a", &[(0.0, 0.0), (f64::NAN, 0.0)]), "not a finite number"),
            (line("a", &[(0.0, 0.0), (1.0, 0.0), (1.0, 0.0)]), "points 2 and 3 are the same"),
            (
                line("a", &[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, -1.0)]),
                "the piece from point 1 to 2 and the one from 3 to 4",
            ),
            (line("counter", &[(0.0, 0.0), (1.0, 0.0)]), "another region has the same name"),
        ];
        for (line, words) in lines {
            let said = refusal(vec![region("counter")], vec![line]).unwrap();
            assert!(said.contains(words), "{said}");
        }
    }
}
