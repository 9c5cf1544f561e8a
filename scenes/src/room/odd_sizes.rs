//! Sizes that no room is likely to have: in another unit than the metre, far from the origin, or with something drawn far
//! outside. They are no defects, but worth a warning with the command that mends them.

use nalgebra::Point3;

use super::Room;
use crate::geometry::{Geometry, point_from_vec3};
use crate::polygon::Polygon;

/// Height of the cameras, or of most of the geometry, above which the unit is hardly the metre …
const HIGHEST_M: f64 = 100.0;
/// … and from which on it is rather the millimetre than the centimetre.
const HIGHEST_CM: f64 = 1000.0;
/// Extent of most of the geometry above which the unit is hardly the metre.
const LARGEST_M: f64 = 1000.0;
/// Distance of the cameras from the origin above which single precision costs a tenth of a millimetre.
const FARTHEST_M: f64 = 1000.0;
/// Distance of something drawn from the cameras and the geometry above which it hardly belongs to the room.
const FARTHEST_DRAWN_M: f64 = 300.0;
/// Number of corners above which an outline is hardly drawn, but traced.
const MOST_CORNERS: usize = 2000;
/// Share of the vertices at each end that may be strays.
const STRAYS: f64 = 0.02;
/// Number of vertices from which the geometry's extent is taken.
const SAMPLES: usize = 20_000;

impl Room {
    /// Warnings of sizes that no room is likely to have, each with the command that mends it.
    pub fn odd_sizes(&self) -> Vec<String> {
        let eyes: Vec<Point3<f64>> = self.cameras.iter().map(|entry| entry.camera.center()).collect();
        let extent = self.geometry.as_ref().and_then(extent);
        let unit = unit_warning(&eyes, extent.as_ref());
        let far = if unit.is_none() { far_warning(&eyes) } else { None };
        let near: Vec<Point3<f64>> =
            eyes.iter().copied().chain(extent.into_iter().flat_map(<[_; 2]>::from)).collect();
        unit.into_iter().chain(far).chain(self.far_drawings(&near)).chain(self.long_outlines()).collect()
    }

    /// Outlines that can be drawn: kind, name, polygon.
    fn outlines(&self) -> impl Iterator<Item = (&'static str, String, &Polygon)> {
        let zones = self.zones.iter().map(|zone| ("zone", zone.name.clone(), &zone.polygon));
        let regions = self.regions.iter().map(|region| ("region", region.name.clone(), &region.polygon));
        let floor = self.walkable.iter().flatten().zip(1..);
        let floor = floor.map(|(polygon, number)| ("floor polygon", format!("{number}"), polygon));
        zones.chain(regions).chain(floor)
    }

    /// Warnings of outlines with more corners than anybody draws.
    fn long_outlines(&self) -> Vec<String> {
        self.outlines()
            .filter(|(_, _, polygon)| polygon.0.len() > MOST_CORNERS)
            .map(|(kind, name, polygon)| {
                format!(
                    "{kind} `{name}`: it has {} corners, more than can be edited; draw it anew with `scenes edit`, or simplify it",
                    polygon.0.len()
                )
            })
            .collect()
    }

    /// Warnings of zones, regions and floor polygons that lie far from `near`.
    fn far_drawings(&self, near: &[Point3<f64>]) -> Vec<String> {
        let (Some(low), Some(high)) =
            (near.iter().copied().reduce(|a, b| a.inf(&b)), near.iter().copied().reduce(|a, b| a.sup(&b)))
        else {
            return Vec::new();
        };
        // Distance of a box around something drawn from the box around cameras and geometry.
        let gap = |polygon: &Polygon| {
            let (from, to) = polygon.bounds();
            let along = |axis: usize| (from[axis] - high[axis]).max(low[axis] - to[axis]).max(0.0);
            along(0).hypot(along(1))
        };
        self.outlines()
            .filter_map(|(kind, name, polygon)| {
                let gap_m = gap(polygon);
                (gap_m > FARTHEST_DRAWN_M).then(|| {
                    format!(
                        "{kind} `{name}`: it lies {gap_m:.0} m from every camera and the geometry; move it with `scenes edit`, or \
                         remove its table from scene.toml"
                    )
                })
            })
            .collect()
    }
}

/// Smallest and largest corner of the box around most of the geometry.
fn extent(geometry: &Geometry) -> Option<(Point3<f64>, Point3<f64>)> {
    let count = match geometry {
        Geometry::Mesh(mesh) => mesh.vertices.len(),
        Geometry::Discs(discs) => discs.len(),
    };
    let place = |i: usize| {
        point_from_vec3(match geometry {
            Geometry::Mesh(mesh) => mesh.vertices[i],
            Geometry::Discs(discs) => discs[i].center,
        })
    };
    let step = count.div_ceil(SAMPLES).max(1);
    let places: Vec<Point3<f64>> = (0..count).step_by(step).map(place).collect();
    if places.is_empty() {
        return None;
    }
    let quantile = |axis: usize, share: f64| {
        let mut values: Vec<f64> = places.iter().map(|p| p[axis]).collect();
        values.sort_by(f64::total_cmp);
        values[(share * (values.len() - 1) as f64).round() as usize]
    };
    let corner = |share: f64| Point3::from([0, 1, 2].map(|axis| quantile(axis, share)));
    Some((corner(STRAYS), corner(1.0 - STRAYS)))
}

/// Median of some numbers.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn unit_warning(eyes: &[Point3<f64>], extent: Option<&(Point3<f64>, Point3<f64>)>) -> Option<String> {
    let above = median(eyes.iter().map(|eye| eye.z.abs()).collect())?;
    let size = extent.map(|(low, high)| high - low);
    let height = size.map_or(0.0, |size| size.z);
    let tall = above.max(height);
    let is_large = size.is_some_and(|size| size.x.max(size.y) > LARGEST_M);
    if tall <= HIGHEST_M && !is_large {
        return None;
    }
    let seen = if above > HIGHEST_M {
        format!("the cameras stand {above:.0} m above the floor")
    } else if height > HIGHEST_M {
        format!("most of the geometry is {height:.0} m high")
    } else {
        format!("most of the geometry is {:.0} m large", size.map_or(0.0, |size| size.x.max(size.y)))
    };
    let (unit, scale) = if tall > HIGHEST_CM || tall <= HIGHEST_M {
        ("millimetres", "0.001")
    } else {
        ("centimetres", "0.01")
    };
    Some(format!("{seen}; is the room in {unit}? Bring it to metres with `scenes import … --scale {scale}`"))
}

fn far_warning(eyes: &[Point3<f64>]) -> Option<String> {
    let middle = |axis: usize| median(eyes.iter().map(|eye| eye[axis]).collect());
    let (x, y) = (middle(0)?, middle(1)?);
    (x.abs().max(y.abs()) > FARTHEST_M).then(|| {
        // No negative zero.
        let step = |metres: f64| 0.0 - (metres / 1000.0).floor() * 1000.0;
        format!(
            "the cameras stand at ({x:.0}, {y:.0}) m, far from the origin, where precision is lost; bring the room there with \
             `scenes import … --shift={},{},0`",
            step(x),
            step(y)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::room::Zone;
    use nalgebra::{Point2, Similarity3, Translation3};

    fn warnings(change: impl FnOnce(&mut Room)) -> Vec<String> {
        let mut room = crate::exchange::test_room::room(3);
        change(&mut room);
        room.odd_sizes()
    }

    /// The room with every length times `scale`, moved along x.
    fn scaled(room: &mut Room, scale: f64, along_m: f64) {
        let way = Translation3::new(along_m, 0.0, 0.0) * Similarity3::from_scaling(scale);
        for entry in &mut room.cameras {
            entry.camera = crate::exchange::placement::placed(&entry.camera, &way);
        }
        let Some(Geometry::Mesh(mesh)) = &mut room.geometry else { unreachable!() };
        for vertex in &mut mesh.vertices {
            *vertex = (way * point_from_vec3(*vertex)).coords.map(|value| value as f32).into();
        }
    }

    #[test]
    fn rooms_in_other_units_get_the_command_that_mends_them() {
        assert_eq!(warnings(|_| {}), [""; 0]);
        for (scale, word) in [(1000.0, "--scale 0.001"), (100.0, "--scale 0.01`")] {
            let said = warnings(|room| scaled(room, scale, 0.0));
            assert!(said.len() == 1 && said[0].contains(word), "{said:?}");
        }
        // A hall of 40 m is in metres.
        assert_eq!(warnings(|room| scaled(room, 7.0, 0.0)), [""; 0]);
    }

    #[test]
    fn a_room_far_away_gets_the_shift() {
        let said = warnings(|room| scaled(room, 1.0, 4005.0));
        assert!(said.len() == 1 && said[0].contains("--shift=-4000,0,0"), "{said:?}");
        assert_eq!(warnings(|room| scaled(room, 1.0, 900.0)), [""; 0]);
    }

    #[test]
    fn a_traced_outline_is_told_of_in_no_time() {
        let corner = |i: u32| {
            let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 1e5).sin_cos();
            let radius = 2.0 + 0.1 * (f64::from(i) / 7.0).sin();
            Point2::new(3.0 + radius * cos, 2.5 + radius * sin)
        };
        let mut room = crate::exchange::test_room::room(2);
        room.walkable = Some(vec![Polygon((0..100_000).map(corner).collect())]);
        let said = room.odd_sizes();
        assert!(said.len() == 1 && said[0].contains("floor polygon `1`: it has 100000 corners"), "{said:?}");
        let map = crate::walkable::WalkableMap::of_room(&room).unwrap();
        // The mean of the squared radius is 4.005.
        let expected = 4.005 * std::f64::consts::PI;
        assert!((map.area_m2().unwrap() - expected).abs() < 0.05, "{:?}", map.area_m2());
    }

    #[test]
    fn a_zone_a_kilometre_away_is_named() {
        let zone = |name: &str, x: f64| Zone {
            name: name.into(),
            polygon: Polygon::rectangle(Point2::new(x, 0.0), Point2::new(x + 1.0, 1.0)),
            kind: crate::room::ZoneKind::Both,
        };
        let said = warnings(|room| {
            room.zones = vec![zone("door", 5.5), zone("yard", 1000.0)];
            room.walkable = Some(vec![zone("", -2000.0).polygon]);
        });
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].contains("zone `yard`: it lies 99") && said[0].contains("scenes edit"), "{said:?}");
        assert!(said[1].contains("floor polygon `1`"), "{said:?}");
    }
}
