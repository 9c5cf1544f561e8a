//! The office with a camera that turns in the middle of the film: when it is told, and what it costs.

use std::path::Path;

use calib::video::{FilmWriter, FrameSource};
use image::RgbImage;
use nalgebra::{UnitQuaternion, Vector3};
use scenes::room::Room;

use crate::chain::{StepResult, Tracking, evaluate, track_videos};
use crate::data::office;
use crate::live::office::RATE_HZ;
use crate::relocation::turned;

/// Frame from which on the camera is turned, from 1.
pub const TURNED_AT: usize = 151;

/// Figures of a run with a turned camera.
#[derive(Debug, Clone, Copy)]
pub struct TurnedRun {
    /// Time from the turn to the event, seconds; `None` where it was not told.
    pub told_after_s: Option<f64>,
    /// Time from the turn until the camera is back, seconds.
    pub back_after_s: Option<f64>,
    /// Whether the new pose stands beside the run.
    pub has_pose: bool,
    /// Accuracy of the tracks.
    pub tracking: Tracking,
}

/// Tracks the office while `cam1` turns about an axis of its own by some degrees.
///
/// # Errors
/// A film that cannot be made; the run's line, if it fails.
pub fn run(axis: Vector3<f64>, turn_deg: f64) -> StepResult<TurnedRun> {
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let room = office().join("room");
    let (still, bumped) = (office().join("video/cam0.mp4"), scratch.path().join("cam1.mp4"));
    let turn = UnitQuaternion::new(axis.normalize() * turn_deg.to_radians());
    turn_film(&office().join("video/cam1.mp4"), &bumped, &room, &turn)?;
    let out = scratch.path().join("out");
    track_videos(&room, &[("cam0", &still), ("cam1", &bumped)], &out, &[])?;
    let text = std::fs::read_to_string(out.join("events.jsonl")).map_err(|e| e.to_string())?;
    let turned_s = (TURNED_AT - 1) as f64 / RATE_HZ;
    let time_of = |state: &str| {
        let events = text.lines().filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok());
        let mut times = events
            .filter(|e| e["kind"] == "camera" && e["where"] == "cam1" && e["state"] == state)
            .filter_map(|e| e["time"].as_f64())
            .filter(|time_s| *time_s >= turned_s - 1e-6);
        times.next().map(|time_s| time_s - turned_s)
    };
    Ok(TurnedRun {
        told_after_s: time_of("moved"),
        back_after_s: time_of("back"),
        has_pose: out.join("moved_cam1.toml").is_file(),
        tracking: evaluate(&office(), &room, &out)?,
    })
}

/// Writes a film as its camera would have taken it, had it turned at [`TURNED_AT`].
fn turn_film(from: &Path, to: &Path, room: &Path, turn: &UnitQuaternion<f64>) -> StepResult<()> {
    let room = Room::read(room).map_err(|e| e.to_string())?;
    let lens = &room.camera("cam1").map_err(|e| e.to_string())?.camera.intrinsics;
    let mut source =
        FrameSource::open(from.to_str().ok_or("a path without UTF-8")?).map_err(|e| e.to_string())?;
    let (width, height) = source.size();
    let mut writer = FilmWriter::create(to, width, height, RATE_HZ).map_err(|e| e.to_string())?;
    let mut picture = RgbImage::default();
    for frame in 1.. {
        if !source.read(&mut picture).map_err(|e| e.to_string())? {
            break;
        }
        let seen = if frame < TURNED_AT { picture.clone() } else { turned(&picture, lens, turn) };
        writer.write(&seen).map_err(|e| e.to_string())?;
    }
    writer.finish().map_err(|e| e.to_string())
}
