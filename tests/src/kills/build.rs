//! Kills of `recon build`.

use std::path::Path;
use std::time::Instant;

use scenes::room::Room;
use synthetic::RoomOptions;

use super::{Moments, Outcome, differences, place_of, quiet};
use crate::chain::StepResult;
use crate::data::program;
use crate::folder_files::files;
use crate::project;

/// Kills `recon build` of a small synthetic room; every second time a finished room is there already.
///
/// # Errors
/// A build that cannot be started, or that fails undisturbed.
pub fn build(kills: usize, seed: u64) -> StepResult<Outcome> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let folder = scratch.path();
    let options = RoomOptions { seed: 4, image_px: [240, 180], ..RoomOptions::default() };
    project::write(folder, &options.build().map_err(|e| e.to_string())?, 12)?;
    let given = files(folder);
    let recon = || {
        let mut recon = program("recon");
        recon.current_dir(folder).args(["build", "room.toml", "--out", "room", "--quality", "draft"]);
        recon
    };
    let begun = Instant::now();
    let status = quiet(&mut recon())?.wait().map_err(|e| e.to_string())?;
    let mut moments = Moments::new(seed, begun.elapsed().mul_f64(1.02));
    let expected = files(folder);
    // The times of the stages are in the report, and in what is kept of them.
    let is_timed = |name: &Path| {
        name.ends_with("report.json") || name.components().any(|part| part.as_os_str() == "cache")
    };
    let room = expected.keys().find(|name| name.ends_with("scene.toml")).ok_or("no room was built")?;
    let room = room.parent().unwrap_or(Path::new("")).to_owned();
    let mut outcome = Outcome::default();
    for kill in 0..kills {
        let after = moments.draw();
        if kill % 2 == 0 {
            // From the beginning, with nothing kept.
            for name in files(folder).keys().filter(|name| !given.contains_key(*name)) {
                std::fs::remove_file(folder.join(name)).map_err(|e| e.to_string())?;
            }
            std::fs::remove_dir_all(folder.join(&room)).map_err(|e| e.to_string())?;
        }
        let place = place_of(kill, after);
        outcome.kill(&mut recon(), after)?;
        if folder.join(&room).exists()
            && let Err(error) = Room::read(&folder.join(&room))
        {
            outcome.add(&place, [error.to_string()]);
        }
        let again = quiet(&mut recon())?.wait().map_err(|e| e.to_string())?;
        if again.code() != status.code() {
            outcome.add(&place, [format!("ends with {again} afterwards")]);
        }
        outcome.add(&place, differences(&files(folder), &expected, is_timed));
    }
    Ok(outcome)
}
