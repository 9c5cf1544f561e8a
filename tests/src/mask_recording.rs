//! Recordings of masks without pictures: exact silhouettes of synthetic people, in the files that `tracker run` reads.

use std::fmt::Write as _;
use std::fs::{create_dir_all, write};
use std::path::PathBuf;

use image::GrayImage;
use serde_json::Value;
use synthetic::{Frame, SyntheticRoom};
use tempfile::TempDir;

use crate::chain::{StepResult, run};
use crate::data::program;

/// Folder with a room, the masks of its cameras, times and the truth.
pub struct MaskRecording {
    folder: TempDir,
    cameras: Vec<String>,
}

/// Row of a track: frame, id, and place on the floor, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Number of the frame, counted from 1.
    pub frame: u32,
    /// Id of the track.
    pub id: u32,
    /// Place on the floor, metres.
    pub place: [f64; 2],
}

impl Row {
    /// Distance on the floor, metres.
    pub fn distance_m(&self, place: [f64; 2]) -> f64 {
        (self.place[0] - place[0]).hypot(self.place[1] - place[1])
    }
}

impl MaskRecording {
    /// Writes these frames of a room, numbered anew from 1. Masks are black in frames for which `is_blank` holds.
    pub fn write(
        room: &SyntheticRoom,
        frames: impl Iterator<Item = Frame>,
        is_blank: impl Fn(f64) -> bool,
    ) -> StepResult<Self> {
        let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
        let root = folder.path();
        room.room.write(root).map_err(|e| e.to_string())?;
        let cameras: Vec<String> = room.room.cameras.iter().map(|camera| camera.name.clone()).collect();
        for camera in &cameras {
            create_dir_all(root.join("masks").join(camera)).map_err(|e| e.to_string())?;
        }
        let (mut times, mut truth) = (String::new(), String::new());
        for (number, frame) in (1_u32..).zip(frames) {
            // Writing to a string cannot fail.
            let _ = writeln!(times, "{:.4}", frame.time_s);
            for person in frame.people.iter().filter(|person| person.inside) {
                let (id, x, y) = (person.id, person.place.x, person.place.y);
                let _ = writeln!(truth, "{number},{id},-1,-1,-1,-1,1,{x:.4},{y:.4},0");
            }
            for (camera, seen) in cameras.iter().zip(&frame.cameras) {
                let (width, height) = seen.mask.dimensions();
                let black = is_blank(frame.time_s).then(|| GrayImage::new(width, height));
                let path = root.join("masks").join(camera).join(format!("{number:06}.png"));
                black.as_ref().unwrap_or(&seen.mask).save(path).map_err(|e| e.to_string())?;
            }
        }
        for (name, text) in [("times.txt", times), ("truth.txt", truth)] {
            write(root.join(name), text).map_err(|e| e.to_string())?;
        }
        Ok(Self { folder, cameras })
    }

    /// `tracker run` of the masks, with further options.
    pub fn follow(&self, options: &[&str]) -> StepResult<()> {
        let root = self.folder.path();
        let masks = |name: &String| {
            ["--masks".to_owned(), format!("{name}={}", root.join("masks").join(name).display())]
        };
        let mut command = program("tracker");
        command.arg("run").arg(root).args(self.cameras.iter().flat_map(masks));
        command.args(options).args(["--no-film", "--times"]).arg(root.join("times.txt"));
        run(command.arg("--out").arg(self.out())).map(|_| ())
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    /// Figures of `tracker eval`, as JSON.
    pub fn evaluate(&self) -> StepResult<Value> {
        let mut command = program("tracker");
        command.args(["eval", "--json", "--truth"]).arg(self.folder.path().join("truth.txt"));
        let text = run(command.arg("--tracks").arg(self.out().join("tracks.txt")))?;
        serde_json::from_str(&text).map_err(|e| e.to_string())
    }

    /// Mean time of inference, milliseconds a moment.
    pub fn inference_ms(&self) -> StepResult<f64> {
        let text = std::fs::read_to_string(self.out().join("timings.json")).map_err(|e| e.to_string())?;
        let timings: Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
        let of = |name: &str| timings["stages"]["inference"][name].as_f64().unwrap_or(f64::NAN);
        Ok(of("total_ms") / of("count"))
    }

    /// Rows of the tracks.
    pub fn tracks(&self) -> StepResult<Vec<Row>> {
        rows(&self.out().join("tracks.txt"))
    }

    /// Rows of the truth.
    pub fn truth(&self) -> StepResult<Vec<Row>> {
        rows(&self.folder.path().join("truth.txt"))
    }
}

fn rows(path: &std::path::Path) -> StepResult<Vec<Row>> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let row = |line: &str| {
        let columns: Vec<f64> = line.split(',').map(|c| c.trim().parse().unwrap_or(f64::NAN)).collect();
        match columns[..] {
            [frame, id, _, _, _, _, _, x, y, ..] => {
                Ok(Row { frame: frame as u32, id: id as u32, place: [x, y] })
            }
            _ => Err(format!("{}: {line}: no row of a track", path.display())),
        }
    };
    text.lines().map(row).collect()
}
