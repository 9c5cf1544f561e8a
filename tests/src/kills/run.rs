//! Kills of `tracker run`.

use std::path::Path;
use std::time::Instant;

use calib::video::{FilmWriter, FrameSource};
use image::RgbImage;

use super::readable::unreadable;
use super::{MOST_FILM_LOST_S, Moments, Outcome, differences, place_of, quiet};
use crate::chain::StepResult;
use crate::data::{office, program};
use crate::folder_files::files;
use crate::live::office::RATE_HZ;

/// Frames of the office that are tracked, from this one on.
const FIRST_FRAME: usize = 90;
const FRAMES: usize = 60;

/// Some seconds of the office's films.
fn clips(folder: &Path) -> StepResult<()> {
    for camera in ["cam0", "cam1"] {
        let film = office().join(format!("video/{camera}.mp4"));
        let mut source =
            FrameSource::open(film.to_str().ok_or("a path without UTF-8")?).map_err(|e| e.to_string())?;
        let (width, height) = source.size();
        let target = folder.join(format!("{camera}.mp4"));
        let mut writer = FilmWriter::create(&target, width, height, RATE_HZ).map_err(|e| e.to_string())?;
        let mut picture = RgbImage::default();
        for frame in 0..FIRST_FRAME + FRAMES {
            if source.read(&mut picture).map_err(|e| e.to_string())? && frame >= FIRST_FRAME {
                writer.write(&picture).map_err(|e| e.to_string())?;
            }
        }
        writer.finish().map_err(|e| e.to_string())?;
    }
    Ok(())
}

/// Kills `tracker run` with films; every second time the results of a finished run are there already.
///
/// # Errors
/// A run that cannot be started, or that fails undisturbed.
pub fn run(kills: usize, seed: u64) -> StepResult<Outcome> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let folder = scratch.path();
    clips(folder)?;
    let out = folder.join("out");
    let tracker = || {
        let mut tracker = program("tracker");
        tracker.current_dir(folder).arg("run").arg(office().join("room"));
        tracker.args(["--video", "cam0=cam0.mp4", "--video", "cam1=cam1.mp4", "--out", "out"]);
        tracker.args(["--steps", "20", "--threads", "2", "--film-width", "480"]);
        tracker
    };
    let begun = Instant::now();
    let status = quiet(&mut tracker())?.wait().map_err(|e| e.to_string())?;
    if !status.success() {
        return Err(format!("an undisturbed run ends with {status}"));
    }
    let mut moments = Moments::new(seed, begun.elapsed().mul_f64(1.02));
    let expected = files(&out);
    let mut outcome = Outcome::default();
    for kill in 0..kills {
        let after = moments.draw();
        if kill % 2 == 0 {
            std::fs::remove_dir_all(&out).map_err(|e| e.to_string())?;
        }
        let place = place_of(kill, after);
        outcome.kill(&mut tracker(), after)?;
        let (faults, lost_s) = unreadable(&out);
        outcome.add(&place, faults);
        outcome.film_lost_s = outcome.film_lost_s.max(lost_s);
        if lost_s > MOST_FILM_LOST_S {
            outcome.add(&place, [format!("{lost_s:.2} s of a film are lost")]);
        }
        let again = quiet(&mut tracker())?.wait().map_err(|e| e.to_string())?;
        if !again.success() {
            outcome.add(&place, [format!("ends with {again} afterwards")]);
        }
        outcome.add(&place, differences(&files(&out), &expected, |name| name.ends_with("timings.json")));
    }
    Ok(outcome)
}
