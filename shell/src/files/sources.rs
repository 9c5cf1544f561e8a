//! Paths behind the names of sources: of films, folders and patterns of pictures.

use std::path::{Path, PathBuf};

/// Paths of what a source reads: a file, or a folder and what is in it. Streams and devices have names of no file.
pub fn paths_of(spec: &str) -> Vec<PathBuf> {
    let path = folder_or_file(spec);
    let entries = std::fs::read_dir(&path).into_iter().flatten().flatten();
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    paths.push(path);
    paths
}

/// The file or folder of a source; of a pattern, the folder of its pictures.
fn folder_or_file(spec: &str) -> PathBuf {
    let path = Path::new(spec);
    let is_pattern = spec.contains('%') && !spec.contains("://") && !path.exists();
    match path.parent().filter(|_| is_pattern) {
        Some(folder) if folder.as_os_str().is_empty() => ".".into(),
        Some(folder) => folder.to_owned(),
        None => path.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_reads_its_folder() {
        for (spec, path) in [
            ("frames/%04d.png", "frames"),
            ("%04d.png", "."),
            ("film.mp4", "film.mp4"),
            ("rtsp://camera/a%20b", "rtsp://camera/a%20b"),
            ("0", "0"),
        ] {
            assert_eq!(folder_or_file(spec), Path::new(path), "{spec}");
        }
    }
}
