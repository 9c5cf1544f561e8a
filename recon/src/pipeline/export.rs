//! `recon export`: the captures of a built room as a COLMAP model, for programs that reconstruct from pictures with known
//! poses: the frames without distortion, each with its pose, and the sparse points.
//!
//! A build keeps what this needs beside the room's other results ([`super::posed_capture`]). It is keyed by the film alone:
//! another version of the program can export a room that this one has built.

use std::path::Path;

use scenes::exchange::colmap::SparseModel;

use super::cache::{self, film_key};
use super::files_of;
use crate::memory::MemoryBound;
use crate::project::Project;
use crate::{Error, Result};

/// Folder of the pictures in an exported model, and that of its cameras, pictures and points, as COLMAP's
/// `image_undistorter` names them.
const PICTURES: &str = "images";
const SPARSE: &str = "sparse/0";

/// Counts of an exported model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ExportReport {
    /// Number of cameras.
    pub cameras: usize,
    /// Number of pictures, one a frame with a pose.
    pub pictures: usize,
    /// Number of points.
    pub points: usize,
}

/// Writes the captures of the room that was built from a project as a COLMAP model: `images/NAME/NUMBER.jpg` and
/// `sparse/0/`, in the room's coordinates. `memory` is the bound with which the room was built: it decides which frames are used.
///
/// # Errors
/// A folder that holds something already; a capture that the room was not built from, or whose results are no longer kept.
pub fn export(
    project_file: &Path,
    room: &Path,
    out: &Path,
    memory: MemoryBound,
    step: &mut dyn FnMut(usize, usize, &str),
) -> Result<ExportReport> {
    let project = Project::read_to_build(project_file)?;
    check_empty(out)?;
    let files = files_of(&project.cameras, memory)?;
    let mut model = SparseModel::default();
    for (index, file) in files.iter().enumerate() {
        step(index, files.len(), file.name());
        let capture = file.read()?;
        let Some(posed) = cache::posed(room, file.name(), &film_key(&capture)) else {
            let problem = format!(
                "nothing is kept there of camera `{}`'s capture as it is now; build the room from it again with `recon build`, or \
                 give the `--memory` with which it was built",
                file.name()
            );
            return Err(Error::content(room, "cache", problem));
        };
        if !posed.is_of(capture.frames.len()) {
            return Err(Error::content(
                room,
                "cache",
                "it is not whole; build the room again with `recon build`",
            ));
        }
        let posed = posed.in_filmed_pixels(file.size());
        posed.add_to(&mut model, &capture, file.size());
        posed.write_pictures(file, &capture, &out.join(PICTURES))?;
    }
    // The lists come last: a model is whole or has none.
    model.write(&out.join(SPARSE))?;
    step(files.len(), files.len(), "done");
    Ok(ExportReport { cameras: files.len(), pictures: model.pictures.len(), points: model.points.len() })
}

/// Checks that a folder is new or empty: a mixture of two models' pictures would be neither's.
fn check_empty(out: &Path) -> Result<()> {
    if !out.exists() {
        return Ok(());
    }
    let mut entries = std::fs::read_dir(out).map_err(Error::io(out))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(Error::content(out, "--out", "holds other files; name a new folder")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_with_other_files_is_not_mixed_with_a_model() {
        let folder = tempfile::tempdir().unwrap();
        assert!(check_empty(folder.path()).is_ok() && check_empty(&folder.path().join("new")).is_ok());
        std::fs::write(folder.path().join("notes.txt"), "mine").unwrap();
        let line = check_empty(folder.path()).unwrap_err().to_string();
        assert!(line.contains("--out") && line.contains("new folder"), "{line}");
    }
}
