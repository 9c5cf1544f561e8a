//! Folder beside a room in which the next one is finished, and what a killed build has left of it.
//!
//! `.recon-XXXXXX` holds the fresh room until it takes the name of the old one, and the old one until the files of others
//! have been moved out of it. A build that is killed in between leaves either behind. The next build of a room in the same
//! folder tells them apart by the number of the fresh room's directory, which is written down before anything else: a
//! fresh room is removed, an old one gives up what is not the builder's.

use std::fs;
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};
use shell::files::FolderLock;
use tempfile::TempDir;

use crate::{Error, Result};

/// Beginning of the folders' names.
const PREFIX: &str = ".recon-";
/// File in such a folder that tells what it is for.
const RECORD: &str = "record.json";
const FRESH: &str = "room";
const BEFORE: &str = "before";
/// Age from which a folder without a record is not one that is just being made.
const SETTLED: Duration = Duration::from_secs(5);

/// A folder in which a room is finished. It is removed when this is dropped.
#[derive(Debug)]
pub(super) struct Workplace {
    /// Unlocked before the folder is removed.
    _lock: FolderLock,
    folder: TempDir,
}

/// Purpose of such a folder.
#[derive(Debug, Serialize, Deserialize)]
struct Record {
    /// Name of the room's directory.
    room: PathBuf,
    /// Number of the fresh room's directory in its file system.
    fresh: u64,
}

impl Workplace {
    /// Makes the folder in `parent` for the room `out`, with an empty directory for the fresh room.
    pub(super) fn new(parent: &Path, out: &Path) -> Result<Self> {
        let io = Error::io(parent);
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(parent).map_err(io)?;
        let lock = FolderLock::take(folder.path(), "recon build").map_err(|e| io(io::Error::other(e)))?;
        let fresh = folder.path().join(FRESH);
        fs::create_dir(&fresh).map_err(io)?;
        let number = fresh.metadata().map_err(io)?.ino();
        let record = Record { room: out.file_name().unwrap_or_default().into(), fresh: number };
        let text = serde_json::to_string(&record).map_err(|e| io(e.into()))?;
        calib::files::write_atomic(&folder.path().join(RECORD), text.as_bytes())?;
        Ok(Self { _lock: lock, folder })
    }

    /// Directory of the fresh room.
    pub(super) fn fresh(&self) -> PathBuf {
        self.folder.path().join(FRESH)
    }

    /// Place of the old room where names cannot be exchanged.
    pub(super) fn before(&self) -> PathBuf {
        self.folder.path().join(BEFORE)
    }

    /// Leaves the folder where it is, and returns its path.
    pub(super) fn keep(self) -> PathBuf {
        self.folder.keep()
    }
}

/// Removes what killed builds have left beside a room, after the files of others were brought back. What cannot be cleared
/// up is told, and harms nothing.
pub(super) fn clear_up(out: &Path) {
    let Ok(absolute) = std::path::absolute(out) else { return };
    let Some(parent) = absolute.parent() else { return };
    for entry in fs::read_dir(parent).into_iter().flatten().flatten() {
        if !entry.file_name().to_string_lossy().starts_with(PREFIX) || !entry.path().is_dir() {
            continue;
        }
        // A build that is running has the lock.
        let Ok(lock) = FolderLock::take(&entry.path(), "recon build") else { continue };
        let cleared = clear_one(&entry.path(), parent);
        drop(lock);
        match cleared.and_then(|is_done| if is_done { fs::remove_dir_all(entry.path()) } else { Ok(()) }) {
            Ok(()) => {}
            Err(e) => {
                let path = entry.path();
                tracing::warn!(
                    "{}: a killed build left it, and it cannot be cleared up ({e})",
                    path.display()
                );
            }
        }
    }
}

/// Brings the files of others back from one folder; tells whether the rest of it can be removed.
fn clear_one(folder: &Path, parent: &Path) -> io::Result<bool> {
    let [fresh, before] = [FRESH, BEFORE].map(|name| folder.join(name));
    let record = fs::read(folder.join(RECORD)).ok();
    let Some(record) = record.and_then(|text| serde_json::from_slice::<Record>(&text).ok()) else {
        // The build was killed before it made anything, or this is not from this version.
        let is_old = folder.metadata()?.modified()?.elapsed().is_ok_and(|age| age > SETTLED);
        let is_empty = |dir: &Path| fs::read_dir(dir).is_ok_and(|mut entries| entries.next().is_none());
        return Ok(is_old && !before.exists() && (!fresh.exists() || is_empty(&fresh)));
    };
    let room = parent.join(record.room.file_name().unwrap_or_default());
    let is_fresh = fresh.metadata().is_ok_and(|dir| dir.ino() == record.fresh);
    let old = if before.exists() { before } else { fresh };
    if !old.exists() || (is_fresh && old.ends_with(FRESH)) {
        return Ok(true);
    }
    if room.exists() {
        take_over_foreign(&old, &room)?;
    } else {
        fs::rename(&old, &room)?;
    }
    tracing::info!("{}: files of others are back that a killed build had taken away", room.display());
    Ok(true)
}

/// Moves foreign files, those that the new room does not have, into it.
pub(super) fn take_over_foreign(before: &Path, out: &Path) -> io::Result<()> {
    for entry in fs::read_dir(before)? {
        let name = entry?.file_name();
        if out.join(&name).symlink_metadata().is_err() {
            fs::rename(before.join(&name), out.join(&name))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A workplace as a killed build leaves it: without its lock, but with everything else.
    fn killed(parent: &Path, out: &Path) -> PathBuf {
        Workplace::new(parent, out).unwrap().keep()
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    fn room(parent: &Path, files: &[&str]) -> PathBuf {
        let out = parent.join("room");
        fs::create_dir_all(&out).unwrap();
        for file in files {
            fs::write(out.join(file), file).unwrap();
        }
        out
    }

    #[test]
    fn an_unfinished_room_of_a_killed_build_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let out = room(folder.path(), &["scene.toml"]);
        let left = killed(folder.path(), &out);
        fs::write(left.join(FRESH).join("plan.png"), "half").unwrap();
        clear_up(&out);
        assert_eq!(names(folder.path()), ["room"]);
        assert_eq!(names(&out), ["scene.toml"]);
    }

    #[test]
    fn files_of_others_come_back_from_the_old_room() {
        let folder = tempfile::tempdir().unwrap();
        let out = room(folder.path(), &["scene.toml", "notes.txt"]);
        let left = killed(folder.path(), &out);
        fs::write(left.join(FRESH).join("scene.toml"), "new").unwrap();
        // The exchange, in three steps.
        let aside = folder.path().join("aside");
        fs::rename(&out, &aside).unwrap();
        fs::rename(left.join(FRESH), &out).unwrap();
        fs::rename(&aside, left.join(FRESH)).unwrap();
        // A build of another room in the same folder clears it up, too.
        clear_up(&folder.path().join("other"));
        assert_eq!(names(folder.path()), ["room"]);
        assert_eq!(names(&out), ["notes.txt", "scene.toml"]);
        assert_eq!(fs::read(out.join("scene.toml")).unwrap(), b"new");
    }

    #[test]
    fn an_old_room_without_a_new_one_gets_its_name_back() {
        let folder = tempfile::tempdir().unwrap();
        let out = room(folder.path(), &["scene.toml", "notes.txt"]);
        let left = killed(folder.path(), &out);
        fs::rename(&out, left.join(BEFORE)).unwrap();
        clear_up(&out);
        assert_eq!(names(folder.path()), ["room"]);
        assert_eq!(names(&out), ["notes.txt", "scene.toml"]);
    }

    #[test]
    fn a_running_build_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        let out = room(folder.path(), &["scene.toml"]);
        let running = Workplace::new(folder.path(), &out).unwrap();
        fs::write(running.fresh().join("scene.toml"), "new").unwrap();
        clear_up(&out);
        assert!(running.fresh().join("scene.toml").exists());
        drop(running);
        assert_eq!(names(folder.path()), ["room"]);
    }
}
