//! Zones, regions, lines, walkable regions and the place on Earth of a room that is built again.
//!
//! They stay where they are in the room. A room's coordinates are its first camera's or its control points', so when those become
//! others, all coordinates change, and the markings are moved along: by the motion on which most cameras of both rooms agree. What
//! two builds of the same project differ by moves nothing.

use nalgebra::{Isometry2, Point2, Vector2, Vector3};
use scenes::polygon::Polygon;
use scenes::room::{Geo, Markings, Room, RoomCamera};

/// Change of a camera's place and heading that other captures or picks explain, metres and degrees.
const SAME_M: f64 = 0.3;
const SAME_DEG: f64 = 3.0;

/// Takes the markings of the room before over into a rebuilt one. Those `given`, of a file, come in place of the old ones; a file
/// without regions or lines leaves the old ones. Returns a sentence where coordinates have changed.
pub(super) fn take_over(room: &mut Room, before: Option<Room>, given: Option<Markings>) -> Option<String> {
    let mut moved = None;
    if let Some(before) = before {
        let motion = motion(&before, room);
        room.walkable = before.walkable;
        room.zones = before.zones;
        room.regions = before.regions;
        room.lines = before.lines;
        room.geo = before.geo;
        if let Some(motion) = motion {
            move_all(room, &motion);
            let has_any = !(room.zones.is_empty() && room.regions.is_empty() && room.lines.is_empty());
            moved = has_any.then(|| {
                format!(
                    "the room's coordinates have changed (turned by {:.1}°, moved by {:.2} m): the zones, regions and lines were moved along",
                    motion.rotation.angle().to_degrees(),
                    motion.translation.vector.norm()
                )
            });
        }
    }
    if let Some(Markings { zones, regions, lines }) = given {
        room.zones = zones;
        if !regions.is_empty() {
            room.regions = regions;
        }
        if !lines.is_empty() {
            room.lines = lines;
        }
    }
    moved
}

/// Motion on the floor from the coordinates before to those now, on which most cameras agree; `None` where most cameras stay.
fn motion(before: &Room, now: &Room) -> Option<Isometry2<f64>> {
    let of_name = |name: &str| now.cameras.iter().find(|camera| camera.name == name);
    let pairs: Vec<(&RoomCamera, &RoomCamera)> =
        before.cameras.iter().filter_map(|old| Some((old, of_name(&old.name)?))).collect();
    let agreeing = |motion: &Isometry2<f64>| {
        pairs.iter().filter(|(old, new)| is_same(&(motion.inverse() * camera_motion(old, new)), old)).count()
    };
    let stay = agreeing(&Isometry2::identity());
    let candidates = pairs.iter().map(|(old, new)| camera_motion(old, new));
    // The first of those with most votes: `max_by_key` takes the last.
    let best = candidates.rev().max_by_key(agreeing)?;
    (agreeing(&best) > stay).then_some(best)
}

/// Whether a motion leaves a camera where it was, up to what another build changes.
fn is_same(motion: &Isometry2<f64>, camera: &RoomCamera) -> bool {
    let foot = camera.camera.center().xy();
    (motion * foot - foot).norm() < SAME_M && motion.rotation.angle().to_degrees().abs() < SAME_DEG
}

/// Motion on the floor by which one camera has moved.
fn camera_motion(old: &RoomCamera, new: &RoomCamera) -> Isometry2<f64> {
    let new_from_old = new.camera.camera_from_world.inverse() * old.camera.camera_from_world;
    let x = new_from_old.rotation * Vector3::x();
    let turn = Isometry2::rotation(x.y.atan2(x.x));
    let shift: Vector2<f64> = new.camera.center().xy() - turn * old.camera.center().xy();
    Isometry2::new(shift, turn.rotation.angle())
}

fn move_all(room: &mut Room, motion: &Isometry2<f64>) {
    let to = |place: &mut Point2<f64>| *place = motion * *place;
    let polygons = room.zones.iter_mut().map(|zone| &mut zone.polygon);
    let polygons = polygons.chain(room.regions.iter_mut().map(|region| &mut region.polygon));
    for Polygon(corners) in polygons.chain(room.walkable.iter_mut().flatten()) {
        corners.iter_mut().for_each(to);
    }
    for line in &mut room.lines {
        line.points.iter_mut().for_each(to);
    }
    if let Some(geo) = &mut room.geo {
        let [longitude, latitude] = geo.longitude_latitude(&(motion.inverse() * Point2::origin()));
        let heading = (geo.heading + motion.rotation.angle().to_degrees()).rem_euclid(360.0);
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
        room.geo = Some(Geo { latitude: 48.1, longitude: 11.6, heading: 350.0 });
        room
    }

    /// The room's cameras in other coordinates, without markings.
    fn rebuilt(room: &Room, motion: &Isometry2<f64>) -> Room {
        let mut cameras = room.cameras.clone();
        let shift = motion.translation.vector;
        let new_from_old = Isometry3::from_parts(
            Translation3::new(shift.x, shift.y, 0.0),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), motion.rotation.angle()),
        );
        for camera in &mut cameras {
            camera.camera.camera_from_world *= new_from_old.inverse();
        }
        Room { cameras, ..Room::default() }
    }

    #[test]
    fn markings_stay_to_the_bit_where_a_build_differs_by_little() {
        let before = marked();
        let mut room = rebuilt(&before, &Isometry2::new(Vector2::new(0.02, -0.03), 0.01));
        assert_eq!(take_over(&mut room, Some(before.clone()), None), None);
        assert_eq!((&room.zones, &room.lines, &room.geo), (&before.zones, &before.lines, &before.geo));
    }

    #[test]
    fn markings_move_with_the_coordinates_and_so_does_the_place_on_earth() {
        let before = marked();
        let motion = Isometry2::new(Vector2::new(12.0, -7.0), 2.0);
        let mut room = rebuilt(&before, &motion);
        // One of three cameras was installed elsewhere meanwhile.
        room.cameras[0].camera.camera_from_world *= Isometry3::translation(3.0, 0.0, 0.0);
        let told = take_over(&mut room, Some(before.clone()), None).unwrap();
        assert!(told.contains("114.6°"), "{told}");
        for (old, new) in before.zones[0].polygon.0.iter().zip(&room.zones[0].polygon.0) {
            assert!((motion * old - new).norm() < 1e-9, "{old} {new}");
        }
        assert!((motion * before.lines[0].points[1] - room.lines[0].points[1]).norm() < 1e-9);
        // The same corner is at the same place on Earth: 1e-7° are a centimetre.
        let [old, new] = [&before, &room]
            .map(|room| room.geo.as_ref().unwrap().longitude_latitude(&room.zones[0].polygon.0[2]));
        assert!(old.iter().zip(new).all(|(old, new)| (old - new).abs() < 1e-7), "{old:?} {new:?}");
    }

    #[test]
    fn one_camera_of_two_that_moved_moves_nothing() {
        let before = marked();
        let mut room = rebuilt(&before, &Isometry2::identity());
        room.cameras.truncate(2);
        room.cameras[0].camera.camera_from_world *= Isometry3::translation(3.0, 0.0, 0.0);
        assert_eq!(take_over(&mut room, Some(before.clone()), None), None);
        assert_eq!(room.zones, before.zones);
    }
}
