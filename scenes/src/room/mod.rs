//! The room: cameras, zones, regions, lines, floor and geometry, and the directory that holds them.

mod drawing;
mod edit;
mod geo;
mod marking;
mod odd_sizes;
mod read;
mod scene_file;
mod source;
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

pub use edit::{
    Drawing, Edited, EditedDrawing, MovedCamera, OnConflict, SavedDrawing, SceneVersion, save_drawing,
    save_moved_camera,
};
pub use geo::Geo;
pub use marking::{Line, Region};
pub use read::{Markings, files_of, read_markings};
pub use source::Source;

/// Name of the file of a room directory that names all others.
pub const SCENE_FILE: &str = "scene.toml";
/// Name of the file to which [`Room::write`] writes the geometry.
pub const GEOMETRY_FILE: &str = "room.ply";

/// A room with its cameras. World coordinates: metres, Z up, the floor is z = 0.
#[derive(Debug, Clone, Default)]
pub struct Room {
    /// The cameras, in file order.
    pub cameras: Vec<RoomCamera>,
    /// Regions where people appear and disappear.
    pub zones: Vec<Zone>,
    /// Regions where people are counted and timed.
    pub regions: Vec<Region>,
    /// Lines at which people are counted as they cross them.
    pub lines: Vec<Line>,
    /// Place of the room on Earth, if stated.
    pub geo: Option<Geo>,
    /// Shift from the world of the imported model to the room's, if it was imported with one.
    pub source: Option<Source>,
    /// Regions where a person can stand, if stated; otherwise they are derived from the geometry.
    pub walkable: Option<Vec<Polygon>>,
    /// Geometry of the room; without it the room hides nothing.
    pub geometry: Option<Geometry>,
}

/// A fixed camera of a room.
#[derive(Debug, Clone, PartialEq)]
pub struct RoomCamera {
    /// Name, unique in the room.
    pub name: String,
    /// Intrinsics and pose (`camera_from_world`, metres).
    pub camera: Camera,
    /// Reference image at the installed pose, relative to the room directory.
    pub reference: Option<PathBuf>,
}

/// A region of the floor where people may appear and disappear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// Name to show to people.
    pub name: String,
    /// Region on the floor, metres.
    pub polygon: Polygon,
    /// Direction in which people pass.
    #[serde(default)]
    pub kind: ZoneKind,
}

/// Direction in which people pass a zone.
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
    /// Camera of that name.
    ///
    /// # Errors
    /// [`Error::UnknownCamera`], listing the existing names.
    pub fn camera(&self, name: &str) -> Result<&RoomCamera> {
        self.cameras.iter().find(|c| c.name == name).ok_or_else(|| Error::UnknownCamera {
            name: name.to_owned(),
            known: self.cameras.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", "),
        })
    }
}
