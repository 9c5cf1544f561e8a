//! A text file that grows by whole lines and can be read during that time.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Writer that creates its file with the first lines, so that a run that fails before leaves older results alone.
#[derive(Debug)]
pub(crate) struct LineFile {
    path: PathBuf,
    file: Option<File>,
    /// Number of bytes of whole lines.
    length: u64,
}

impl LineFile {
    pub(crate) fn new(path: PathBuf) -> Self {
        Self { path, file: None, length: 0 }
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends whole lines (or nothing) and passes them to the operating system at once. After a failure, such as a
    /// full disk, the file ends with the last line before, and later lines continue there.
    pub(crate) fn append(&mut self, lines: &str) -> Result<()> {
        let mut file = if let Some(file) = self.file.take() {
            file
        } else {
            if let Some(folder) = self.path.parent() {
                std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
            }
            File::create(&self.path).map_err(Error::io(&self.path))?
        };
        let written = file.write_all(lines.as_bytes());
        if written.is_ok() {
            self.length += lines.len() as u64;
        } else {
            // Cutting may fail, too; the first failure is the one to report.
            let _ = cut(&mut file, self.length);
        }
        self.file = Some(file);
        written.map_err(Error::io(&self.path))
    }
}

/// Cuts a file to a length, bytes, and continues writing there.
fn cut(file: &mut File, length: u64) -> std::io::Result<()> {
    file.set_len(length)?;
    file.seek(SeekFrom::Start(length)).map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_before_a_failure_stay_and_later_ones_follow_them() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines.txt");
        let mut lines = LineFile::new(path.clone());
        lines.append("first\n").unwrap();
        // A handle that cannot write stands for a full disk.
        let writable = lines.file.replace(File::open(&path).unwrap());
        for _ in 0..2 {
            assert!(lines.append("lost\n").unwrap_err().to_string().contains("lines.txt"));
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "first\n");
        }
        // Part of a line was written before the disk was full.
        let mut file = writable.unwrap();
        file.write_all(b"par").unwrap();
        cut(&mut file, lines.length).unwrap();
        lines.file = Some(file);
        lines.append("second\n").unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "first\nsecond\n");
    }
}
