//! Boxes of a live detector, from a pipe or standard input.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::fs::FileTypeExt;

use super::detector_rows::{DetectedBox, DetectedFrame, parse_json, parse_row};

/// Standard input as the name of a source.
const STANDARD_INPUT: &str = "-";
/// Largest length of a line, bytes: a frame of a hundred people with appearance vectors.
const LONGEST_LINE: u64 = 4 << 20;

/// Pipe to which a detector writes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoxStream {
    /// Path of the pipe, or `-` for standard input.
    pub spec: String,
}

impl BoxStream {
    /// The stream with this name, if it is one: `-`, or a pipe.
    pub fn of(spec: &str) -> Option<Self> {
        let is_pipe = || std::fs::metadata(spec).is_ok_and(|of| of.file_type().is_fifo());
        (spec == STANDARD_INPUT || is_pipe()).then(|| Self { spec: spec.to_owned() })
    }

    /// Path at which the rows are read by programs that know nothing of `-`.
    pub fn path(spec: &str) -> &str {
        if spec == STANDARD_INPUT { "/dev/stdin" } else { spec }
    }

    /// Opens the pipe, which waits for a detector that opens its other end.
    ///
    /// # Errors
    /// A pipe that has gone, or may not be read.
    pub fn open(&self) -> io::Result<BufReader<File>> {
        File::open(Self::path(&self.spec)).map(BufReader::new)
    }
}

/// Reads the next line, without its end; `None` at the end of the stream.
///
/// # Errors
/// The stream's, a line that is no UTF-8 or longer than [`LONGEST_LINE`].
pub fn next_line(reader: &mut impl BufRead) -> io::Result<Option<String>> {
    let mut line = String::new();
    reader.take(LONGEST_LINE).read_line(&mut line)?;
    if line.is_empty() {
        return Ok(None);
    }
    if line.len() as u64 == LONGEST_LINE {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "a line has more than 4 MiB"));
    }
    Ok(Some(line))
}

/// A frame with the arrival of its first row, seconds since 1970.
#[derive(Debug, Clone, PartialEq)]
pub struct ArrivedFrame {
    /// The frame.
    pub frame: DetectedFrame,
    /// Arrival of its first row, seconds since 1970.
    pub arrived_s: f64,
}

/// Assembles frames from lines as they arrive.
///
/// A JSON line is a frame. MOTChallenge rows of one frame come one after the other; the frame is complete when a row of
/// another one comes, or when the caller has waited for long enough.
#[derive(Debug, Default)]
pub struct FrameAssembler {
    /// Frame number, arrival and boxes of the rows that have come.
    open: Option<(u32, f64, Vec<DetectedBox>)>,
}

impl FrameAssembler {
    /// Whether a frame has begun whose end is not known.
    pub fn is_open(&self) -> bool {
        self.open.is_some()
    }

    /// Takes a line, and returns the frames that it completes, in their order.
    ///
    /// # Errors
    /// Names the column or key and the mend.
    pub fn take(&mut self, line: &str, arrived_s: f64) -> Result<Vec<ArrivedFrame>, String> {
        let content = line.trim().trim_start_matches('\u{feff}');
        if content.is_empty() || content.starts_with('#') {
            return Ok(Vec::new());
        }
        if content.starts_with('{') {
            let frame = parse_json(content)?;
            return Ok(self.finish().into_iter().chain([ArrivedFrame { frame, arrived_s }]).collect());
        }
        let (number, detected) = parse_row(content)?;
        if let Some((of, _, boxes)) = &mut self.open
            && *of == number
        {
            boxes.push(detected);
            return Ok(Vec::new());
        }
        let complete = self.finish();
        self.open = Some((number, arrived_s, vec![detected]));
        Ok(complete.into_iter().collect())
    }

    /// Completes the frame that has begun.
    pub fn finish(&mut self) -> Option<ArrivedFrame> {
        let (_, arrived_s, boxes) = self.open.take()?;
        Some(ArrivedFrame { frame: DetectedFrame { time_s: None, boxes }, arrived_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arrival and number of boxes of each frame.
    fn shapes(frames: &[ArrivedFrame]) -> Vec<(f64, usize)> {
        frames.iter().map(|arrived| (arrived.arrived_s, arrived.frame.boxes.len())).collect()
    }

    #[test]
    fn rows_of_one_frame_come_together_at_the_arrival_of_the_first() {
        let mut assembler = FrameAssembler::default();
        let mut found = Vec::new();
        for (line, arrived_s) in [
            ("# boxes", 0.0),
            ("7,-1,1,2,3,4,1", 1.0),
            ("7,-1,9,2,3,4,1\r\n", 1.1),
            ("", 1.2),
            ("9,-1,1,2,3,4", 2.0),
        ] {
            found.extend(assembler.take(line, arrived_s).unwrap());
        }
        assert_eq!(shapes(&found), [(1.0, 2)]);
        // A detector that was started anew counts from 1 again.
        assert_eq!(shapes(&assembler.take("1,-1,1,2,3,4", 3.0).unwrap()), [(2.0, 1)]);
        assert!(assembler.is_open());
        assert_eq!(shapes(&assembler.finish().into_iter().collect::<Vec<_>>()), [(3.0, 1)]);
        assert_eq!((assembler.finish(), assembler.is_open()), (None, false));
    }

    #[test]
    fn a_json_line_is_complete_at_once_and_ends_the_rows_before_it() {
        let mut assembler = FrameAssembler::default();
        assert!(assembler.take("1,-1,1,2,3,4", 1.0).unwrap().is_empty());
        assert_eq!(shapes(&assembler.take(r#"{"boxes":[]}"#, 2.0).unwrap()), [(1.0, 1), (2.0, 0)]);
        assert!(!assembler.is_open());
    }

    #[test]
    fn lines_end_with_the_stream_and_have_a_greatest_length() {
        let mut text = "a\nb".as_bytes();
        let lines = [(); 3].map(|()| next_line(&mut text).unwrap());
        assert_eq!(lines, [Some("a\n".to_owned()), Some("b".to_owned()), None]);
        let endless = vec![b'1'; LONGEST_LINE as usize + 1];
        assert!(next_line(&mut endless.as_slice()).unwrap_err().to_string().contains("4 MiB"));
    }

    #[test]
    fn files_are_no_streams() {
        let file = tempfile::NamedTempFile::new().unwrap();
        assert_eq!(BoxStream::of(file.path().to_str().unwrap()), None);
        assert!(BoxStream::of("nowhere").is_none() && BoxStream::of("-").is_some());
    }
}
