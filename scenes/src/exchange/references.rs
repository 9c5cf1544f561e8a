//! Reference images of imported cameras: pictures of the model, copied into the room.

use std::path::{Path, PathBuf};

use super::{PicturedCamera, Pictures};
use crate::{Error, Result};

/// Folder of a room's reference images.
const FOLDER: &str = "reference";

/// A picture that becomes a reference image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// The picture.
    pub picture: PathBuf,
    /// The reference image, relative to the room directory.
    pub place: PathBuf,
}

/// Finds the pictures of cameras below a folder, and names them in the cameras. A camera whose picture is not there has
/// none, which is worth a warning.
///
/// # Errors
/// [`Error::File`] when not one picture is there, [`Error::Calib`] when one is no picture.
pub fn find(folder: &Path, cameras: &mut [PicturedCamera]) -> Result<Vec<Reference>> {
    let pictures = Pictures { folders: vec![folder.to_owned()] };
    let mut references = Vec::new();
    for PicturedCamera { picture, entry } in &mut *cameras {
        let Some(found) = pictures.find(picture) else {
            tracing::warn!(
                "{}: camera `{}`: there is no picture `{picture}` below it",
                folder.display(),
                entry.name
            );
            continue;
        };
        let (size, k) = (calib::picture::size(&found)?, &entry.camera.intrinsics);
        if size != (k.width, k.height) {
            tracing::warn!(
                "{}: camera `{}`: the picture is {} × {}, not {} × {}; name the folder of the pictures that the model is of",
                found.display(),
                entry.name,
                size.0,
                size.1,
                k.width,
                k.height
            );
        }
        let extension =
            found.extension().map_or_else(|| "jpg".into(), |e| e.to_string_lossy().to_lowercase());
        let place = Path::new(FOLDER).join(format!("{}.{extension}", entry.name));
        entry.reference = Some(place.clone());
        references.push(Reference { picture: found, place });
    }
    if references.is_empty() && !cameras.is_empty() {
        let problem =
            "it holds no picture of the cameras; name the folder that the model's pictures are named from";
        return Err(Error::content(folder, "--images", problem));
    }
    Ok(references)
}

/// Copies reference images into a room directory, each in one step.
///
/// # Errors
/// [`Error::File`] or [`Error::Calib`], naming the file.
pub fn copy(references: &[Reference], dir: &Path) -> Result<()> {
    for Reference { picture, place } in references {
        let bytes = std::fs::read(picture).map_err(Error::io(picture))?;
        calib::files::write_atomic(&dir.join(place), &bytes)?;
    }
    Ok(())
}
