//! Another pose of one camera in a `scene.toml`, and the picture that was taken there.

use std::path::{Path, PathBuf};

use calib::files::{rows_of_matrix, write_together};
use nalgebra::Isometry3;
use toml_edit::{Array, DocumentMut, Item, TableLike, Value};

use super::tables::set_value;
use super::{as_ended, refuse_what_is_not_ours_to_write};
use crate::room::RoomCamera;
use crate::room::read::{room_without_geometry, scene_file_in};
use crate::{Error, Result};

/// A camera that stands elsewhere now.
#[derive(Debug, Clone, Copy)]
pub struct MovedCamera<'a> {
    /// The camera as it was read.
    pub before: &'a RoomCamera,
    /// Its present pose, metres.
    pub camera_from_world: Isometry3<f64>,
    /// Content of a picture file that was taken at the present pose.
    pub picture: &'a [u8],
    /// Ending of the picture's file name, without the dot.
    pub ending: &'a str,
}

/// Saves a camera's present pose, and the picture that was taken there as its reference picture. Returns the picture's
/// path, relative to the room directory.
///
/// The picture gets a name of its own, so that pose and reference picture change in one step, that of `scene.toml`; the
/// old picture stays. In `scene.toml` only `rotation`, `translation` and `reference` of the camera change.
///
/// # Errors
/// [`Error::Conflict`] when the camera has another pose or picture in the file by now. [`Error::File`] when the file
/// cannot be parsed, must not be written, or is a link; [`Error::File`] or [`Error::Calib`] when it cannot be read or
/// written.
pub fn save_moved_camera(dir: &Path, moved: &MovedCamera) -> Result<PathBuf> {
    let path = scene_file_in(dir)?;
    refuse_what_is_not_ours_to_write(&path)?;
    let text = calib::files::read_text(&path)?;
    let (present, _) = room_without_geometry(&path, &text)?;
    let name = &moved.before.name;
    if present.camera(name).ok() != Some(moved.before) {
        let conflicts = format!("camera `{name}`: another program has changed it meanwhile");
        return Err(Error::Conflict { path, conflicts });
    }
    let reference = fresh_picture(dir, moved.before, moved.ending);
    let unreadable = |problem: String| Error::content(&path, format!("camera `{name}`"), problem);
    let Some(relative) = reference.to_str() else {
        return Err(unreadable("the path of its reference picture is no text; rename it".into()));
    };
    let mut document: DocumentMut =
        text.parse().map_err(|e: toml_edit::TomlError| unreadable(e.message().replace('\n', " ")))?;
    let Some(table) = table_of(&mut document, name) else {
        return Err(unreadable("its table was not found".into()));
    };
    let pose = &moved.camera_from_world;
    let rows = rows_of_matrix(pose.rotation.to_rotation_matrix().matrix());
    set_value(table, "rotation", rows.iter().map(|row| Array::from_iter(*row)).collect());
    set_value(table, "translation", pose.translation.vector.iter().copied().collect());
    set_value(table, "reference", Value::from(relative));
    let rewritten = as_ended(&text, &document);
    let (room, _) = room_without_geometry(&path, &rewritten)?;
    room.validate()?;
    // The picture takes its name first: an older scene.toml does not name it.
    write_together(&[(&dir.join(&reference), moved.picture), (&path, rewritten.as_bytes())])?;
    Ok(reference)
}

/// Table of the camera of this name, in either form of a list of tables.
fn table_of<'a>(document: &'a mut DocumentMut, name: &str) -> Option<&'a mut dyn TableLike> {
    let is_it = |table: &dyn TableLike| table.get("name").and_then(Item::as_str) == Some(name);
    match document.get_mut("camera")? {
        Item::ArrayOfTables(tables) => {
            tables.iter_mut().find(|table| is_it(*table)).map(|table| table as &mut dyn TableLike)
        }
        Item::Value(Value::Array(tables)) => tables
            .iter_mut()
            .filter_map(Value::as_inline_table_mut)
            .find(|table| is_it(*table))
            .map(|table| table as &mut dyn TableLike),
        _ => None,
    }
}

/// Path of a picture that is not there yet, beside the camera's present one, relative to the room directory.
fn fresh_picture(dir: &Path, camera: &RoomCamera, ending: &str) -> PathBuf {
    let present = camera.reference.as_deref().filter(|path| path.is_relative());
    let folder = present.and_then(Path::parent).unwrap_or(Path::new("reference"));
    let named = |number: u64| folder.join(format!("{}-{number}.{ending}", camera.name));
    // There are fewer files than numbers.
    let number = (2..=u64::MAX).find(|number| dir.join(named(*number)).symlink_metadata().is_err());
    named(number.unwrap_or(2))
}
