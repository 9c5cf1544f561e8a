//! Check of the commands' outputs: none takes the place of an input, and one process at a time writes to a folder.

use std::path::{Path, PathBuf};

use shell::files::{FolderLock, OutputError, Outputs};

use crate::source::NamedSource;

/// Paths of what a source reads: a file, or a folder and what is in it. Streams and devices have names of no file.
pub(super) fn paths_of(spec: &str) -> Vec<PathBuf> {
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

/// Paths of what sources read.
pub(super) fn paths_of_all<'a>(sources: impl IntoIterator<Item = &'a NamedSource>) -> Vec<PathBuf> {
    sources.into_iter().flat_map(|source| paths_of(&source.spec)).collect()
}

/// Refuses an output that is, or holds, one of these inputs.
///
/// # Errors
/// [`OutputError`] with the output and the mend.
pub(super) fn refuse_inputs<P: AsRef<Path>>(
    output: &Path,
    inputs: impl IntoIterator<Item = P>,
) -> Result<(), OutputError> {
    Outputs::new([output]).refuse(inputs)
}

/// The lock of a folder of results. A new folder is not made before all inputs have been checked, so there are two times
/// at which it can be locked.
#[derive(Debug)]
pub(super) struct OutputLock<'a> {
    folder: &'a Path,
    lock: Option<FolderLock>,
}

impl<'a> OutputLock<'a> {
    /// Locks the folder, if it exists.
    ///
    /// # Errors
    /// A folder to which another process writes; the error names it.
    pub(super) fn if_present(folder: &'a Path) -> anyhow::Result<Self> {
        let mut lock = Self { folder, lock: None };
        if folder.is_dir() {
            lock.hold()?;
        }
        Ok(lock)
    }

    /// Locks the folder, unless that has been done.
    ///
    /// # Errors
    /// As [`if_present`](Self::if_present).
    pub(super) fn hold(&mut self) -> anyhow::Result<()> {
        if self.lock.is_none() {
            self.lock = Some(FolderLock::take(self.folder, &work())?);
        }
        Ok(())
    }
}

/// Locks a folder of results.
///
/// # Errors
/// A folder to which another process writes; the error names it.
pub(super) fn lock(folder: &Path) -> anyhow::Result<FolderLock> {
    Ok(FolderLock::take(folder, &work())?)
}

/// Name of the command that writes.
fn work() -> String {
    let command = std::env::args().nth(1).unwrap_or_default();
    format!("tracker {command}").trim_end().to_owned()
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
