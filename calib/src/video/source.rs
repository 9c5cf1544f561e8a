//! Frames from any source that a user names: a video file, a folder of images, a printf pattern, a stream URL or a
//! device number.

use std::path::Path;

use image::RgbImage;

use super::decoder::{Decoder, PacketEnd};
#[cfg(target_os = "linux")]
use super::device::Device;
use super::extent;
use super::images::Images;
use super::stamp::FrameStamp;
use crate::{Error, Result};

/// Number of frames at the end of a file that may fail to decode without an error: players do not show them, either.
const TORN_SLACK_FRAMES: usize = 3;

/// FFmpeg's names of formats made for recordings that stop at any time, also in the middle of a frame.
const ENDS_ANYWHERE: &[&str] = &["mpegts", "mpeg"];

/// A sequence of colour images.
///
/// [`advance`](Self::advance) goes on to the next frame, [`picture`](Self::picture) converts it, at any size and more
/// than once. [`read`](Self::read) does both, for callers that need one size from the first frame to the last.
#[derive(Debug)]
pub struct FrameSource {
    name: String,
    width: u32,
    height: u32,
    /// Frames per second, where the source states it.
    rate: Option<f64>,
    /// Number of frames, where the source can know it.
    expected: Option<usize>,
    delivered: usize,
    frame_size: (u32, u32),
    stamp: FrameStamp,
    /// Whether the first frame is decoded but not yet delivered: opening a video decodes it, to learn its size and that
    /// it can be decoded.
    is_ahead: bool,
    is_at_end: bool,
    kind: SourceKind,
    pictures: PictureReader,
}

/// Kind of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SourceKind {
    Images,
    File,
    /// A URL that states its duration: a recording, but one that cannot be read twice.
    Download,
    /// A device, or a stream without an end.
    Live,
}

#[derive(Debug)]
enum PictureReader {
    Images(Images),
    Video(Box<Decoder>),
    #[cfg(target_os = "linux")]
    Device(Box<Device>),
}

impl FrameSource {
    /// Opens `spec`: a folder of images (in name order), a file or a URL that FFmpeg knows how to read, a printf pattern
    /// such as `frames/%04d.png`, or a device number.
    ///
    /// # Errors
    /// One line that names the source and says what is wrong with it.
    pub fn open(spec: &str) -> Result<Self> {
        let path = Path::new(spec);
        if path.is_dir() {
            return Self::of_images(spec, Images::in_folder(path)?);
        }
        if spec.contains("://") {
            return Self::open_url(spec);
        }
        if let Ok(number) = spec.parse() {
            return Self::open_device(spec, number);
        }
        if spec.contains('%') && !path.exists() {
            return Self::of_images(spec, Images::of_pattern(spec)?);
        }
        Self::open_file(spec)
    }

    fn of_images(spec: &str, images: Images) -> Result<Self> {
        let (size, expected) = (images.size()?, Some(images.len()));
        let pictures = PictureReader::Images(images);
        let first = Self::of_first_picture(spec, SourceKind::Images, size, None, pictures);
        Ok(Self { expected, is_ahead: false, ..first })
    }

    fn open_file(spec: &str) -> Result<Self> {
        let path = Path::new(spec);
        let length = std::fs::metadata(path).map_err(Error::io(path))?.len();
        if length == 0 {
            return Err(Error::content(path, "whole file", "the file is empty"));
        }
        Self::of_video(spec, SourceKind::File, Decoder::open_file(spec))
    }

    fn open_url(spec: &str) -> Result<Self> {
        let opened = Decoder::open_url(spec);
        let lasts = opened.as_ref().is_ok_and(|decoder| decoder.frames().is_some());
        Self::of_video(spec, if lasts { SourceKind::Download } else { SourceKind::Live }, opened)
    }

    fn of_video(
        spec: &str,
        kind: SourceKind,
        opened: std::result::Result<Decoder, ffmpeg::Error>,
    ) -> Result<Self> {
        let undecodable = |why: &str| {
            let mend = if kind == SourceKind::File { "is it whole" } else { "does it stream" };
            let problem =
                format!("cannot be decoded as video ({why}); {mend}, and in a format that ffmpeg knows?");
            Error::content(Path::new(spec), "frame 1", &problem)
        };
        let mut decoder = opened.map_err(|error| undecodable(&error.to_string()))?;
        if !decoder.advance() {
            return Err(undecodable("there is no picture in it, or one of more than 200 megapixels"));
        }
        let (size, rate) = (decoder.size(), decoder.rate_hz());
        let expected = decoder.frames().filter(|_| kind == SourceKind::File);
        let pictures = PictureReader::Video(Box::new(decoder));
        Ok(Self { expected, ..Self::of_first_picture(spec, kind, size, rate, pictures) })
    }

    /// Source whose reader is at its first picture.
    fn of_first_picture(
        spec: &str,
        kind: SourceKind,
        (width, height): (u32, u32),
        rate: Option<f64>,
        pictures: PictureReader,
    ) -> Self {
        Self {
            name: spec.to_owned(),
            width,
            height,
            rate,
            expected: None,
            delivered: 0,
            frame_size: (width, height),
            stamp: FrameStamp::now(),
            is_ahead: true,
            is_at_end: false,
            kind,
            pictures,
        }
    }

    #[cfg(target_os = "linux")]
    fn open_device(spec: &str, number: usize) -> Result<Self> {
        let cannot = |problem: String| Error::content(Path::new(spec), "device", &problem);
        let mut device = Device::open(number).map_err(cannot)?;
        if !device.advance() {
            return Err(cannot("sends no picture; is another program using it?".to_owned()));
        }
        let (size, rate) = (device.size(), device.rate_hz());
        let pictures = PictureReader::Device(Box::new(device));
        Ok(Self::of_first_picture(spec, SourceKind::Live, size, rate, pictures))
    }

    #[cfg(not(target_os = "linux"))]
    fn open_device(spec: &str, _: usize) -> Result<Self> {
        let problem = "devices are read on Linux only; let ffmpeg stream it and give the stream's URL";
        Err(Error::content(Path::new(spec), "device", problem))
    }

    /// Name of the source as the user gave it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Path of the image that was read last; `None` for sources that are not image files.
    pub fn image_path(&self) -> Option<&Path> {
        match &self.pictures {
            PictureReader::Images(images) => Some(images.path()),
            _ => None,
        }
    }

    /// Path of the first image; `None` for sources that are not image files.
    pub fn first_image(&self) -> Option<&Path> {
        match &self.pictures {
            PictureReader::Images(images) => Some(images.first()),
            _ => None,
        }
    }

    /// Width and height of the first frame, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Width and height of the frame that was decoded last, or is to be the first, upright, pixels.
    pub fn frame_size(&self) -> (u32, u32) {
        self.frame_size
    }

    /// Times of the frame that was read, decoded or skipped last; before the first one, those of opening the source.
    pub fn stamp(&self) -> FrameStamp {
        self.stamp
    }

    /// Frames per second, where the source states it (a folder of images does not).
    pub fn rate(&self) -> Option<f64> {
        self.rate
    }

    /// Mean number of frames per second, where a film's container states it: below [`rate`](Self::rate) where frames are lost.
    pub fn mean_rate(&self) -> Option<f64> {
        match &self.pictures {
            PictureReader::Video(decoder) => decoder.mean_rate_hz(),
            _ => None,
        }
    }

    /// Number of frames, where the source can know it. For a video this is an estimate from the container's header:
    /// frames may be lost, or come at an uneven rate.
    pub fn frame_count(&self) -> Option<usize> {
        self.expected
    }

    /// Number of frames delivered or skipped so far.
    pub fn delivered(&self) -> usize {
        self.delivered
    }

    /// Decodes the next frame, which [`picture`](Self::picture) then converts. `false` when there are no more. A
    /// frame may differ in size from those before it: see [`frame_size`](Self::frame_size).
    ///
    /// # Errors
    /// An image that cannot be decoded, or a torn file: it ends before the frames that its own header promises, or
    /// its last frames cannot be decoded. The line names source and frame. Frames that a complete file has lost, or
    /// does not show, are not an error.
    pub fn advance(&mut self) -> Result<bool> {
        if !self.step() {
            return self.check_complete().map(|()| false);
        }
        self.frame_size = match &mut self.pictures {
            PictureReader::Images(images) => images.decode()?,
            PictureReader::Video(decoder) => decoder.size(),
            #[cfg(target_os = "linux")]
            PictureReader::Device(device) => device.size(),
        };
        self.delivered += 1;
        Ok(true)
    }

    /// Converts the frame that was decoded or skipped last into `into`, at the size of `into`. Where that is smaller
    /// than the frame, areas are averaged, in the same pass as the conversion of colours. At
    /// [`frame_size`](Self::frame_size) the result equals that of [`read`](Self::read).
    ///
    /// # Errors
    /// Before the first frame, an image without pixels, or a frame that cannot be converted.
    pub fn picture(&mut self, into: &mut RgbImage) -> Result<()> {
        let place = format!("frame {}", self.delivered);
        let refused = |problem: &str| Error::content(Path::new(&self.name), &place, problem);
        if self.delivered == 0 || self.is_at_end || into.is_empty() {
            let problem =
                if into.is_empty() { "is asked for without a size" } else { "is none; advance first" };
            return Err(refused(problem));
        }
        match &mut self.pictures {
            PictureReader::Images(images) => images.picture(into),
            PictureReader::Video(decoder) => {
                decoder.picture(into).map_err(|error| refused(&error.to_string()))
            }
            #[cfg(target_os = "linux")]
            PictureReader::Device(device) => {
                device.picture(into).map_err(|error| refused(&error.to_string()))
            }
        }
    }

    /// Decodes the next frame, as [`advance`](Self::advance), which must have the size of the first.
    ///
    /// # Errors
    /// As [`advance`](Self::advance), and a frame of another size than the first.
    pub fn advance_alike(&mut self) -> Result<bool> {
        if !self.advance()? {
            return Ok(false);
        }
        let ((w, h), (width, height)) = (self.frame_size, self.size());
        if (w, h) != (width, height) {
            let problem = format!("is {w} × {h}, the frames before it are {width} × {height}");
            return Err(match &self.pictures {
                PictureReader::Images(images) => Error::content(images.path(), "image", &problem),
                _ => Error::content(Path::new(&self.name), format!("frame {}", self.delivered), &problem),
            });
        }
        Ok(true)
    }

    /// Reads the next frame into `into`, which is resized if need be. `false` when there are no more.
    ///
    /// # Errors
    /// As [`advance_alike`](Self::advance_alike).
    pub fn read(&mut self, into: &mut RgbImage) -> Result<bool> {
        if !self.advance_alike()? {
            return Ok(false);
        }
        let (width, height) = self.size();
        if into.dimensions() != (width, height) {
            *into = RgbImage::new(width, height);
        }
        self.picture(into)?;
        Ok(true)
    }

    /// Skips, from now on, the frames of a video that no other frame refers to: half of the frames of most files, which
    /// then take little more than half of the time. Images and devices deliver every frame.
    ///
    /// For looks at a recording as a whole. A torn end may go unreported then.
    pub fn only_references(&mut self) {
        if let PictureReader::Video(decoder) = &mut self.pictures {
            decoder.only_references();
        }
    }

    /// Skips a frame; cheaper than [`Self::advance`] for images, which are not decoded. `false` when there are no
    /// more; a torn file ends early here, and [`Self::advance`] and [`Self::read`] report it.
    pub fn skip(&mut self) -> bool {
        let more = self.step();
        self.delivered += usize::from(more);
        more
    }

    /// Goes on to the next frame.
    fn step(&mut self) -> bool {
        let is_ahead = std::mem::take(&mut self.is_ahead);
        let (more, stamp) = match &mut self.pictures {
            PictureReader::Images(images) => (images.advance(), FrameStamp::now()),
            PictureReader::Video(decoder) => (is_ahead || decoder.advance(), decoder.stamp()),
            #[cfg(target_os = "linux")]
            PictureReader::Device(device) => (is_ahead || device.advance(), device.stamp()),
        };
        if more {
            self.stamp = stamp;
        }
        self.is_at_end = !more;
        more
    }

    /// Checks that a file which has ended is complete. The check compares bytes with the sizes in the container, not
    /// numbers of frames: an edit list shows fewer frames than there are, and recorders lose some.
    fn check_complete(&self) -> Result<()> {
        let PictureReader::Video(decoder) = &self.pictures else { return Ok(()) };
        if self.kind != SourceKind::File {
            return Ok(());
        }
        let path = Path::new(&self.name);
        let format = decoder.format();
        let is_cut_off = extent::is_cut_off(path, &format).map_err(Error::io(path))?
            || (decoder.end() == Some(PacketEnd::InPacket) && !ENDS_ANYWHERE.contains(&format.as_str()));
        let promised = self.expected.filter(|promised| *promised > self.delivered);
        let problem = match (decoder.end(), promised) {
            (Some(PacketEnd::Broken(error)), _) => format!("cannot be read ({error}); copy the file again"),
            (_, Some(promised)) if is_cut_off => {
                format!("the file ends here, but its header promises {promised} frames; copy it again")
            }
            _ if is_cut_off => "the file ends here, but its header promises more; copy it again".to_owned(),
            _ if decoder.undecodable() > TORN_SLACK_FRAMES => {
                "the rest of the file cannot be decoded; copy it again".to_owned()
            }
            _ => return Ok(()),
        };
        Err(Error::content(path, format!("frame {}", self.delivered + 1), &problem))
    }

    /// Tells whether this is a recording that can be opened and read again, not a stream or a device.
    pub fn is_recording(&self) -> bool {
        matches!(self.kind, SourceKind::Images | SourceKind::File)
    }

    /// Tells whether the source has no end of its own: a device, or a stream that does not state its duration. Where
    /// its frames end, it has broken off.
    pub fn is_live(&self) -> bool {
        self.kind == SourceKind::Live
    }

    /// Reads all remaining frames.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn read_all(&mut self) -> Result<Vec<RgbImage>> {
        let mut frames = Vec::with_capacity(self.expected.unwrap_or(0).min(100_000));
        loop {
            let mut frame = RgbImage::new(self.width, self.height);
            if !self.read(&mut frame)? {
                return Ok(frames);
            }
            frames.push(frame);
        }
    }
}
