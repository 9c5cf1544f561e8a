//! Pictures of another program's model on disk.

use std::path::{Path, PathBuf};

/// Extensions tried for pictures that are named without one, as in the synthetic scenes of `NeRF`.
const EXTENSIONS: [&str; 6] = ["png", "jpg", "jpeg", "PNG", "JPG", "JPEG"];

/// Folders that hold a model's pictures.
#[derive(Debug, Clone, Default)]
pub struct Pictures {
    /// Folders that are searched, the first first.
    pub folders: Vec<PathBuf>,
}

impl Pictures {
    /// File of a picture that a model names: by its path below one of the folders, or by fewer and fewer of its own
    /// folders.
    pub fn find(&self, picture: &str) -> Option<PathBuf> {
        let path = picture.replace('\\', "/");
        let parts: Vec<&str> = path.split('/').filter(|part| !["", "."].contains(part)).collect();
        let mut ends = (0..parts.len()).map(|first| parts[first..].iter().collect::<PathBuf>());
        ends.find_map(|end| self.folders.iter().find_map(|folder| existing(&folder.join(&end))))
    }
}

fn existing(path: &Path) -> Option<PathBuf> {
    if path.is_file() {
        return Some(path.to_owned());
    }
    EXTENSIONS
        .iter()
        .map(|extension| PathBuf::from(format!("{}.{extension}", path.display())))
        .find(|candidate| candidate.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_found_below_the_folders_and_by_their_file_names() {
        let folder = tempfile::tempdir().unwrap();
        let put = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, name).unwrap();
            path
        };
        let (whole, flat, bare) = (put("images/left/1.jpg"), put("images/2.jpg"), put("train/r_0.png"));
        let pictures = Pictures { folders: vec![folder.path().to_owned(), folder.path().join("images")] };
        for (name, expected) in [
            ("images/left/1.jpg", Some(&whole)),
            ("left/1.jpg", Some(&whole)),
            (r"left\1.jpg", Some(&whole)),
            ("images_4/2.jpg", Some(&flat)),
            ("./train/r_0", Some(&bare)),
            ("1.jpg", None),
            ("", None),
        ] {
            assert_eq!(pictures.find(name).as_ref(), expected, "{name}");
        }
    }
}
