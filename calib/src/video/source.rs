//! Frames from whatever a user points at: a video file, a folder of images, a printf pattern, a stream URL or a
//! device number.

use std::path::Path;

use image::RgbImage;

use super::content;
use super::decoder::Decoder;
#[cfg(target_os = "linux")]
use super::device::Device;
use super::images::Images;
use crate::{Error, Result};

/// How many frames a container's header may promise beyond what decodes: headers count from durations, and
/// rounding and edit lists make them one or two too many.
const HEADER_SLACK_FRAMES: usize = 3;

/// A sequence of colour images of one size.
#[derive(Debug)]
pub struct FrameSource {
    name: String,
    width: u32,
    height: u32,
    /// Frames a second, where the source says so.
    rate: Option<f64>,
    /// Frames in all, where the source can know.
    expected: Option<usize>,
    delivered: usize,
    /// The first frame of a video is decoded when it is opened: its size is known then, and that it can be decoded.
    is_ahead: bool,
    origin: Origin,
    pictures: Pictures,
}

/// What the user pointed at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Origin {
    Images,
    File,
    /// A URL that says how long it lasts: a recording, but not ours to read twice.
    Download,
    /// A device, or a stream without an end.
    Live,
}

#[derive(Debug)]
enum Pictures {
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
        let (width, height) = images.size()?;
        Ok(Self {
            name: spec.to_owned(),
            width,
            height,
            rate: None,
            expected: Some(images.len()),
            delivered: 0,
            is_ahead: false,
            origin: Origin::Images,
            pictures: Pictures::Images(images),
        })
    }

    fn open_file(spec: &str) -> Result<Self> {
        let path = Path::new(spec);
        let length =
            std::fs::metadata(path).map_err(|source| Error::Io { path: path.to_owned(), source })?.len();
        if length == 0 {
            return Err(content(path, "whole file", "the file is empty"));
        }
        Self::of_video(spec, Origin::File, Decoder::open_file(spec))
    }

    fn open_url(spec: &str) -> Result<Self> {
        let opened = Decoder::open_url(spec);
        let lasts = opened.as_ref().is_ok_and(|decoder| decoder.frames().is_some());
        Self::of_video(spec, if lasts { Origin::Download } else { Origin::Live }, opened)
    }

    fn of_video(
        spec: &str,
        origin: Origin,
        opened: std::result::Result<Decoder, ffmpeg::Error>,
    ) -> Result<Self> {
        let undecodable = |why: &str| {
            let mend = if origin == Origin::File { "is it whole" } else { "does it stream" };
            let problem =
                format!("cannot be decoded as video ({why}); {mend}, and in a format that ffmpeg knows?");
            content(Path::new(spec), "frame 1", &problem)
        };
        let mut decoder = opened.map_err(|error| undecodable(&error.to_string()))?;
        if !decoder.advance() {
            return Err(undecodable("there is no picture in it"));
        }
        let (width, height) = decoder.size();
        Ok(Self {
            name: spec.to_owned(),
            width,
            height,
            rate: decoder.rate_hz(),
            expected: decoder.frames().filter(|_| origin == Origin::File),
            delivered: 0,
            is_ahead: true,
            origin,
            pictures: Pictures::Video(Box::new(decoder)),
        })
    }

    #[cfg(target_os = "linux")]
    fn open_device(spec: &str, number: usize) -> Result<Self> {
        let cannot = |problem: String| content(Path::new(spec), "device", &problem);
        let mut device = Device::open(number).map_err(cannot)?;
        if !device.advance() {
            return Err(cannot("sends no picture; is another program using it?".to_owned()));
        }
        let (width, height) = device.size();
        Ok(Self {
            name: spec.to_owned(),
            width,
            height,
            rate: device.rate_hz(),
            expected: None,
            delivered: 0,
            is_ahead: true,
            origin: Origin::Live,
            pictures: Pictures::Device(Box::new(device)),
        })
    }

    #[cfg(not(target_os = "linux"))]
    fn open_device(spec: &str, _: usize) -> Result<Self> {
        let problem = "devices are read on Linux only; let ffmpeg stream it and give the stream's URL";
        Err(content(Path::new(spec), "device", problem))
    }

    /// What the user called it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The first file, of images in files.
    pub fn first_image(&self) -> Option<&Path> {
        match &self.pictures {
            Pictures::Images(images) => Some(images.first()),
            _ => None,
        }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Frames a second, where the source says so (a folder of images does not).
    pub fn rate(&self) -> Option<f64> {
        self.rate
    }

    /// Frames in all, where the source can know; a container's header may be off by a few.
    pub fn frame_count(&self) -> Option<usize> {
        self.expected
    }

    /// Frames delivered so far.
    pub fn delivered(&self) -> usize {
        self.delivered
    }

    /// The next frame into `into`, which is resized if need be. `false` when there are no more.
    ///
    /// # Errors
    /// A frame that cannot be decoded, one of another size, or a file that ends before the frame its own header
    /// promises; the line names source and frame.
    pub fn read(&mut self, into: &mut RgbImage) -> Result<bool> {
        let size = (self.width, self.height);
        if into.dimensions() != size {
            *into = RgbImage::new(self.width, self.height);
        }
        let place = format!("frame {}", self.delivered + 1);
        if !self.advance() {
            let promised = self.expected.unwrap_or(0);
            if self.origin == Origin::File && self.delivered + HEADER_SLACK_FRAMES < promised {
                let problem =
                    format!("the file ends here, but its header promises {promised} frames; copy it again");
                return Err(content(Path::new(&self.name), &place, &problem));
            }
            return Ok(false);
        }
        let refused = |error: ffmpeg::Error| content(Path::new(&self.name), &place, &error.to_string());
        match &mut self.pictures {
            Pictures::Images(images) => images.picture(into)?,
            Pictures::Video(decoder) if decoder.size() != size => {
                let ((w, h), (width, height)) = (decoder.size(), size);
                let problem = format!("is {w} × {h}, the frames before it are {width} × {height}");
                return Err(content(Path::new(&self.name), &place, &problem));
            }
            Pictures::Video(decoder) => decoder.picture(into).map_err(refused)?,
            #[cfg(target_os = "linux")]
            Pictures::Device(device) => device.picture(into).map_err(refused)?,
        }
        self.delivered += 1;
        Ok(true)
    }

    /// Passes over a frame without converting it: cheaper than [`Self::read`]. `false` when there are no more; a torn
    /// file ends early here, and [`Self::read`] says so.
    pub fn skip(&mut self) -> bool {
        let more = self.advance();
        self.delivered += usize::from(more);
        more
    }

    fn advance(&mut self) -> bool {
        if std::mem::take(&mut self.is_ahead) {
            return true;
        }
        match &mut self.pictures {
            Pictures::Images(images) => images.advance(),
            Pictures::Video(decoder) => decoder.advance(),
            #[cfg(target_os = "linux")]
            Pictures::Device(device) => device.advance(),
        }
    }

    /// Whether this is a recording that can be opened and read again, not a stream or a device.
    pub fn is_recording(&self) -> bool {
        matches!(self.origin, Origin::Images | Origin::File)
    }

    /// Whether this has no end of its own: a device, or a stream that does not say how long it is. Where its frames end, it has
    /// broken off.
    pub fn is_live(&self) -> bool {
        self.origin == Origin::Live
    }

    /// All remaining frames.
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
