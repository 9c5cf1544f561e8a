//! The office's room as `roomtrack recon build` makes it: one build for all tests that need it, or the stages of it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::chain::{StepResult, build_room};
use crate::data::{office, program};

/// Beginning of the names of the folders beside the programs in which the rooms are.
const PREFIX: &str = "office-room-";

/// Directory of the room. The first test that asks builds it, the others wait; another build of the programs makes another
/// room. Nothing may be written there.
///
/// # Errors
/// The build's failure.
pub fn office_room() -> StepResult<PathBuf> {
    let programs = PathBuf::from(program("roomtrack-vision").get_program());
    let folder = programs.parent().ok_or("a program without a folder")?;
    let name = format!("{PREFIX}{:016x}", age_and_size(&programs).map_err(|e| e.to_string())?);
    let (room, mark) = (folder.join(&name), folder.join(&name).join("built"));
    let lock = File::create(folder.join(format!("{PREFIX}lock"))).map_err(|e| e.to_string())?;
    // It is unlocked when the file is closed, also by the end of a test that was killed.
    lock.lock().map_err(|e| e.to_string())?;
    if !mark.exists() {
        remove_others(folder);
        build_room(&office(), &room)?;
        File::create(&mark).map_err(|e| e.to_string())?;
    }
    Ok(room)
}

/// Gives a build of the office's project whose room is to be `room` the finished stages of the captures, as an interrupted
/// build leaves them.
///
/// # Errors
/// As [`office_room`]; files that cannot be copied.
pub fn give_stages(room: &Path) -> StepResult<()> {
    let mut unfinished = room.as_os_str().to_owned();
    unfinished.push(".unfinished");
    let into = Path::new(&unfinished).join("cache");
    let stages = office_room()?.join("cache");
    let copied = || -> std::io::Result<()> {
        fs::create_dir_all(&into)?;
        for entry in fs::read_dir(&stages)? {
            let entry = entry?;
            fs::copy(entry.path(), into.join(entry.file_name()))?;
        }
        Ok(())
    };
    copied().map_err(|e| format!("{}: {e}", into.display()))
}

/// Time of writing and size of a program, as one number: another build has another.
fn age_and_size(program: &Path) -> std::io::Result<u64> {
    let written = program.metadata()?;
    let age = written.modified()?.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    Ok((age.as_nanos() as u64).rotate_left(17) ^ written.len())
}

/// Removes the rooms of other builds of the programs.
fn remove_others(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(PREFIX) && entry.path().is_dir() {
            // One that cannot be removed takes space alone.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}
