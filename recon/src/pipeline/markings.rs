//! Zones, regions, lines, walkable regions and the place on Earth of a room that is built again.
//!
//! They stay where they are in the room. A room's coordinates are its first camera's or its control points', in metres by its known
//! lengths. When those become others, all coordinates change, and the markings are moved along: by the similarity on the floor on
//! which most cameras of both rooms agree. Differences between two builds of the same project move nothing.

use nalgebra::{Point2, Similarity2, UnitComplex, Vector2, Vector3};
use scenes::polygon::Polygon;
use scenes::room::{Geo, Markings, Room, RoomCamera};

/// Change of a camera's place and heading that counts as none.
#[derive(Debug, Clone, Copy)]
struct Tolerance {
    metres: f64,
    degrees: f64,
}

/// Other captures or picks of the same cameras explain this much …
const SAME: Tolerance = Tolerance { metres: 0.3, degrees: 3.0 };
/// … and in rooms whose coordinates are those of control points, this much.
const SAME_SURVEYED: Tolerance = Tolerance { metres: 0.05, degrees: 0.5 };

/// Takes the markings of the room before over into a rebuilt one. Those `from_file` replace the old ones; a file without regions or
/// lines leaves the old ones. `is_surveyed`: whether control points give the room's coordinates. Returns a note where coordinates have
/// changed, or may have.
pub(super) fn take_over(
    room: &mut Room,
    before: Option<Room>,
    from_file: Option<Markings>,
    is_surveyed: bool,
) -> Option<String> {
    let mut note = None;
    if let Some(before) = before {
        let change = CoordinateChange::between(&before, room, if is_surveyed { SAME_SURVEYED } else { SAME });
        room.walkable = before.walkable;
        room.zones = before.zones;
        room.regions = before.regions;
        room.lines = before.lines;
        room.geo = before.geo;
        let has_markings = room.geo.is_some()
            || room.walkable.is_some()
            || !(room.zones.is_empty() && room.regions.is_empty() && room.lines.is_empty());
        match change {
            CoordinateChange::None => {}
            CoordinateChange::Unclear => {
                let text = "the cameras contradict each other about whether the room's coordinates have changed; zones, regions and \
                            lines were left as they are: check them in the editor";
                note = has_markings.then(|| text.to_owned());
            }
            CoordinateChange::By(motion) => {
                move_all(room, &motion);
                let of_file =
                    if from_file.is_some() { "; those of --zones are taken as they stand" } else { "" };
                note = has_markings.then(|| {
                    format!(
                        "the room's coordinates have changed (turned by {:.1}°, moved by {:.2} m, scaled by {:.3}): zones, regions, \
                         lines, walkable regions and the place on Earth were moved along{of_file}",
                        motion.isometry.rotation.angle().to_degrees(),
                        motion.isometry.translation.vector.norm(),
                        motion.scaling()
                    )
                });
            }
        }
    }
    if let Some(Markings { zones, regions, lines }) = from_file {
        room.zones = zones;
        if !regions.is_empty() {
            room.regions = regions;
        }
        if !lines.is_empty() {
            room.lines = lines;
        }
    }
    note
}

/// Change of a room's coordinates from one build to the next.
#[derive(Debug, Clone, PartialEq)]
enum CoordinateChange {
    None,
    /// As many cameras say so as say otherwise.
    Unclear,
    /// Coordinates now from those before.
    By(Similarity2<f64>),
}

impl CoordinateChange {
    /// The change on which most cameras agree, each to within the tolerance.
    fn between(before: &Room, now: &Room, tolerance: Tolerance) -> Self {
        let of_name = |name: &str| now.cameras.iter().find(|camera| camera.name == name);
        let pairs: Vec<(&RoomCamera, &RoomCamera)> =
            before.cameras.iter().filter_map(|old| Some((old, of_name(&old.name)?))).collect();
        let explained = |change: &Similarity2<f64>| {
            pairs.iter().filter(|(old, new)| explains(change, old, new, tolerance)).count()
        };
        let stay = Similarity2::identity();
        let scales = scales(&pairs);
        let moved = || pairs.iter().filter(|(old, new)| !explains(&stay, old, new, tolerance));
        let of_scale = |scale: f64| moved().map(move |(old, new)| similarity_of(old, new, scale));
        let candidates = scales.iter().flat_map(|scale| of_scale(*scale));
        // Of those with most votes, the last.
        match candidates.max_by_key(explained) {
            Some(best) if explained(&best) > explained(&stay) => Self::By(best),
            // Any two cameras agree on some scale: it cannot make a draw.
            _ if of_scale(1.0).any(|change| explained(&change) == explained(&stay)) => Self::Unclear,
            _ => Self::None,
        }
    }
}

/// Ratios of the distances between cameras now to those before; last 1, which is preferred.
fn scales(pairs: &[(&RoomCamera, &RoomCamera)]) -> Vec<f64> {
    let apart = |a: &RoomCamera, b: &RoomCamera| (a.camera.center() - b.camera.center()).norm();
    let ratio = |a: usize, b: usize| apart(pairs[a].1, pairs[b].1) / apart(pairs[a].0, pairs[b].0);
    let all = (0..pairs.len()).flat_map(|a| (0..a).map(move |b| (a, b))).map(|(a, b)| ratio(a, b));
    all.filter(|ratio| ratio.is_finite() && *ratio > 0.0).chain([1.0]).collect()
}

/// Tells whether a change of coordinates leaves a camera where it was.
fn explains(change: &Similarity2<f64>, old: &RoomCamera, new: &RoomCamera, tolerance: Tolerance) -> bool {
    let off_m = (change * old.camera.center().xy() - new.camera.center().xy()).norm();
    let turn = change.isometry.rotation.inverse() * turn_of(old, new);
    off_m < tolerance.metres && turn.angle().to_degrees().abs() < tolerance.degrees
}

/// Turn about the vertical from one camera's heading to the other's.
fn turn_of(old: &RoomCamera, new: &RoomCamera) -> UnitComplex<f64> {
    let x = (new.camera.camera_from_world.inverse() * old.camera.camera_from_world).rotation * Vector3::x();
    UnitComplex::new(x.y.atan2(x.x))
}

/// Similarity on the floor of this scale that carries one camera to the other.
fn similarity_of(old: &RoomCamera, new: &RoomCamera, scale: f64) -> Similarity2<f64> {
    let turn = turn_of(old, new);
    let shift: Vector2<f64> =
        new.camera.center().xy().coords - turn * old.camera.center().xy().coords * scale;
    Similarity2::from_parts(shift.into(), turn, scale)
}

fn move_all(room: &mut Room, change: &Similarity2<f64>) {
    let to = |place: &mut Point2<f64>| *place = change * *place;
    let polygons = room.zones.iter_mut().map(|zone| &mut zone.polygon);
    let polygons = polygons.chain(room.regions.iter_mut().map(|region| &mut region.polygon));
    for Polygon(corners) in polygons.chain(room.walkable.iter_mut().flatten()) {
        corners.iter_mut().for_each(to);
    }
    for line in &mut room.lines {
        line.points.iter_mut().for_each(to);
    }
    if let Some(geo) = &mut room.geo {
        let origin = change.inverse() * Point2::origin();
        let [longitude, latitude] = geo.longitude_latitude(&origin);
        let heading = (geo.heading + change.isometry.rotation.angle().to_degrees()).rem_euclid(360.0);
        *geo = Geo { latitude, longitude, heading };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};
    use scenes::room::{Line, Zone, ZoneKind};
    use synthetic::RoomOptions;

    fn marked() -> Room {
        let mut room = RoomOptions { cameras: 3, ..RoomOptions::default() }.build().unwrap().room;
        let polygon = Polygon::rectangle(Point2::new(1.0, 1.0), Point2::new(2.0, 3.0));
        room.zones = vec![Zone { name: "door".into(), polygon, kind: ZoneKind::default() }];
        let points = vec![Point2::new(0.5, 0.0), Point2::new(0.5, 2.0)];
        room.lines = vec![Line { name: "till".into(), points }];
        room.walkable = Some(vec![Polygon::rectangle(Point2::new(0.0, 0.0), Point2::new(4.0, 3.0))]);
        room.geo = Some(Geo { latitude: 48.1, longitude: 11.6, heading: 350.0 });
        room
    }

    /// The room's cameras in other coordinates, without markings.
    fn rebuilt(room: &Room, change: &Similarity2<f64>) -> Room {
        let mut cameras = room.cameras.clone();
        let shift = change.isometry.translation.vector;
        let new_from_old = Isometry3::from_parts(
            Translation3::new(shift.x, shift.y, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), change.isometry.rotation.angle()),
        );
        for camera in &mut cameras {
            camera.camera.camera_from_world.translation.vector *= change.scaling();
            camera.camera.camera_from_world *= new_from_old.inverse();
        }
        Room { cameras, ..Room::default() }
    }

    fn change(x: f64, y: f64, angle: f64, scale: f64) -> Similarity2<f64> {
        Similarity2::new(Vector2::new(x, y), angle, scale)
    }

    #[test]
    fn markings_stay_to_the_bit_where_a_build_differs_by_little() {
        let before = marked();
        let little = change(0.12, -0.03, 0.01, 1.0);
        let mut room = rebuilt(&before, &little);
        assert_eq!(take_over(&mut room, Some(before.clone()), None, false), None);
        assert_eq!((&room.zones, &room.lines, &room.geo), (&before.zones, &before.lines, &before.geo));
        // In coordinates that were surveyed the same is a correction.
        let mut room = rebuilt(&before, &little);
        assert!(take_over(&mut room, Some(before.clone()), None, true).is_some());
        assert!((little * before.lines[0].points[1] - room.lines[0].points[1]).norm() < 1e-9);
    }

    #[test]
    fn markings_move_with_the_coordinates_and_so_does_the_place_on_earth() {
        let before = marked();
        let change = change(12.0, -7.0, 2.0, 1.0);
        let mut room = rebuilt(&before, &change);
        // One of three cameras was installed elsewhere meanwhile.
        room.cameras[0].camera.camera_from_world *= Isometry3::translation(3.0, 0.0, 0.0);
        let note = take_over(&mut room, Some(before.clone()), None, false).unwrap();
        assert!(note.contains("114.6°") && note.contains("scaled by 1.000"), "{note}");
        for (old, new) in before.zones[0].polygon.0.iter().zip(&room.zones[0].polygon.0) {
            assert!((change * old - new).norm() < 1e-9, "{old} {new}");
        }
        // The same corner is at the same place on Earth: 1e-7° are a centimetre.
        let [old, new] = [&before, &room]
            .map(|room| room.geo.as_ref().unwrap().longitude_latitude(&room.zones[0].polygon.0[2]));
        assert!(old.iter().zip(new).all(|(old, new)| (old - new).abs() < 1e-7), "{old:?} {new:?}");
    }

    #[test]
    fn a_corrected_scale_moves_all_markings_as_much() {
        let before = marked();
        let change = change(0.4, 0.1, 0.3, 1.25);
        let mut room = rebuilt(&before, &change);
        let from_file = Markings { zones: before.zones.clone(), ..Markings::default() };
        let note = take_over(&mut room, Some(before.clone()), Some(from_file), false).unwrap();
        assert!(note.contains("scaled by 1.250") && note.contains("--zones"), "{note}");
        assert_eq!(room.zones, before.zones, "those of a file are taken as they stand");
        assert!((change * before.lines[0].points[1] - room.lines[0].points[1]).norm() < 1e-9);
        let [old, new] = [&before, &room].map(|room| room.walkable.as_ref().unwrap()[0].0[2]);
        assert!((change * old - new).norm() < 1e-9);
    }

    #[test]
    fn of_two_cameras_one_that_moved_moves_nothing_but_is_noted() {
        let mut before = marked();
        before.cameras.truncate(2);
        let mut room = rebuilt(&before, &Similarity2::identity());
        room.cameras[0].camera.camera_from_world *= Isometry3::translation(3.0, 0.0, 0.0);
        let note = take_over(&mut room, Some(before.clone()), None, false).unwrap();
        assert!(note.contains("contradict"), "{note}");
        assert_eq!(room.zones, before.zones);
        // One of three is outvoted.
        let before = marked();
        let mut room = rebuilt(&before, &Similarity2::identity());
        room.cameras[0].camera.camera_from_world *= Isometry3::translation(3.0, 0.0, 0.0);
        assert_eq!(take_over(&mut room, Some(before), None, false), None);
    }
}
