//! Cache of derived walkable maps, like that of the depth maps.

use std::path::Path;

use nalgebra::Point2;

use super::{Grid, WalkableMap, WalkableOptions};
use crate::room::Room;
use crate::{Result, cache};

/// Part of the key: change it when the derivation changes.
const DERIVATION: &str = "walkable 4";
const NAME: &str = "walkable";

/// [`WalkableMap::of_room`], from the cache of the room directory where that is up to date.
///
/// Only maps that are derived from geometry are cached; the others take no time.
///
/// # Errors
/// As [`WalkableMap::of_room`].
pub fn cached(room_dir: &Path, room: &Room) -> Result<WalkableMap> {
    let (Some(geometry), None) = (&room.geometry, &room.walkable) else { return WalkableMap::of_room(room) };
    let eyes: Vec<_> = room.cameras.iter().map(|c| c.camera.center()).collect();
    let polygons: Vec<_> = room.zones.iter().map(|zone| &zone.polygon).collect();
    // Rust prints floats so that they read back exactly, so the text stands for the values.
    let made_from = format!(
        "{DERIVATION} {} {eyes:?} {polygons:?} {:?}",
        geometry.shape_hash(),
        WalkableOptions::default()
    );
    let key = blake3::hash(made_from.as_bytes());
    if let Some(map) = cache::read(room_dir, NAME, &key).and_then(|bytes| decode(&bytes)) {
        return Ok(map);
    }
    let map = WalkableMap::of_room(room)?;
    cache::write(room_dir, NAME, &key, &encode(&map));
    Ok(map)
}

/// Serialises origin, cell, columns, rows (eight bytes each, little endian), then a byte a cell; empty for everywhere.
fn encode(map: &WalkableMap) -> Vec<u8> {
    let Some(grid) = &map.grid else { return Vec::new() };
    let mut bytes = Vec::with_capacity(40 + grid.bits.len());
    for value in [grid.origin.x, grid.origin.y, grid.cell_m] {
        bytes.extend(value.to_le_bytes());
    }
    for count in [grid.columns, grid.rows] {
        bytes.extend((count as u64).to_le_bytes());
    }
    bytes.extend(grid.bits.iter().map(|bit| u8::from(*bit)));
    bytes
}

fn decode(bytes: &[u8]) -> Option<WalkableMap> {
    if bytes.is_empty() {
        return Some(WalkableMap::everywhere());
    }
    let (head, bits) = bytes.split_at_checked(40)?;
    let (words, _) = head.as_chunks::<8>();
    let number = |i: usize| f64::from_le_bytes(words[i]);
    let count = |i: usize| usize::try_from(u64::from_le_bytes(words[i])).ok();
    let (columns, rows) = (count(3)?, count(4)?);
    let grid = Grid {
        origin: Point2::new(number(0), number(1)),
        cell_m: number(2),
        columns,
        rows,
        bits: bits.iter().map(|bit| *bit != 0).collect(),
    };
    (columns.checked_mul(rows)? == bits.len()).then_some(WalkableMap { grid: Some(grid) })
}

#[cfg(test)]
mod tests {
    use super::super::tests::furnished;
    use super::*;
    use crate::polygon::Polygon;

    #[test]
    fn cached_maps_are_reused_until_the_room_changes() {
        let (folder, mut room) = (tempfile::tempdir().unwrap(), furnished());
        let fresh = WalkableMap::of_room(&room).unwrap();
        assert_eq!(cached(folder.path(), &room).unwrap(), fresh);
        assert!(cache::file_of(folder.path(), NAME).is_file());
        assert_eq!(cached(folder.path(), &room).unwrap(), fresh);

        // A map that no derivation makes, under the same key: reading it back proves that the cache is used.
        let file = cache::file_of(folder.path(), NAME);
        let bytes = std::fs::read(&file).unwrap();
        let (magic_and_key, _) = bytes.split_at(18 + 32);
        let mut planted = magic_and_key.to_vec();
        planted.extend(blake3::hash(magic_and_key).as_bytes());
        std::fs::write(&file, planted).unwrap();
        assert_eq!(cached(folder.path(), &room).unwrap(), WalkableMap::everywhere());

        room.cameras[0].camera.camera_from_world.translation.z += 0.1;
        assert!(cached(folder.path(), &room).unwrap().area_m2().is_some());
        room.walkable = Some(vec![Polygon::rectangle(Point2::origin(), Point2::new(1.0, 1.0))]);
        assert_eq!(cached(folder.path(), &room).unwrap(), WalkableMap::of_room(&room).unwrap());
    }

    #[test]
    fn bytes_that_are_no_map_are_refused() {
        let map = WalkableMap::of_polygons(&[Polygon::rectangle(Point2::origin(), Point2::new(0.2, 0.3))]);
        let bytes = encode(&map);
        assert_eq!(decode(&bytes), Some(map));
        for length in 1..bytes.len() {
            assert_eq!(decode(&bytes[..length]), None);
        }
    }
}
