//! `tracks.jsonl`: a line a frame, with everything that is known of each person.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::{Error, PersonEstimate, Result, TrackId};

/// One line of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameLine {
    /// From 1.
    pub frame: u32,
    /// Seconds.
    pub time: f64,
    /// By ascending id.
    pub people: Vec<PersonLine>,
    /// Entry `n`: the probability that `n` of them are there, by their confidences.
    #[serde(default)]
    pub count: Vec<f64>,
    /// Cameras that were set aside in this frame: frozen, dark, lights switched, dropped. Not written when there are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set_aside: Vec<String>,
}

/// One person of a line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PersonLine {
    /// Who.
    pub id: TrackId,
    /// On the floor, metres.
    pub x: f64,
    /// On the floor, metres.
    pub y: f64,
    /// Of the ellipsoid that stands for the body, metres.
    pub radius: f64,
    /// Of the body, metres.
    pub height: f64,
    /// Velocity, m/s.
    pub vx: f64,
    /// Velocity, m/s.
    pub vy: f64,
    /// Standard deviation along x and y, metres.
    pub sigma: [f64; 2],
    /// Probability of being there, 0 to 1.
    pub confidence: f64,
    /// Per camera: predicted fraction of the silhouette in the image that nothing hides.
    #[serde(default)]
    pub visible: BTreeMap<String, f64>,
}

impl FrameLine {
    /// The line of the file `path`, with its end.
    pub(crate) fn text(&self, path: &Path) -> Result<String> {
        let json = serde_json::to_string(self).map_err(|e| {
            Error::content(path, format!("frame {}", self.frame), format!("cannot be written ({e})"))
        })?;
        Ok(json + "\n")
    }
}

impl PersonLine {
    /// The line of a person; numbers are rounded to what they are worth (0.1 mm, 0.1 ‰), `cameras` names the
    /// estimate's visible fractions.
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

    /// Every number of the line, for checking.
    pub(super) fn is_finite(&self) -> bool {
        [self.x, self.y, self.radius, self.height, self.vx, self.vy, self.confidence]
            .iter()
            .chain(&self.sigma)
            .chain(self.visible.values())
            .all(|v| v.is_finite())
    }
}

/// To four decimals, without a negative zero.
pub(crate) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4 + 0.0
}

/// Reads the file. A last line that a running tracker has not finished is left out.
///
/// # Errors
/// Naming file and line: what is no frame, a number that is not finite, frames that do not grow.
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
