//! The office's room as `roomtrack recon build` makes it, in full and as a draft: each is built once for all tests that need the room
//! or the stages of its build.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::chain::{StepResult, build_room, run};
use crate::data::{office, program};

/// Beginning of the names of the folders beside the programs in which the rooms are.
const PREFIX: &str = "office-";

/// Directory of the room. The first test that asks builds it, the others wait; another build of the programs makes another
/// room. Nothing may be written there.
///
/// # Errors
/// The build's failure.
pub fn office_room() -> StepResult<PathBuf> {
    room("room", |room| build_room(&office(), room))
}

/// Directory of the room that a draft makes, under the same conditions.
fn office_draft() -> StepResult<PathBuf> {
    room("draft", |room| {
        let mut build = program("roomtrack");
        build.args(["recon", "build", "--quality", "draft"]).arg(office().join("room.toml"));
        run(build.arg("--out").arg(room))
    })
}

/// Directory of a room of this name, built where nobody has done so.
fn room(name: &str, build: impl FnOnce(&Path) -> StepResult<String>) -> StepResult<PathBuf> {
    let programs = PathBuf::from(program("roomtrack-vision").get_program());
    let folder = programs.parent().ok_or("a program without a folder")?;
    let prefix = format!("{PREFIX}{name}-");
    let name = format!("{prefix}{:016x}", age_and_size(&programs).map_err(|e| e.to_string())?);
    let (room, mark) = (folder.join(&name), folder.join(&name).join("built"));
    let lock = File::create(folder.join(format!("{prefix}lock"))).map_err(|e| e.to_string())?;
    // It is unlocked when the file is closed, also by the end of a test that was killed.
    lock.lock().map_err(|e| e.to_string())?;
    if !mark.exists() {
        remove_others(folder, &prefix);
        build(&room)?;
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
    give_stages_of(&office_room()?, room)
}

/// As [`give_stages`] for a draft.
///
/// # Errors
/// As [`office_room`]; files that cannot be copied.
pub fn give_stages_of_draft(room: &Path) -> StepResult<()> {
    give_stages_of(&office_draft()?, room)
}

fn give_stages_of(built: &Path, room: &Path) -> StepResult<()> {
    let mut unfinished = room.as_os_str().to_owned();
    unfinished.push(".unfinished");
    let into = Path::new(&unfinished).join("cache");
    let stages = built.join("cache");
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

/// Removes the rooms whose names begin so, of other builds of the programs.
fn remove_others(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(prefix) && entry.path().is_dir() {
            // One that cannot be removed takes space alone.
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}
