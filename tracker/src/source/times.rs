//! Capture times of frames: a steady rate, or a file with one line a frame.

use std::path::{Path, PathBuf};

use shell::ranges::{RATE_HZ, TIME_S};

use crate::{Error, Result};

/// Default frame rate, frames a second.
pub const DEFAULT_RATE: f64 = 25.0;

/// Number of frames by which a video's header may exceed the true count.
const HEADER_SLACK_FRAMES: usize = 3;

/// Capture times of the frames.
#[derive(Debug, Clone, PartialEq)]
pub enum Times {
    /// Frames a second; the first frame is at 0.
    Rate(f64),
    /// Seconds for each frame, read from a file.
    File {
        /// The file.
        path: PathBuf,
        /// Strictly increasing times, seconds.
        seconds: Vec<f64>,
    },
}

impl Times {
    /// A steady rate, frames a second.
    ///
    /// # Errors
    /// A rate that is not positive and finite.
    pub fn steady(rate: f64) -> Result<Self> {
        match RATE_HZ.defect(rate) {
            None => Ok(Self::Rate(rate)),
            Some(problem) => Err(Error::option("rate", problem)),
        }
    }

    /// Reads a file with one time a line, in seconds.
    ///
    /// # Errors
    /// Names the line that is no number, not finite, or not later than the line before it.
    pub fn read(path: &Path) -> Result<Self> {
        let text = calib::files::read_text(path)?;
        let mut seconds: Vec<f64> = Vec::new();
        for (i, line) in text.trim_end().lines().enumerate() {
            let place = || format!("line {}", i + 1);
            let time: f64 = line.trim().parse().map_err(|_| {
                Error::content(
                    path,
                    place(),
                    format!("`{}` is no number; give seconds, one line a frame", line.trim()),
                )
            })?;
            if let Some(problem) = TIME_S.defect(time) {
                return Err(Error::content(path, place(), format!("the time {problem}")));
            }
            if let Some(before) = seconds.last()
                && time <= *before
            {
                return Err(Error::content(
                    path,
                    place(),
                    format!("{time} is not after {before} in the line before; times must grow"),
                ));
            }
            seconds.push(time);
        }
        if seconds.is_empty() {
            return Err(Error::content(path, "whole file", "holds no times; give seconds, one line a frame"));
        }
        Ok(Self::File { path: path.to_owned(), seconds })
    }

    /// Checks that there is a time for every frame of sources that promise `promised_frames`; headers may promise a few
    /// too many.
    ///
    /// # Errors
    /// Names the first missing line.
    pub fn check_count(&self, promised_frames: usize) -> Result<()> {
        match self {
            Self::File { seconds, .. } if seconds.len() + HEADER_SLACK_FRAMES < promised_frames => {
                self.of(seconds.len() as u32 + 1).map(|_| ())
            }
            _ => Ok(()),
        }
    }

    /// End of the last frame, half a frame after its time, seconds; `None` without a file.
    pub fn end_s(&self) -> Option<f64> {
        match self {
            Self::Rate(_) => None,
            Self::File { seconds, .. } => Some(seconds.last()? + 0.5 / self.mean_rate()),
        }
    }

    /// Capture time of a frame (from 1), seconds.
    ///
    /// # Errors
    /// A file without a line for the frame.
    pub fn of(&self, frame: u32) -> Result<f64> {
        match self {
            Self::Rate(rate) => Ok((frame - 1) as f64 / rate),
            Self::File { path, seconds } => seconds.get(frame as usize - 1).copied().ok_or_else(|| {
                Error::content(
                    path,
                    format!("line {frame}"),
                    format!(
                        "is missing: the sources go on after frame {}; give a line for each",
                        seconds.len()
                    ),
                )
            }),
        }
    }

    /// Number of the frame nearest to a time; 0 before the first frame by more than half an interval, and one more than
    /// the last line's number after the last frame by as much.
    pub fn nearest(&self, time_s: f64) -> u32 {
        match self {
            Self::Rate(rate) => ((time_s * rate).round() + 1.0).clamp(0.0, u32::MAX as f64) as u32,
            Self::File { seconds, .. } => {
                let half_s = 0.5 / self.mean_rate();
                let after = seconds.partition_point(|s| *s < time_s);
                let before_s = after.checked_sub(1).map_or(seconds[0] - 2.0 * half_s, |i| seconds[i]);
                let after_s = seconds.get(after).copied().unwrap_or(before_s + 2.0 * half_s);
                // `after` counts the frames before the time, so it is the number of the last one of them.
                after as u32 + u32::from(after_s - time_s <= time_s - before_s)
            }
        }
    }

    /// Mean frame rate, frames a second.
    pub fn mean_rate(&self) -> f64 {
        match self {
            Self::Rate(rate) => *rate,
            Self::File { seconds, .. } => match seconds.as_slice() {
                [first, .., last] => (seconds.len() - 1) as f64 / (last - first),
                _ => DEFAULT_RATE,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Times> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("times.txt");
        std::fs::write(&path, text).unwrap();
        Times::read(&path)
    }

    #[test]
    fn a_file_gives_each_frame_its_time() {
        let times = read("0.5\n 0.7\n1.5\n\n").unwrap();
        assert!((times.of(1).unwrap() - 0.5).abs() < 1e-12 && (times.of(3).unwrap() - 1.5).abs() < 1e-12);
        assert!((times.mean_rate() - 2.0).abs() < 1e-12);
        let short = times.of(4).unwrap_err().to_string();
        assert!(short.contains("times.txt") && short.contains("line 4"), "{short}");
        assert!(times.check_count(3).is_ok() && times.check_count(5).is_ok());
        assert!(times.check_count(9).unwrap_err().to_string().contains("line 4"));
    }

    #[test]
    fn bad_lines_are_named() {
        for (text, place) in [
            ("0\nx\n", "line 2"),
            ("0\n1\nNaN\n", "line 3"),
            ("0\n1\n1\n", "line 3"),
            ("0\n1\n0.5\n", "line 3"),
            ("0\n\n1\n", "line 2"),
            ("inf\n", "line 1"),
            ("", "whole file"),
        ] {
            let said = read(text).unwrap_err().to_string();
            assert!(said.contains("times.txt") && said.contains(place), "{text:?}: {said}");
        }
    }

    #[test]
    fn a_steady_rate_starts_at_zero() {
        let times = Times::steady(12.0).unwrap();
        assert!(times.of(1).unwrap().abs() < 1e-12 && (times.of(13).unwrap() - 1.0).abs() < 1e-12);
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Times::steady(bad).is_err());
        }
    }
}
