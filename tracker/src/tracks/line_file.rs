//! A text file that grows by whole lines and can be read during that time.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Writer that creates its file with the first lines, so that a run that fails before leaves older results alone.
#[derive(Debug)]
pub(super) struct LineFile {
    path: PathBuf,
    file: Option<File>,
    /// Number of bytes of whole lines.
    length: u64,
}

impl LineFile {
    pub(super) fn new(path: PathBuf) -> Self {
        Self { path, file: None, length: 0 }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Appends whole lines (or nothing) and passes them to the operating system at once. After a failure, such as a
    /// full disk, the file ends with the last line before, and later lines continue there.
    pub(super) fn append(&mut self, lines: &str) -> Result<()> {
        let mut file = if let Some(file) = self.file.take() {
            file
        } else {
            if let Some(folder) = self.path.parent() {
                std::fs::create_dir_all(folder).map_err(Error::io(folder))?;
            }
            File::create(&self.path).map_err(Error::io(&self.path))?
        };
        if let Err(source) = file.write_all(lines.as_bytes()) {
            // Truncating may fail, too; the first failure is the one to report.
            let _ = file.set_len(self.length);
            return Err(Error::Io { path: self.path.clone(), source });
        }
        self.length += lines.len() as u64;
        self.file = Some(file);
        Ok(())
    }
}
