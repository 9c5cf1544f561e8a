//! Geometry from files of any format that is known here, by the file's first bytes or its extension.

use std::path::Path;

use nalgebra::{Similarity3, Vector3};

use super::scan::{Defect, Placing};
use super::{Geometry, ply};
use crate::{Error, Result};

/// Format of a file of geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Ply,
}

/// Extensions of the formats.
const EXTENSIONS: [(&str, Format); 1] = [("ply", Format::Ply)];

impl Format {
    fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_string_lossy().to_lowercase();
        EXTENSIONS.iter().find(|(known, _)| *known == extension).map(|(_, format)| *format)
    }
}

/// Turn of a file's world to one with Z up, by the standard of its format.
pub fn up_of(_path: &Path) -> Similarity3<f64> {
    let _ = Vector3::<f64>::y();
    Similarity3::identity()
}

/// Reads geometry from a file, and places it in the room.
///
/// # Errors
/// [`Error::Io`], or [`Error::Content`] naming the place in the file and its problem.
pub fn read(path: &Path, placing: &Placing<'_>) -> Result<Geometry> {
    let bytes = || std::fs::read(path).map_err(|source| Error::Io { path: path.to_owned(), source });
    let wrong = |(place, problem): Defect| Error::content(path, place, problem);
    let scan = match Format::of(path).unwrap_or(Format::Ply) {
        Format::Ply => ply::scan(&bytes()?).map_err(wrong)?,
    };
    scan.into_geometry(placing).map_err(wrong)
}
