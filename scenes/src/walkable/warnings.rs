//! Parts of a drawing that no person can reach.

use super::WalkableMap;
use crate::room::Room;

/// One line for each zone, region and line of a room to which nobody can come on its walkable floor, with what to do.
pub fn unreachable(room: &Room, walkable: &WalkableMap) -> Vec<String> {
    let area =
        |word: &str, name: &str| format!("{word} `{name}`: nobody can stand in it; move it, or mend [floor]");
    let zones = room.zones.iter().filter(|zone| !walkable.reaches_into(&zone.polygon));
    let regions = room.regions.iter().filter(|region| !walkable.reaches_into(&region.polygon));
    let lines = room.lines.iter().filter(|line| !walkable.reaches_line(line.pieces()));
    zones
        .map(|zone| area("zone", &zone.name))
        .chain(regions.map(|region| area("region", &region.name)))
        .chain(
            lines.map(|line| format!("line `{}`: nobody can cross it; move it, or mend [floor]", line.name)),
        )
        .collect()
}
