//! Saving of what is drawn on the floor (zones, regions, lines, the walkable floor) into a `scene.toml`, with everything
//! else preserved: tables, unknown keys, comments, layout and line ends.
//!
//! People and programs change that file, too, while a drawing is edited. So a save is a three-way merge, and the file is
//! changed as a document (`toml_edit`), not serialised anew. From outside to inside:
//!
//! * [`save_drawing`] — reads, merges, checks, writes. Start here.
//! * [`merge`] — the drawing as it was loaded, as it was edited, and as the file has it now, made into one.
//! * [`tables`] — other tables of one kind in the document; [`floor`] — another `[floor]`.
//! * [`camera`] — another pose and reference picture of one camera.
//! * [`drawn_table`] — what zones, regions and lines have in common.

mod camera;
mod drawn_table;
mod floor;
mod merge;
mod tables;
#[cfg(test)]
mod tests;

use std::path::Path;

use calib::files::write_atomic;
use drawn_table::{is_same, is_same_outline, stated};
use serde::{Deserialize, Serialize};
use toml_edit::DocumentMut;

use super::read::{room_without_geometry, scene_file_in};
use super::validate::{drawn_floor_defect, drawn_zones_defect};
use super::{Line, Region, Room, Zone};
use crate::polygon::Polygon;
use crate::{Error, Result};

pub use camera::{MovedCamera, save_moved_camera};
pub use merge::{Edited, EditedDrawing, OnConflict};

/// Version of a `scene.toml`: a hash of its bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SceneVersion(String);

impl SceneVersion {
    /// Present version of the file of a room directory.
    ///
    /// # Errors
    /// [`Error::File`] when there is no such file, [`Error::File`] when it cannot be read.
    pub fn of(dir: &Path) -> Result<Self> {
        let path = scene_file_in(dir)?;
        let bytes = std::fs::read(&path).map_err(Error::io(&path))?;
        Ok(Self::of_bytes(&bytes))
    }

    fn of_bytes(bytes: &[u8]) -> Self {
        Self(blake3::hash(bytes).to_hex().to_string())
    }
}

/// Everything that is drawn on the floor of a room.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drawing {
    /// Regions where people appear and disappear.
    pub zones: Vec<Zone>,
    /// Regions where people are counted and timed.
    pub regions: Vec<Region>,
    /// Lines at which people are counted.
    pub lines: Vec<Line>,
    /// Polygons of `[floor]`, in which a person can stand. Empty where they are derived from the geometry.
    pub floor: Vec<Polygon>,
}

impl Drawing {
    /// Moves the drawing out of a room, which is then without.
    pub fn take(room: &mut Room) -> Self {
        Self {
            zones: std::mem::take(&mut room.zones),
            regions: std::mem::take(&mut room.regions),
            lines: std::mem::take(&mut room.lines),
            floor: room.walkable.take().unwrap_or_default(),
        }
    }

    /// Puts the drawing into a room.
    pub fn put(self, room: &mut Room) {
        room.zones = self.zones;
        room.regions = self.regions;
        room.lines = self.lines;
        room.walkable = Some(self.floor).filter(|floor| !floor.is_empty());
    }

    /// Drawing of a file's text. Keys that are unknown here are left to the reader of the room.
    fn of_text(text: &str) -> std::result::Result<Self, String> {
        let file: toml::Table = toml::from_str(text).map_err(|e| e.message().to_owned())?;
        Ok(Self {
            zones: stated(&file)?,
            regions: stated(&file)?,
            lines: stated(&file)?,
            floor: floor::stated(&file)?,
        })
    }
}

/// A saved drawing.
#[derive(Debug, Clone, PartialEq)]
pub struct SavedDrawing {
    /// Version of the file from now on.
    pub version: SceneVersion,
    /// The drawing that the file has from now on.
    pub drawing: Drawing,
    /// Whether other programs had changed the drawing, so that it is another than the edited one.
    pub is_merged: bool,
}

/// Saves a drawing that was loaded as `base` and edited since, merged with what the file of the room directory has by
/// now. Only the `[[zone]]`, `[[region]]` and `[[line]]` tables that differ and `[floor]` change; the file is replaced in
/// one step.
///
/// # Errors
/// [`Error::Conflict`] for parts that were changed both here and in the file, unless `on_conflict` says otherwise.
/// [`Error::Room`] for a drawing that no room may have, and for zones that must not be drawn: without a name, with the
/// name of another, not simple, without area. [`Error::File`] when the file cannot be parsed, must not be written, or
/// is a link; [`Error::File`] or [`Error::Calib`] when it cannot be read or written.
pub fn save_drawing(
    dir: &Path,
    base: &Drawing,
    edited: &EditedDrawing,
    on_conflict: OnConflict,
) -> Result<SavedDrawing> {
    let path = scene_file_in(dir)?;
    refuse_what_is_not_ours_to_write(&path)?;
    let text = calib::files::read_text(&path)?;
    let unreadable = |problem: String| Error::content(&path, "drawing", problem.replace('\n', " "));
    let present = Drawing::of_text(&text).map_err(unreadable)?;
    let drawing = merge::merged(base, edited, &present, on_conflict)
        .map_err(|conflicts| Error::Conflict { path: path.clone(), conflicts: conflicts.join("; ") })?;
    let is_new = |zone: &Zone| !present.zones.iter().any(|other| is_same(zone, other));
    let is_new_floor =
        |polygon: &Polygon| !present.floor.iter().any(|other| is_same_outline(&polygon.0, &other.0));
    if let Some((place, problem)) = drawn_zones_defect(&drawing.zones, is_new)
        .or_else(|| drawn_floor_defect(&drawing.floor, is_new_floor))
    {
        return Err(Error::Room { place, problem });
    }
    let rewritten = rewritten(&text, &present, &drawing).map_err(unreadable)?;
    let (room, _) = room_without_geometry(&path, &rewritten)?;
    room.validate()?;
    if rewritten != text {
        write_atomic(&path, rewritten.as_bytes())?;
    }
    let is_merged = !merge::is_as_edited(&drawing, edited);
    Ok(SavedDrawing { version: SceneVersion::of_bytes(rewritten.as_bytes()), drawing, is_merged })
}

/// Refuses links and write-protected files: replacing a link by name would make it a file, and lose the protection.
fn refuse_what_is_not_ours_to_write(path: &Path) -> Result<()> {
    let io = Error::io(path);
    let problem = if path.symlink_metadata().map_err(io)?.is_symlink() {
        "it is a symbolic link; edit the room it leads to, or put a copy here"
    } else if path.metadata().map_err(io)?.permissions().readonly() {
        "it is protected against writing; allow it (chmod u+w), or edit a copy of the room"
    } else {
        return Ok(());
    };
    Err(Error::content(path, "whole file", problem))
}

/// Text of a scene file with another drawing than its present one.
fn rewritten(text: &str, present: &Drawing, drawing: &Drawing) -> std::result::Result<String, String> {
    let mut document: DocumentMut = text.parse().map_err(|e: toml_edit::TomlError| e.message().to_owned())?;
    tables::replace(&mut document, &present.zones, &drawing.zones);
    tables::replace(&mut document, &present.regions, &drawing.regions);
    tables::replace(&mut document, &present.lines, &drawing.lines);
    floor::replace(&mut document, &present.floor, &drawing.floor);
    Ok(as_ended(text, &document))
}

/// Text of a changed document, with the line ends of the `text` that it was parsed from.
fn as_ended(text: &str, document: &DocumentMut) -> String {
    let mut rewritten = document.to_string();
    if !text.ends_with('\n') && rewritten.ends_with('\n') {
        rewritten.pop();
    }
    // The document is written with line feeds alone.
    if text.contains("\r\n") { rewritten.replace('\n', "\r\n") } else { rewritten }
}
