//! Lock of a folder of results: one process at a time writes to it.

use std::fs::{File, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Interval at which the end of another process is looked for.
const LOOK: Duration = Duration::from_millis(100);
/// Largest part of a lock's text that is read.
const MOST_TEXT: u64 = 200;

/// Error of a folder that cannot be locked.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another process writes there.
    #[error("{}: {holder} writes there; wait until it has ended, or give another folder", .folder.display())]
    Held {
        /// The folder.
        folder: PathBuf,
        /// The process that has the lock.
        holder: String,
    },
    /// The file of the lock cannot be used.
    #[error("{}: {source}", .path.display())]
    Io {
        /// The file of the lock, or its folder.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// The lock of a folder; it is given back when this is dropped.
///
/// The operating system takes the lock from a process that has died in any way, so that the file that a killed program
/// leaves locks nothing: the next program takes it over.
#[derive(Debug)]
pub struct FolderLock {
    path: PathBuf,
    /// The folder, if it was made for the lock.
    made: Option<PathBuf>,
    /// Unlocked when it is closed.
    file: File,
}

impl FolderLock {
    /// Name of the file of a lock.
    pub const NAME: &str = ".lock";

    /// Locks a folder, which is made if need be. `work` names what the process does, as in `tracker run`.
    ///
    /// # Errors
    /// [`LockError`] with the process that has the lock, or the error of the operating system.
    pub fn take(folder: &Path, work: &str) -> Result<Self, LockError> {
        let io = |source| LockError::Io { path: folder.to_owned(), source };
        let is_new = !folder.exists();
        std::fs::create_dir_all(folder).map_err(io)?;
        let made = is_new.then(|| folder.to_owned());
        match Self::take_file(&folder.join(Self::NAME), folder, work, Duration::ZERO) {
            Ok(mut lock) => {
                lock.made = made;
                Ok(lock)
            }
            Err(error) => {
                // It is empty, or else another process writes there.
                let _ = made.as_deref().map(std::fs::remove_dir);
                Err(error)
            }
        }
    }

    /// Locks a folder by a file of another name or place, and waits so long for a process that is ending.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn take_file(path: &Path, folder: &Path, work: &str, patience: Duration) -> Result<Self, LockError> {
        let io = |source| LockError::Io { path: path.to_owned(), source };
        let begun = Instant::now();
        loop {
            let mut file =
                File::options().read(true).write(true).create(true).truncate(false).open(path).map_err(io)?;
            match file.try_lock() {
                Ok(()) => {
                    // The process before may have removed the file between the two calls.
                    if !is_name_of(path, &file).map_err(io)? {
                        continue;
                    }
                    // A file without its text, as on a full disk, is removed again with the lock.
                    let mut lock = Self { path: path.to_owned(), made: None, file };
                    write_holder(&mut lock.file, work).map_err(io)?;
                    return Ok(lock);
                }
                Err(TryLockError::WouldBlock) if begun.elapsed() < patience => std::thread::sleep(LOOK),
                Err(TryLockError::WouldBlock) => {
                    let holder = holder(&mut file).unwrap_or_else(|| "another process".into());
                    return Err(LockError::Held { folder: folder.to_owned(), holder });
                }
                Err(TryLockError::Error(source)) => return Err(io(source)),
            }
        }
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // While it is locked nobody else uses the file. A file that cannot be removed locks nothing.
        let _ = std::fs::remove_file(&self.path);
        // A command that fails before it writes leaves no folder behind; one with results is not removed.
        let _ = self.made.as_deref().map(std::fs::remove_dir);
    }
}

/// Whether a path still leads to an open file.
fn is_name_of(path: &Path, file: &File) -> io::Result<bool> {
    let open = file.metadata()?;
    Ok(path.metadata().is_ok_and(|named| (named.dev(), named.ino()) == (open.dev(), open.ino())))
}

fn write_holder(file: &mut File, work: &str) -> io::Result<()> {
    file.set_len(0)?;
    writeln!(file, "process {} ({work})", std::process::id())
}

/// Text of the process that has a lock.
fn holder(file: &mut File) -> Option<String> {
    let mut text = String::new();
    file.seek(SeekFrom::Start(0)).ok()?;
    file.take(MOST_TEXT).read_to_string(&mut text).ok()?;
    let line = text.lines().next()?.trim();
    line.starts_with("process ").then(|| line.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_process_is_told_of_the_first() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let first = FolderLock::take(&out, "tracker run").unwrap();
        let line = FolderLock::take(&out, "tracker run").unwrap_err().to_string();
        let holder = format!("process {} (tracker run)", std::process::id());
        assert!(line.contains(&holder) && line.contains("out") && line.contains("another folder"), "{line}");
        drop(first);
        assert!(!out.exists(), "a folder without results was made for the lock alone");
        let again = FolderLock::take(&out, "tracker run").unwrap();
        std::fs::write(out.join("result"), "").unwrap();
        drop(again);
        assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1);
    }

    /// Linux has a device that is always full.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_lock_that_cannot_be_written_leaves_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FolderLock::NAME);
        // The device has the name of the file.
        std::os::unix::fs::symlink("/dev/full", &path).unwrap();
        assert!(FolderLock::take(folder.path(), "tracker run").is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn the_lock_of_a_dead_process_is_taken_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(FolderLock::NAME);
        std::fs::write(&path, "process 1 (tracker run)\n").unwrap();
        let lock = FolderLock::take(folder.path(), "recon build").unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text, format!("process {} (recon build)\n", std::process::id()));
        drop(lock);
    }

    #[test]
    fn a_waiting_process_takes_the_lock_of_one_that_ends() {
        let folder = tempfile::tempdir().unwrap();
        let first = FolderLock::take(folder.path(), "first").unwrap();
        let path = folder.path().join(FolderLock::NAME);
        let ends = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(300));
            drop(first);
        });
        FolderLock::take_file(&path, folder.path(), "second", Duration::from_secs(20)).unwrap();
        ends.join().unwrap();
    }
}
