//! Checks of the invariants of a room.

use shell::ranges::ROOM_M;

use super::drawing::{name_defect, outline_defect};
use super::{Room, RoomCamera, Zone, marking};
use crate::polygon::Polygon;
use crate::{Error, Result};

impl Room {
    /// Checks the invariants that every other part of the program relies on.
    ///
    /// # Errors
    /// [`Error::Room`] for the first defect: no camera, names that are empty, doubled or no file names, numbers that
    /// are not finite, polygons without area, geometry that cannot be intersected.
    pub fn validate(&self) -> Result<()> {
        self.defect().map_or(Ok(()), |(place, problem)| Err(Error::Room { place, problem }))
    }

    /// First defect of the room: its place, and the problem.
    pub(super) fn defect(&self) -> Option<(String, String)> {
        if self.cameras.is_empty() {
            return Some(("camera".into(), "there is no [[camera]]; a room needs at least one".into()));
        }
        for (i, camera) in self.cameras.iter().enumerate() {
            let defect = camera_defect(camera).or_else(|| {
                let doubled = self.cameras[..i].iter().any(|other| other.name == camera.name);
                doubled.then(|| "another camera has the same name; rename one".into())
            });
            if let Some(problem) = defect {
                return Some((camera_place(i, &camera.name), problem));
            }
        }
        for (i, zone) in self.zones.iter().enumerate() {
            if let Some(problem) = zone.polygon.defect() {
                return Some((zone_place(i, &zone.name), problem));
            }
        }
        if let Some(defect) = marking::defect(&self.zones, &self.regions, &self.lines) {
            return Some(defect);
        }
        if let Some(polygons) = &self.walkable {
            if polygons.is_empty() {
                let problem =
                    "the list is empty, so nobody could stand anywhere; remove it or draw a polygon";
                return Some(("floor, walkable".into(), problem.into()));
            }
            for (i, polygon) in polygons.iter().enumerate() {
                if let Some(problem) = polygon.defect() {
                    return Some((floor_place(i), problem));
                }
            }
        }
        if let Some(problem) = self.geo.and_then(|geo| geo.defect()) {
            return Some(("geo".into(), problem));
        }
        if let Some(problem) = self.source.and_then(|source| source.defect()) {
            return Some(("source".into(), problem));
        }
        let geometry = self.geometry.as_ref()?;
        if geometry.is_empty() {
            return Some((
                "geometry".into(),
                "it is empty; leave it out if nothing stands in the room".into(),
            ));
        }
        geometry.defect().map(|(place, problem)| (format!("geometry, {place}"), problem))
    }
}

/// First defect of the new ones of zones: besides the checks of every room, names that are empty or doubled, and outlines
/// that cross themselves. Rooms on disk may have such zones; new ones may not.
pub(super) fn drawn_zones_defect(zones: &[Zone], is_new: impl Fn(&Zone) -> bool) -> Option<(String, String)> {
    zones.iter().enumerate().filter(|(_, zone)| is_new(zone)).find_map(|(i, zone)| {
        let problem = drawn_zone_defect(zone).or_else(|| {
            let is_double =
                |(j, other): (usize, &Zone)| other.name == zone.name && (j < i || j > i && !is_new(other));
            let doubled = zones.iter().enumerate().any(is_double);
            doubled.then(|| "another zone has the same name; rename one".into())
        })?;
        Some((zone_place(i, &zone.name), problem))
    })
}

/// First defect of the new ones of the walkable floor's polygons, which may not cross themselves either.
pub(super) fn drawn_floor_defect(
    floor: &[Polygon],
    is_new: impl Fn(&Polygon) -> bool,
) -> Option<(String, String)> {
    let new = floor.iter().enumerate().filter(|(_, polygon)| is_new(polygon));
    new.into_iter().find_map(|(i, polygon)| Some((floor_place(i), outline_defect(polygon)?)))
}

fn drawn_zone_defect(zone: &Zone) -> Option<String> {
    name_defect(&zone.name).or_else(|| outline_defect(&zone.polygon))
}

/// Name of a zone in messages: its place in the list, and its name.
pub(super) fn zone_place(index: usize, name: &str) -> String {
    format!("zone {} (`{name}`)", index + 1)
}

/// Name of a polygon of the walkable floor in messages.
fn floor_place(index: usize) -> String {
    format!("floor, walkable polygon {}", index + 1)
}

/// Name of a camera in messages: its place in the file, and its name.
pub(super) fn camera_place(index: usize, name: &str) -> String {
    format!("camera {} (`{name}`)", index + 1)
}

fn camera_defect(camera: &RoomCamera) -> Option<String> {
    // The name becomes part of file names and of `NAME=PATH` on the command line.
    let name = &camera.name;
    let forbidden = |c: char| matches!(c, '/' | '\\' | '=') || c.is_control();
    if name.is_empty() || name == "." || name == ".." || name.contains(forbidden) {
        return Some("the name is empty or holds `/`, `\\`, `=`; it becomes part of file names".into());
    }
    let intrinsics = &camera.camera.intrinsics;
    if let Err(e) = intrinsics.validate() {
        return Some(e.to_string());
    }
    let pose = &camera.camera.camera_from_world;
    let finite =
        pose.translation.vector.iter().chain(pose.rotation.coords.iter()).all(|value| value.is_finite());
    if !finite {
        return Some("the rotation or translation holds a number that is not finite".into());
    }
    let center = camera.camera.center();
    let numbers = pose.translation.vector.iter().chain(center.iter());
    let problem = numbers.into_iter().find_map(|metres| ROOM_M.defect(*metres))?;
    Some(format!("a number of the translation, or of the place that follows from it, {problem}"))
}
