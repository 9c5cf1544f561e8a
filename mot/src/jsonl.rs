//! `tracks.jsonl`: a line a frame, with all estimates of each person.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use shell::ranges::{BODY_M, FRAME_NUMBER, ROOM_M, Range, TIME_S};

use crate::{CameraState, Error, Result, TrackId};

/// Name of the file.
pub const NAME: &str = "tracks.jsonl";
/// Longest line that is read, bytes: a file without line breaks must not exhaust memory.
const LONGEST_LINE: u64 = 64 << 20;

/// A line of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameLine {
    /// Number of the frame, from 1.
    pub frame: u32,
    /// Time, seconds.
    pub time: f64,
    /// People by ascending id.
    pub people: Vec<PersonLine>,
    /// Probability distribution of the number of people, by their confidences: entry `n` is that of exactly `n`.
    #[serde(default)]
    pub count: Vec<f64>,
    /// Cameras that were set aside in this frame: frozen, dark, lights switched, dropped. Omitted when there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set_aside: Vec<String>,
    /// State of each of these cameras, in their order; `None` for one that learns its background.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub states: Vec<Option<CameraState>>,
    /// Time of day of `time`, RFC 3339, where the run knows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock: Option<String>,
}

/// A person of a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PersonLine {
    /// Id of the track.
    pub id: TrackId,
    /// Position on the floor along x, metres.
    pub x: f64,
    /// Position on the floor along y, metres.
    pub y: f64,
    /// Radius of the ellipsoid that models the body, metres.
    pub radius: f64,
    /// Height of the body, metres.
    pub height: f64,
    /// Velocity along x, m/s.
    pub vx: f64,
    /// Velocity along y, m/s.
    pub vy: f64,
    /// Standard deviations along x and y, metres.
    pub sigma: [f64; 2],
    /// Probability that the person exists and is in the room, 0 to 1.
    pub confidence: f64,
    /// Predicted visible fraction of the silhouette in each camera's image.
    #[serde(default)]
    pub visible: BTreeMap<String, f64>,
}

impl FrameLine {
    /// Defect of a line that no run can have written: a number out of its range.
    fn defect(&self) -> Option<String> {
        let of_person = |person: &PersonLine| {
            let numbers = [
                ("x", person.x, ROOM_M),
                ("y", person.y, ROOM_M),
                ("height", person.height, BODY_M),
                ("radius", person.radius, BODY_M),
            ];
            let defect =
                |(name, value, range): (&str, f64, Range)| Some(format!("{name} {}", range.defect(value)?));
            let problem = numbers.into_iter().find_map(defect)?;
            Some(format!("person {}: {problem}", person.id.0))
        };
        let number = FRAME_NUMBER.defect(f64::from(self.frame)).map(|problem| format!("frame {problem}"));
        let time = || TIME_S.defect(self.time).map(|problem| format!("time {problem}"));
        number.or_else(time).or_else(|| self.people.iter().find_map(of_person))
    }

    /// The line's text, with a line break; `path` is for messages.
    pub fn text(&self, path: &Path) -> Result<String> {
        let json = serde_json::to_string(self).map_err(|e| {
            Error::content(path, format!("frame {}", self.frame), format!("cannot be written ({e})"))
        })?;
        Ok(json + "\n")
    }
}

impl PersonLine {
    /// Whether every number of the line is finite.
    pub fn is_finite(&self) -> bool {
        [self.x, self.y, self.radius, self.height, self.vx, self.vy, self.confidence]
            .iter()
            .chain(&self.sigma)
            .chain(self.visible.values())
            .all(|v| v.is_finite())
    }
}

/// Rounds to four decimals, without a negative zero.
pub fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4 + 0.0
}

/// Reads the file. An unfinished last line, which a running tracker is still writing, is left out.
///
/// # Errors
/// Names file and line of malformed frames, numbers that are not finite, and frames that do not increase.
pub fn read(path: &Path) -> Result<Vec<FrameLine>> {
    lines(path)?.collect()
}

/// Opens the file for reading line by line, as [`read`] reads it: a day need not fit into memory.
///
/// # Errors
/// [`Error::File`] when the file cannot be opened; of the iterator's items, those of [`read`]. After an error it ends.
pub fn lines(path: &Path) -> Result<FrameLines> {
    let file = File::open(path).map_err(Error::io(path))?;
    Ok(FrameLines { path: path.to_owned(), reader: Some(BufReader::new(file)), line: 0, last_frame: 0 })
}

/// Lines of a file, one after the other.
#[derive(Debug)]
pub struct FrameLines {
    path: PathBuf,
    /// `None` after the end, or an error.
    reader: Option<BufReader<File>>,
    line: usize,
    last_frame: u32,
}

impl FrameLines {
    /// The next line that is not empty; `None` at the end of the whole lines.
    fn next_line(&mut self) -> Result<Option<FrameLine>> {
        let mut bytes = Vec::new();
        while let Some(reader) = &mut self.reader {
            bytes.clear();
            self.line += 1;
            reader.take(LONGEST_LINE).read_until(b'\n', &mut bytes).map_err(Error::io(&self.path))?;
            let refuse = |problem: String| Error::content(&self.path, format!("line {}", self.line), problem);
            if bytes.len() as u64 == LONGEST_LINE {
                return Err(refuse("is longer than 64 MiB; is this a tracks.jsonl?".into()));
            }
            if bytes.pop() != Some(b'\n') {
                return Ok(None);
            }
            if bytes.trim_ascii().is_empty() {
                continue;
            }
            let frame: FrameLine = serde_json::from_slice(&bytes)
                .map_err(|e| refuse(format!("is no frame as `tracker run` writes it ({e})")))?;
            if self.last_frame >= frame.frame && self.last_frame > 0 {
                return Err(refuse(format!("frame {} comes after a later one", frame.frame)));
            }
            if let Some(problem) = frame.defect() {
                return Err(refuse(problem));
            }
            self.last_frame = frame.frame;
            return Ok(Some(frame));
        }
        Ok(None)
    }
}

impl Iterator for FrameLines {
    type Item = Result<FrameLine>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.next_line().transpose();
        if !matches!(next, Some(Ok(_))) {
            self.reader = None;
        }
        next
    }
}
