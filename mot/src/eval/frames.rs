//! Selection of the judged frames: all, a range, or annotated ones.

use std::collections::BTreeSet;
use std::path::Path;
use std::str::FromStr;

use crate::{Error, Result};

/// Selection of frames.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FrameSelection {
    /// First and last frame, both included.
    pub range: Option<FrameRange>,
    /// Frames of an annotation; `None` for all.
    pub annotated: Option<BTreeSet<u32>>,
}

/// Range of frames, both ends included; written `A-B`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    /// First frame, from 1.
    pub first: u32,
    /// Last frame, not before `first`.
    pub last: u32,
}

impl FrameSelection {
    /// Whether a frame is judged.
    pub fn contains(&self, frame: u32) -> bool {
        self.range.is_none_or(|r| (r.first..=r.last).contains(&frame))
            && self.annotated.as_ref().is_none_or(|frames| frames.contains(&frame))
    }

    /// Reads a list of frames, one a line.
    ///
    /// # Errors
    /// A line that is no frame (file and line are named), or a file without frames.
    pub fn read_annotated(path: &Path) -> Result<BTreeSet<u32>> {
        let mut frames = BTreeSet::new();
        for (index, line) in calib::files::read_text(path)?.lines().enumerate() {
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let frame: u32 = line.parse().ok().filter(|f| *f >= 1).ok_or_else(|| {
                Error::content(
                    path,
                    format!("line {}", index + 1),
                    format!("`{line}` is no frame; write one whole number from 1 a line"),
                )
            })?;
            frames.insert(frame);
        }
        if frames.is_empty() {
            return Err(Error::content(path, "whole file", "lists no frame; write one a line"));
        }
        Ok(frames)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parse = |part: &str| part.trim().parse::<u32>().ok().filter(|f| *f >= 1);
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        match (parse(first), parse(last)) {
            (Some(first), Some(last)) if first <= last => Ok(Self { first, last }),
            _ => Err(format!("`{text}` is no range of frames; write it as 1-400")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_and_lists_narrow_each_other() {
        let range: FrameRange = "3-5".parse().unwrap();
        let selection = FrameSelection { range: Some(range), annotated: Some(BTreeSet::from([1, 4, 5, 9])) };
        assert_eq!((1..10).filter(|f| selection.contains(*f)).collect::<Vec<_>>(), [4, 5]);
        assert!(FrameSelection::default().contains(1));
        assert_eq!("7".parse::<FrameRange>(), Ok(FrameRange { first: 7, last: 7 }));
        for bad in ["", "0-3", "5-3", "a-b", "-", "1-2-3"] {
            assert!(bad.parse::<FrameRange>().is_err(), "{bad}");
        }
    }

    #[test]
    fn a_bad_list_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("annotated.txt");
        for (text, place) in [("1\nx\n", "line 2"), ("0", "line 1"), ("", "whole file")] {
            std::fs::write(&path, text).unwrap();
            let error = FrameSelection::read_annotated(&path).unwrap_err().to_string();
            assert!(error.contains("annotated.txt") && error.contains(place), "{error}");
        }
    }
}
