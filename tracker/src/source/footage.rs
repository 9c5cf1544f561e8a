//! One camera's pictures, frame by frame. A recording that fits into memory is decoded once, although it is needed
//! twice: looked through for the empty scene, then followed. A live stream that breaks off is opened again
//! ([`Reconnection`]).

use std::borrow::Cow;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

use calib::video::FrameSource;
use image::RgbImage;

use super::reconnection::Reconnection;
use super::sampling;
use crate::{Error, Result};

/// A source of frames, some of which may be decoded already.
#[derive(Debug)]
pub struct Footage {
    source: FrameSource,
    /// Frames decoded ahead, with the time that took each of them.
    ahead: VecDeque<(RgbImage, Duration)>,
    /// Why decoding ahead stopped before the end: told in its turn, after the frames before it.
    failure: Option<Error>,
    /// While a live stream is away.
    reconnection: Option<Reconnection>,
    delivered: u32,
}

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// A frame, and how long decoding it took.
    Frame(Duration),
    /// A frame that a live stream would have had, had it not broken off.
    Missing,
    /// Nothing more.
    End,
}

impl Footage {
    /// The frames of a source that has delivered none yet.
    pub fn new(source: FrameSource) -> Self {
        Self { source, ahead: VecDeque::new(), failure: None, reconnection: None, delivered: 0 }
    }

    /// Where the frames come from.
    pub fn source(&self) -> &FrameSource {
        &self.source
    }

    /// Frames delivered, passed over or missed so far.
    pub fn delivered(&self) -> u32 {
        self.delivered
    }

    /// Frames evenly spread over the recording (see [`sampling`]), before the first has been delivered. If all frames fit
    /// into `memory_bytes` they are decoded now and kept until they are delivered; otherwise the recording is opened a
    /// second time.
    ///
    /// # Errors
    /// As [`FrameSource::read`], for a recording that is not kept or has no frame at all.
    pub fn look_through(&mut self, memory_bytes: usize) -> Result<Vec<Cow<'_, RgbImage>>> {
        let (width, height) = self.source.size();
        let most = memory_bytes / (3 * width as usize * height as usize).max(1);
        let whole = self.source.frame_count().is_some_and(|count| count <= most) && self.decode_ahead(most);
        if !whole {
            let frames = sampling::spread(self.source.name())?;
            return Ok(frames.into_iter().map(Cow::Owned).collect());
        }
        if self.ahead.is_empty()
            && let Some(failure) = self.failure.take()
        {
            return Err(failure);
        }
        let stride = sampling::stride(self.ahead.len(), self.source.size());
        Ok(self.ahead.iter().step_by(stride).map(|(frame, _)| Cow::Borrowed(frame)).collect())
    }

    /// Decodes everything up to the end or a failure; whether that were no more than `most` frames.
    fn decode_ahead(&mut self, most: usize) -> bool {
        let (width, height) = self.source.size();
        while self.ahead.len() < most {
            let started = Instant::now();
            let mut frame = RgbImage::new(width, height);
            match self.source.read(&mut frame) {
                Ok(true) => self.ahead.push_back((frame, started.elapsed())),
                Ok(false) => return true,
                Err(failure) => {
                    self.failure = Some(failure.into());
                    return true;
                }
            }
        }
        // The header promised fewer than there are.
        false
    }

    /// The next frame into `into` (its old buffer may go).
    ///
    /// # Errors
    /// As [`FrameSource::read`].
    pub fn read(&mut self, into: &mut RgbImage) -> Result<Next> {
        if let Some((frame, decoding)) = self.ahead.pop_front() {
            *into = frame;
            self.delivered += 1;
            return Ok(Next::Frame(decoding));
        }
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        if !self.is_there() {
            return Ok(Next::Missing);
        }
        let started = Instant::now();
        let more = self.source.read(into)?;
        Ok(self.counted(more.then(|| started.elapsed())))
    }

    /// Passes over a frame. `false` when there are no more, or decoding fails; [`Self::read`] then says why.
    pub fn skip(&mut self) -> bool {
        if self.ahead.pop_front().is_some() {
            self.delivered += 1;
            return true;
        }
        if self.failure.is_some() {
            return false;
        }
        if !self.is_there() {
            return true;
        }
        let more = self.source.skip();
        self.counted(more.then_some(Duration::ZERO)) != Next::End
    }

    /// Whether the source is there, or there again; a frame of one that is not goes missing.
    fn is_there(&mut self) -> bool {
        let Some(reconnection) = &mut self.reconnection else { return true };
        let Some(source) = reconnection.next() else {
            self.delivered += 1;
            return false;
        };
        (self.source, self.reconnection) = (source, None);
        true
    }

    /// What came of asking for a frame. A live stream has no end.
    fn counted(&mut self, took: Option<Duration>) -> Next {
        if took.is_none() && !self.source.is_live() {
            return Next::End;
        }
        self.delivered += 1;
        took.map_or_else(
            || {
                self.reconnection = Some(Reconnection::start(&self.source));
                Next::Missing
            },
            Next::Frame,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    fn folder(count: u8) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for i in 0..count {
            let picture = RgbImage::from_pixel(8, 6, Rgb([i; 3]));
            picture.save(folder.path().join(format!("{i:03}.png"))).unwrap();
        }
        folder
    }

    fn footage(folder: &tempfile::TempDir) -> Footage {
        Footage::new(FrameSource::open(folder.path().to_str().unwrap()).unwrap())
    }

    fn rest(footage: &mut Footage) -> Result<Vec<u8>> {
        let (mut levels, mut frame) = (Vec::new(), RgbImage::default());
        while footage.read(&mut frame)? != Next::End {
            levels.push(frame.get_pixel(0, 0)[0]);
        }
        Ok(levels)
    }

    #[test]
    fn frames_looked_at_are_those_of_a_second_look_and_all_come_after() {
        let folder = folder(130);
        let all: Vec<u8> = (0..130).collect();
        for memory in [1 << 30, 100 * 8 * 6 * 3] {
            let mut looked = footage(&folder);
            let samples: Vec<RgbImage> =
                looked.look_through(memory).unwrap().into_iter().map(Cow::into_owned).collect();
            assert_eq!(samples, sampling::spread(folder.path().to_str().unwrap()).unwrap());
            assert_eq!(looked.ahead.len(), if memory == 1 << 30 { 130 } else { 0 });
            assert_eq!(rest(&mut looked).unwrap(), all);
            assert_eq!(looked.delivered(), 130);
        }
    }

    #[test]
    fn a_torn_frame_is_told_after_the_frames_before_it() {
        let folder = folder(9);
        std::fs::write(folder.path().join("004.png"), "torn").unwrap();
        let mut looked = footage(&folder);
        assert_eq!(looked.look_through(1 << 30).unwrap().len(), 4);
        let mut frame = RgbImage::default();
        for level in 0..4 {
            assert!(matches!(looked.read(&mut frame).unwrap(), Next::Frame(_)));
            assert_eq!(frame.get_pixel(0, 0)[0], level);
        }
        let said = looked.read(&mut frame).unwrap_err().to_string();
        assert!(said.contains("004.png"), "{said}");
    }
}
