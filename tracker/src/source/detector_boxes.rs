//! A detector's boxes of people, read from a file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::detector_rows::{DetectedBox, parse_row};
use crate::{Error, Result};

/// One camera's boxes, frame by frame, in pixels of what the camera films.
#[derive(Debug, Clone, PartialEq)]
pub struct DetectorBoxes {
    path: PathBuf,
    by_frame: BTreeMap<u32, Vec<DetectedBox>>,
    frames: u32,
    vector_length: usize,
}

impl DetectorBoxes {
    /// Reads a file; an empty one is a detector that found nobody.
    ///
    /// # Errors
    /// Naming file, line and mend: too few columns, a column that is no finite number, a frame that is no whole number from
    /// 1, a box without width or height, an appearance vector of another length than that of the rows before.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &calib::files::read_text(path)?)
    }

    /// [`Self::read`] from text; `path` is only for messages.
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let mut by_frame: BTreeMap<u32, Vec<DetectedBox>> = BTreeMap::new();
        let mut vector_length = None;
        for (index, content) in text.lines().enumerate() {
            let content = content.trim().trim_start_matches('\u{feff}');
            if content.is_empty() || content.starts_with('#') {
                continue;
            }
            let refuse = |problem: String| Error::content(path, format!("line {}", index + 1), problem);
            let (frame, detected) = parse_row(content).map_err(refuse)?;
            let length = detected.appearance.as_ref().map_or(0, |vector| vector.len());
            match vector_length {
                Some(before) if before != length => {
                    return Err(refuse(format!(
                        "has {length} appearance values after the tenth column, but the rows before have {before}; give \
                         all rows the same number"
                    )));
                }
                _ => vector_length = Some(length),
            }
            by_frame.entry(frame).or_default().push(detected);
        }
        let frames = by_frame.last_key_value().map_or(0, |(frame, _)| *frame);
        Ok(Self { path: path.to_owned(), by_frame, frames, vector_length: vector_length.unwrap_or(0) })
    }

    /// File that the boxes were read from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Frames in all: by itself, up to the last one with a box.
    pub fn frame_count(&self) -> u32 {
        self.frames
    }

    /// Length of the appearance vectors; 0 without any.
    pub fn vector_length(&self) -> usize {
        self.vector_length
    }

    /// Makes the frames at least so many: a detector finds nobody in the last ones.
    pub fn extend_to(&mut self, frames: u32) {
        self.frames = self.frames.max(frames);
    }

    /// The boxes of a frame, from 1.
    pub fn of(&self, frame: u64) -> &[DetectedBox] {
        let boxes = u32::try_from(frame).ok().and_then(|frame| self.by_frame.get(&frame));
        boxes.map_or(&[], Vec::as_slice)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mot::rows::PixelBox;

    fn parse(text: &str) -> Result<DetectorBoxes> {
        DetectorBoxes::parse(Path::new("boxes.txt"), text)
    }

    #[test]
    fn boxes_are_read_by_frame_and_ids_are_ignored() {
        let found = parse("# boxes\n2,7,1,2,3,4\n1,7,5,6,7,8,0.5\n2,7,9,9,9,9,1,-1,-1,-1\r\n").unwrap();
        assert_eq!(
            (found.frame_count(), found.of(1).len(), found.of(2).len(), found.of(3).len()),
            (2, 1, 2, 0)
        );
        assert_eq!(found.of(1)[0].pixels, PixelBox { left: 5.0, top: 6.0, width: 7.0, height: 8.0 });
        assert_eq!((found.of(1)[0].appearance.clone(), found.vector_length()), (None, 0));
        let reid = "1,-1,1,2,3,4,0.9,-1,-1,-1,0.5,0.1\n1,-1,1,2,3,4,0.9,-1,-1,-1,0.2,0.7\n";
        let reid = parse(reid).unwrap();
        assert_eq!((reid.of(1).len(), reid.vector_length()), (2, 2));
        assert_eq!(reid.of(1)[1].appearance.as_deref(), Some(&[0.2, 0.7][..]));
        let mut nobody = parse("").unwrap();
        nobody.extend_to(5);
        assert_eq!((nobody.frame_count(), nobody.of(5).len()), (5, 0));
    }

    #[test]
    fn bad_rows_are_named_with_their_line() {
        for (bad, word) in [
            ("1,2,a,4,5,6,7", "left is `a`"),
            ("1,2,3,4,5", "5 columns"),
            ("1,2,3,4,5,inf", "height is inf"),
            ("0,1,1,1,5,5,1", "frames are"),
            ("1.5,1,1,1,5,5,1", "frames are"),
            ("1764151200,1,1,1,5,5,1", "to 100000000"),
            ("1,-1,1,1,0,5,1", "0 × 5 pixels"),
            ("1,-1,1,1e300,5,5,1", "top is 1e300; give -1000000 to 1000000 pixels"),
            ("1,-1,1,1,5,5,1,-1,-1,-1,0.5", "1 appearance values"),
            ("1,-1,1,1,5,5,1,-1,-1,-1,x", "column 11"),
            ("1,-1,1,1,5,5,1,-1,-1,-1,1e300", "column 11 is 1e300"),
            ("\u{0}\u{1}binary", "no number"),
        ] {
            let error = parse(&format!("1,1,0,0,5,5,1\n{bad}\n")).unwrap_err().to_string();
            assert!(error.contains("boxes.txt: line 2") && error.contains(word), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
    }
}
