//! `tracks.jsonl`: a line a frame, with all estimates of each person.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{Error, PersonEstimate, Result, TrackId};

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
    /// The line's text, with a line break; `path` is for messages.
    pub(crate) fn text(&self, path: &Path) -> Result<String> {
        let json = serde_json::to_string(self).map_err(|e| {
            Error::content(path, format!("frame {}", self.frame), format!("cannot be written ({e})"))
        })?;
        Ok(json + "\n")
    }
}

impl PersonLine {
    /// Line of a person; numbers are rounded to four decimals. `cameras` are the names for the estimate's visible
    /// fractions.
    pub fn new(person: &PersonEstimate, cameras: &[String]) -> Self {
        Self {
            id: person.id,
            x: rounded(person.x_m),
            y: rounded(person.y_m),
            radius: rounded(person.radius_m),
            height: rounded(person.height_m),
            vx: rounded(person.vx),
            vy: rounded(person.vy),
            sigma: person.sigma_m.map(rounded),
            confidence: rounded(person.confidence),
            visible: cameras.iter().cloned().zip(person.visible.iter().map(|v| rounded(*v))).collect(),
        }
    }

    /// Whether every number of the line is finite.
    pub(super) fn is_finite(&self) -> bool {
        [self.x, self.y, self.radius, self.height, self.vx, self.vy, self.confidence]
            .iter()
            .chain(&self.sigma)
            .chain(self.visible.values())
            .all(|v| v.is_finite())
    }
}

/// Rounds to four decimals, without a negative zero.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4 + 0.0
}

/// Reads the file. An unfinished last line, which a running tracker is still writing, is left out.
///
/// # Errors
/// Names file and line of malformed frames, numbers that are not finite, and frames that do not increase.
pub fn read(path: &Path) -> Result<Vec<FrameLine>> {
    let text = calib::files::read_text(path)?;
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let mut frames: Vec<FrameLine> = Vec::new();
    for (index, line) in whole.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let refuse = |problem: String| Error::content(path, format!("line {}", index + 1), problem);
        let frame: FrameLine = serde_json::from_str(line)
            .map_err(|e| refuse(format!("is no frame as `tracker run` writes it ({e})")))?;
        if frames.last().is_some_and(|last| last.frame >= frame.frame) {
            return Err(refuse(format!("frame {} comes after a later one", frame.frame)));
        }
        frames.push(frame);
    }
    Ok(frames)
}
