//! Lock of a command's folder of results, by the name of the command.

use std::path::Path;

use super::{FolderLock, LockError};
use crate::program;

/// The lock of a folder of results. A new folder is not made before all inputs have been checked, so there are two times
/// at which it can be locked.
#[derive(Debug)]
pub struct OutputLock<'a> {
    folder: &'a Path,
    lock: Option<FolderLock>,
}

impl<'a> OutputLock<'a> {
    /// Locks the folder, if it exists.
    ///
    /// # Errors
    /// A folder to which another process writes; the error names it.
    pub fn if_present(folder: &'a Path) -> Result<Self, LockError> {
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
    pub fn hold(&mut self) -> Result<(), LockError> {
        if self.lock.is_none() {
            self.lock = Some(FolderLock::take(self.folder, &program::command())?);
        }
        Ok(())
    }
}

/// Locks a folder of results.
///
/// # Errors
/// A folder to which another process writes; the error names it.
pub fn lock(folder: &Path) -> Result<FolderLock, LockError> {
    FolderLock::take(folder, &program::command())
}
