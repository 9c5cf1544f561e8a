//! Folder of a test, in which programs run.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use image::RgbImage;
use tempfile::TempDir;
use tests::data::program;

/// `[[camera]]` of a `scene.toml`: a small camera that looks over the floor; the first number of its translation.
macro_rules! camera_table {
    ($name:literal, $x:literal) => {
        concat!(
            "\n[[camera]]\nname = \"",
            $name,
            "\"\nwidth = 64\nheight = 48\n",
            "matrix = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]\n",
            "distortion = [0.0, 0.0, 0.0, 0.0, 0.0]\n",
            "rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]\n",
            "translation = [",
            $x,
            ", 1.2, 3.0]\n"
        )
    };
}
/// `[[zone]]` of a `scene.toml`.
macro_rules! door_table {
    () => {
        "\n[[zone]]\nname = \"door\"\npolygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]\n"
    };
}
pub(crate) use {camera_table, door_table};

pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Writes a file, and makes the folder it is in.
    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.with_parent(name), content).expect("a file");
    }

    pub(crate) fn picture(&self, name: &str, picture: &RgbImage) {
        picture.save(self.with_parent(name)).expect("a picture");
    }

    /// Runs one of the programs in the folder.
    pub(crate) fn run_program(&self, name: &str, arguments: &[&str]) -> Output {
        program(name).current_dir(self.0.path()).args(arguments).output().expect("the program starts")
    }

    /// All files of the folder with their content, in order.
    pub(crate) fn files(&self) -> Vec<(PathBuf, Vec<u8>)> {
        let mut files = Vec::new();
        list(self.0.path(), &mut files);
        files.sort();
        files
    }

    fn with_parent(&self, name: &str) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("below the temporary folder")).expect("a folder");
        path
    }
}

fn list(folder: &Path, files: &mut Vec<(PathBuf, Vec<u8>)>) {
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files.push((path.clone(), Vec::new()));
            list(&path, files);
        } else {
            let content = fs::read(&path).expect("a file");
            files.push((path, content));
        }
    }
}
