//! Geometry from files of any format that is known here, told by the file's first bytes or by its extension.

use std::io::Read;
use std::path::Path;

use nalgebra::{Similarity3, Vector3};

use super::scan::{Defect, Placing};
use super::{Geometry, gltf, las, obj, ply};
use crate::exchange::placement::upright;
use crate::{Error, Result};

/// Format of a file of geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Ply,
    Obj,
    Gltf,
    Las,
}

/// First bytes of the formats that have some.
const MAGICS: [(&[u8], Format); 3] = [(b"ply", Format::Ply), (b"glTF", Format::Gltf), (b"LASF", Format::Las)];
/// Extensions of the formats.
const EXTENSIONS: [(&str, Format); 6] = [
    ("ply", Format::Ply),
    ("obj", Format::Obj),
    ("gltf", Format::Gltf),
    ("glb", Format::Gltf),
    ("las", Format::Las),
    ("laz", Format::Las),
];

impl Format {
    fn of(path: &Path) -> Result<Self> {
        let io = Error::io(path);
        let mut begin = Vec::new();
        std::fs::File::open(path).map_err(io)?.take(4).read_to_end(&mut begin).map_err(io)?;
        let by_magic = MAGICS.iter().find(|(magic, _)| begin.starts_with(magic)).map(|(_, format)| *format);
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let by_extension =
            EXTENSIONS.iter().find(|(known, _)| *known == extension).map(|(_, format)| *format);
        by_magic.or(by_extension).ok_or_else(|| {
            let known = EXTENSIONS.map(|(known, _)| format!(".{known}")).join(", ");
            let problem = format!("the format is not known here; export the geometry as one of {known}");
            Error::content(path, "whole file", problem)
        })
    }
}

/// Turn of a file's world to one with Z up, where the standard of its format says that another axis is.
pub fn z_up_from_file(path: &Path) -> Similarity3<f64> {
    let is_y_up = Format::of(path).is_ok_and(|format| format == Format::Gltf);
    let turn = if is_y_up { upright(Vector3::y()) } else { None };
    turn.map_or_else(Similarity3::identity, |turn| {
        Similarity3::from_parts(Vector3::zeros().into(), turn, 1.0)
    })
}

/// Reads geometry from a file, and places it in the room.
///
/// # Errors
/// [`Error::File`] naming the place in the file and its problem.
pub fn read(path: &Path, placing: &Placing<'_>) -> Result<Geometry> {
    let bytes = || std::fs::read(path).map_err(Error::io(path));
    let wrong = |(place, problem): Defect| Error::content(path, place, problem);
    let scan = match Format::of(path)? {
        Format::Ply => ply::scan(&bytes()?),
        Format::Obj => obj::scan(path, &bytes()?),
        Format::Gltf => gltf::scan(path, &bytes()?),
        Format::Las => {
            return las::placed_scan(path, placing)
                .and_then(|scan| scan.placed_geometry(placing))
                .map_err(wrong);
        }
    };
    scan.and_then(|scan| scan.into_geometry(placing)).map_err(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_content_and_extension_and_others_refused() {
        let folder = tempfile::tempdir().unwrap();
        let put_and_read = |name: &str, content: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            read(&path, &Placing::default()).map_err(|e| e.to_string())
        };
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        assert_eq!(put_and_read("a.OBJ", triangle).unwrap().len(), 1);
        let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 1\n";
        assert_eq!(put_and_read("cloud.txt", ply).unwrap().len(), 1);
        assert_eq!(put_and_read("cloud.obj", "v 0 0 0\nv 1 0 0\n").unwrap().len(), 2);
        for (name, words) in
            [("a.e57", ".laz"), ("a.glb", "glTF"), ("a.las", "LAS"), ("a.ply", "no PLY"), ("a", ".obj")]
        {
            let said = put_and_read(name, "xxxxxxxx").unwrap_err();
            assert!(said.contains(name) && said.contains(words) && !said.contains('\n'), "{said}");
        }
        assert!(read(&folder.path().join("none.ply"), &Placing::default()).is_err());
    }
}
