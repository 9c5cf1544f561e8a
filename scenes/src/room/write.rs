//! Writing of a [`Room`] as a room directory.

use std::path::Path;

use calib::files::write_together;

use super::scene_file::SceneFile;
use super::{GEOMETRY_FILE, Room, SCENE_FILE};
use crate::geometry::ply;
use crate::{Error, Result};

impl Room {
    /// Writes `scene.toml` and, if there is geometry, `room.ply`: both or neither. The directory is made if need be;
    /// other files in it are left alone. Every number reads back as it was (rotations to 1e-12, since they are made
    /// orthonormal again).
    ///
    /// # Errors
    /// [`Error::Room`] when the room is not valid, [`Error::Calib`] when a file cannot be written.
    pub fn write(&self, dir: &Path) -> Result<()> {
        self.validate()?;
        let scene = toml::to_string(&SceneFile::of(self, GEOMETRY_FILE))
            .map_err(|e| Error::Room { place: SCENE_FILE.into(), problem: e.to_string() })?;
        let (scene_path, geometry_path) = (dir.join(SCENE_FILE), dir.join(GEOMETRY_FILE));
        let geometry = self.geometry.as_ref().map(ply::encode).transpose()?;
        // The geometry takes its name first: an older scene.toml beside a newer geometry still reads.
        let mut files: Vec<(&Path, &[u8])> = Vec::with_capacity(2);
        if let Some(bytes) = &geometry {
            files.push((&geometry_path, bytes));
        }
        files.push((&scene_path, scene.as_bytes()));
        Ok(write_together(&files)?)
    }
}
