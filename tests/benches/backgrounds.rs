//! MOTA on the office's films with changed light, and with people who stand still for most of the time, beside the bound of
//! each. The choice of the background was designed on the first three, and on
//! the two that begin or end with people who stand still.
//!
//! `make bench`, or `cargo bench -p tests --bench backgrounds`; with `-- NAME` one film alone.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use calib::video::FilmWriter;
use image::RgbImage;
use tests::chain::{StepResult, evaluate_against, track_videos};
use tests::data::office;
use tests::network_camera::film::Film;

/// Frames a second of the office's films.
const RATE_HZ: f64 = 12.0;
/// Frames of 35 seconds.
const STILL: usize = 420;

/// A change of the office's films.
struct Change {
    name: &'static str,
    /// Numbers of the office's frames, from 0, in their new order.
    order: Vec<usize>,
    /// Factor of the light in a frame, by its number and column.
    light: fn(usize, u32) -> f64,
    /// Least MOTA that is asked, %.
    asked: Option<f64>,
}

fn changes() -> Vec<Change> {
    let all = || (0..300).collect::<Vec<_>>();
    let held =
        |from: usize| (0..from).chain(std::iter::repeat_n(from, STILL)).chain(from..300).take(720).collect();
    vec![
        Change { name: "still-230", order: held(230), light: |_, _| 1.0, asked: Some(95.0) },
        Change {
            name: "light",
            order: all(),
            light: |t, _| if t >= 120 { 1.7 } else { 1.0 },
            asked: Some(95.0),
        },
        Change {
            name: "lamp",
            order: all(),
            light: |t, u| if t >= 120 && u < 320 { 1.7 } else { 1.0 },
            asked: Some(95.0),
        },
        Change { name: "still-150", order: held(150), light: |_, _| 1.0, asked: Some(95.0) },
        Change { name: "still-262", order: held(262), light: |_, _| 1.0, asked: Some(95.0) },
        Change {
            name: "still-at-the-end",
            order: (0..245).chain(std::iter::repeat_n(245, STILL)).collect(),
            light: |_, _| 1.0,
            asked: None,
        },
        Change {
            name: "still-at-the-start",
            order: std::iter::repeat_n(235, STILL).chain(235..300).chain(0..300).collect(),
            light: |_, _| 1.0,
            asked: None,
        },
        Change {
            name: "darker",
            order: all(),
            light: |t, _| if t >= 200 { 0.55 } else { 1.0 },
            asked: Some(95.0),
        },
        Change { name: "lamp-on-and-off", order: all(), light: lamp_for_ten_seconds, asked: Some(95.0) },
    ]
}

/// A lamp beside the right edge, on from frame 90 to 209.
fn lamp_for_ten_seconds(t: usize, u: u32) -> f64 {
    let near = (-(f64::from(u) - 520.0).powi(2) / (2.0 * 160.0_f64.powi(2))).exp();
    if (90..210).contains(&t) { 1.0 + 0.9 * near } else { 1.0 }
}

/// Writes the changed film of a camera.
fn film(change: &Change, frames: &[RgbImage], to: &Path) -> StepResult<()> {
    let problem = |error: calib::Error| error.to_string();
    let (width, height) = frames[0].dimensions();
    let mut writer = FilmWriter::create(to, width, height, RATE_HZ).map_err(problem)?;
    for &number in &change.order {
        let mut frame = frames[number].clone();
        for (u, _, pixel) in frame.enumerate_pixels_mut() {
            let light = (change.light)(number, u);
            pixel.0 = pixel.0.map(|level| (f64::from(level) * light).round().min(255.0) as u8);
        }
        writer.write(&frame).map_err(problem)?;
    }
    writer.finish().map_err(problem)
}

/// Truth of the changed films: each frame's rows under its new number.
fn truth(change: &Change, office: &Path) -> StepResult<String> {
    let text = std::fs::read_to_string(office.join("truth.txt")).map_err(|e| e.to_string())?;
    let mut rows: BTreeMap<usize, Vec<&str>> = BTreeMap::new();
    for line in text.lines() {
        let (frame, rest) = line.split_once(',').ok_or("a row of the truth without a comma")?;
        rows.entry(frame.parse().map_err(|e| format!("{frame}: {e}"))?).or_default().push(rest);
    }
    let mut changed = String::new();
    for (i, number) in change.order.iter().enumerate() {
        for row in rows.get(&(number + 1)).into_iter().flatten() {
            let _ = writeln!(changed, "{},{row}", i + 1);
        }
    }
    Ok(changed)
}

fn main() -> StepResult<()> {
    let office = office();
    let wanted: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let frames = |camera: &str| Film::frames(&office.join("video").join(format!("{camera}.mp4")));
    let cameras = [("cam0", frames("cam0")?), ("cam1", frames("cam1")?)];
    println!("{:<20} {:>6} {:>6} {:>6}", "films", "MOTA", "IDF1", "asked");
    for change in
        changes().iter().filter(|change| wanted.is_empty() || wanted.iter().any(|w| w == change.name))
    {
        let folder = scratch.path().join(change.name);
        std::fs::create_dir(&folder).map_err(|e| e.to_string())?;
        let paths = cameras.each_ref().map(|(camera, _)| folder.join(format!("{camera}.mp4")));
        for ((_, frames), path) in cameras.iter().zip(&paths) {
            film(change, frames, path)?;
        }
        let truth_rows = folder.join("truth.txt");
        std::fs::write(&truth_rows, truth(change, &office)?).map_err(|e| e.to_string())?;
        let (room, out) = (office.join("room"), folder.join("out"));
        track_videos(&room, &[("cam0", &paths[0]), ("cam1", &paths[1])], &out, &[])?;
        let found = evaluate_against(&truth_rows, &room, &room, &out)?;
        let asked = change.asked.map_or(String::new(), |asked| format!(">= {asked}"));
        println!("{:<20} {:>6.1} {:>6.1} {asked:>6}", change.name, found.mota, found.idf1);
    }
    Ok(())
}
