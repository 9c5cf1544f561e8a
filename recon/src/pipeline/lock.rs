//! One command that changes a room at a time.

use std::path::Path;
use std::time::Duration;

use shell::files::{FolderLock, LockError};

use crate::{Error, Result};

/// Locks a room for one `command` that changes it at a time, by a file in the folder that it is, or will be, in: the room itself is replaced.
/// `None` in a folder that cannot be written: the command reports it when it writes the room.
///
/// # Errors
/// [`Error::Room`] where another command has the lock.
pub fn lock_room(out: &Path, command: &str) -> Result<Option<FolderLock>> {
    let absolute = std::path::absolute(out).map_err(Error::io(out))?;
    let above = absolute.ancestors().skip(1).find(|folder| folder.is_dir()).unwrap_or(Path::new("/"));
    let name = absolute.file_name().unwrap_or_default().to_string_lossy();
    let file = above.join(format!(".{name}{}", FolderLock::NAME));
    match FolderLock::take_file(&file, out, command, Duration::ZERO) {
        Ok(lock) => Ok(Some(lock)),
        Err(LockError::Io { .. }) => Ok(None),
        Err(held) => Err(Error::Room(held.to_string())),
    }
}
