//! The room: cameras, zones, floor and geometry, and the directory that holds them.

mod read;
mod rezone;
mod scene_file;
#[cfg(test)]
mod tests;
mod validate;
mod write;

use std::path::PathBuf;

use calib::Camera;
use serde::{Deserialize, Serialize};

use crate::geometry::Geometry;
use crate::polygon::Polygon;
use crate::{Error, Result};

pub use read::read_zones;
pub use rezone::{SceneVersion, replace_zones};

/// The file of a room directory that names all others.
pub const SCENE_FILE: &str = "scene.toml";
/// Where [`Room::write`] puts the geometry.
pub const GEOMETRY_FILE: &str = "room.ply";

/// A room with its cameras. World coordinates: metres, Z up, the floor is z = 0.
#[derive(Debug, Clone, Default)]
pub struct Room {
    /// The cameras, in file order.
    pub cameras: Vec<RoomCamera>,
    /// Where people appear and disappear.
    pub zones: Vec<Zone>,
    /// Where a person can stand, when somebody said so; otherwise derived from the geometry.
    pub walkable: Option<Vec<Polygon>>,
    /// What stands in the room; without it nothing is hidden by the room.
    pub geometry: Option<Geometry>,
}

/// A fixed camera of a room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomCamera {
    /// Unique in the room.
    pub name: String,
    /// Intrinsics and pose (`camera_from_world`, metres).
    pub camera: Camera,
    /// The image at the installed pose, relative to the room directory.
    pub reference: Option<PathBuf>,
}

/// A region of the floor where people may appear and disappear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// For people.
    pub name: String,
    /// On the floor, metres.
    pub polygon: Polygon,
    /// Which way people pass.
    #[serde(default)]
    pub kind: ZoneKind,
}

/// Which way people pass a zone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ZoneKind {
    /// People appear here, and never leave through it.
    Entry,
    /// People leave here, and never appear in it.
    Exit,
    /// Both ways.
    #[default]
    Both,
}

impl Room {
    /// The camera of that name.
    ///
    /// # Errors
    /// [`Error::UnknownCamera`], listing the names there are.
    pub fn camera(&self, name: &str) -> Result<&RoomCamera> {
        self.cameras.iter().find(|c| c.name == name).ok_or_else(|| Error::UnknownCamera {
            name: name.to_owned(),
            known: self.cameras.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", "),
        })
    }
}
