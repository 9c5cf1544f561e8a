//! Frames from whatever a user points at: a video file, a folder of images, a printf pattern, a stream URL or a
//! device number.

use std::path::{Path, PathBuf};

use image::{DynamicImage, Rgb, RgbImage};
use opencv::core::{Mat, Vector};
use opencv::prelude::*;
use opencv::{imgproc, videoio};

use super::adapter;
use crate::{Error, Result};

/// How many frames a container's header may promise beyond what decodes: headers count from durations, and
/// rounding and edit lists make them one or two too many.
const HEADER_SLACK_FRAMES: usize = 3;

/// How long a stream may take to open, and between two of its frames, milliseconds.
const OPENS_WITHIN_MS: i32 = 10_000;
const READS_WITHIN_MS: i32 = 5_000;

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
    backend: Backend,
}

#[derive(Debug)]
enum Backend {
    /// Paths in name order.
    Folder(Vec<PathBuf>),
    Video {
        capture: Box<videoio::VideoCapture>,
        first: Option<Mat>,
        buffer: Mat,
        is_file: bool,
        is_recording: bool,
        /// A device, or a stream that does not say how long it is.
        is_live: bool,
    },
}

impl FrameSource {
    /// Opens `spec`: a folder of images (in name order), or anything OpenCV's `VideoCapture` takes — a file, a
    /// printf pattern such as `frames/%04d.png`, a URL, a device number.
    ///
    /// # Errors
    /// One line that names the source and says what is wrong with it.
    pub fn open(spec: &str) -> Result<Self> {
        let path = Path::new(spec);
        if path.is_dir() {
            return Self::open_folder(path);
        }
        Self::open_video(spec)
    }

    fn open_folder(folder: &Path) -> Result<Self> {
        let entries =
            std::fs::read_dir(folder).map_err(|source| Error::Io { path: folder.to_owned(), source })?;
        let mut paths: Vec<PathBuf> =
            entries.filter_map(|e| Some(e.ok()?.path())).filter(|p| is_image(p)).collect();
        paths.sort();
        let Some(first) = paths.first() else {
            return Err(content(folder, "folder", "holds no .jpg, .jpeg or .png image"));
        };
        let (width, height) = image::image_dimensions(first).map_err(|e| unreadable(first, &e))?;
        Ok(Self {
            name: folder.display().to_string(),
            width,
            height,
            rate: None,
            expected: Some(paths.len()),
            delivered: 0,
            backend: Backend::Folder(paths),
        })
    }

    fn open_video(spec: &str) -> Result<Self> {
        let path = Path::new(spec);
        let device: Option<i32> = spec.parse().ok();
        let is_stream = spec.contains("://");
        let is_pattern = spec.contains('%');
        let is_file = device.is_none() && !is_stream && !is_pattern;
        if is_file {
            let length =
                std::fs::metadata(path).map_err(|source| Error::Io { path: path.to_owned(), source })?.len();
            if length == 0 {
                return Err(content(path, "whole file", "the file is empty"));
            }
        }
        let opening = adapter::refused("opening a video");
        let patience = Vector::from_slice(&[
            videoio::CAP_PROP_OPEN_TIMEOUT_MSEC,
            OPENS_WITHIN_MS,
            videoio::CAP_PROP_READ_TIMEOUT_MSEC,
            READS_WITHIN_MS,
        ]);
        let mut capture = match device {
            Some(number) => videoio::VideoCapture::new(number, videoio::CAP_ANY),
            None if is_pattern => videoio::VideoCapture::from_file(spec, videoio::CAP_IMAGES),
            None if is_stream => {
                videoio::VideoCapture::from_file_with_params(spec, videoio::CAP_FFMPEG, &patience)
            }
            None => videoio::VideoCapture::from_file(spec, videoio::CAP_FFMPEG),
        }
        .map_err(&opening)?;
        let mut first = Mat::default();
        let opened = capture.is_opened().map_err(&opening)? && capture.read(&mut first).map_err(&opening)?;
        if !opened || first.empty() {
            return Err(content(
                path,
                "frame 1",
                "cannot be decoded as video; is the file whole, and a format that ffmpeg knows?",
            ));
        }
        let property = |id: i32| capture.get(id).ok().filter(|v| v.is_finite() && *v > 0.0);
        let countable = is_file || is_pattern;
        let length = property(videoio::CAP_PROP_FRAME_COUNT).map(|n| n as usize);
        Ok(Self {
            name: spec.to_owned(),
            width: first.cols() as u32,
            height: first.rows() as u32,
            rate: property(videoio::CAP_PROP_FPS),
            expected: length.filter(|_| countable),
            delivered: 0,
            backend: Backend::Video {
                capture: Box::new(capture),
                first: Some(first),
                buffer: Mat::default(),
                is_file,
                is_recording: countable,
                is_live: !countable && length.is_none(),
            },
        })
    }

    /// What the user called it.
    pub fn name(&self) -> &str {
        &self.name
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
        let (width, height) = (self.width, self.height);
        if into.dimensions() != (width, height) {
            *into = RgbImage::new(width, height);
        }
        let frame = self.delivered + 1;
        match &mut self.backend {
            Backend::Folder(paths) => {
                let Some(path) = paths.get(self.delivered) else { return Ok(false) };
                let image = in_colour(image::open(path).map_err(|e| unreadable(path, &e))?);
                if image.dimensions() != (width, height) {
                    return Err(wrong_size(path, "image", image.dimensions(), (width, height)));
                }
                *into = image;
            }
            Backend::Video { capture, first, buffer, is_file, .. } => {
                let reading = adapter::refused("reading a video frame");
                let decoded = match first.take() {
                    Some(mat) => {
                        *buffer = mat;
                        true
                    }
                    None => capture.read(buffer).map_err(&reading)? && !buffer.empty(),
                };
                if !decoded {
                    let promised = self.expected.unwrap_or(0);
                    if *is_file && self.delivered + HEADER_SLACK_FRAMES < promised {
                        let place = format!("frame {frame}");
                        let problem = format!(
                            "the file ends here, but its header promises {promised} frames; copy it again"
                        );
                        return Err(content(Path::new(&self.name), &place, &problem));
                    }
                    return Ok(false);
                }
                let size = (buffer.cols() as u32, buffer.rows() as u32);
                if size != (width, height) {
                    return Err(wrong_size(
                        Path::new(&self.name),
                        &format!("frame {frame}"),
                        size,
                        (width, height),
                    ));
                }
                let code =
                    if buffer.channels() == 1 { imgproc::COLOR_GRAY2RGB } else { imgproc::COLOR_BGR2RGB };
                imgproc::cvt_color_def(buffer, &mut adapter::rgb_mut(into)?, code).map_err(&reading)?;
            }
        }
        self.delivered += 1;
        Ok(true)
    }

    /// Passes over a frame without converting it: cheaper than [`Self::read`]. `false` when there are no more; a torn
    /// file ends early here, and [`Self::read`] says so.
    ///
    /// # Errors
    /// When OpenCV refuses.
    pub fn skip(&mut self) -> Result<bool> {
        let more = match &mut self.backend {
            Backend::Folder(paths) => self.delivered < paths.len(),
            Backend::Video { capture, first, .. } => {
                first.take().is_some() || capture.grab().map_err(adapter::refused("passing over a frame"))?
            }
        };
        self.delivered += usize::from(more);
        Ok(more)
    }

    /// Whether this is a recording that can be opened and read again, not a stream or a device.
    pub fn is_recording(&self) -> bool {
        match &self.backend {
            Backend::Folder(_) => true,
            Backend::Video { is_recording, .. } => *is_recording,
        }
    }

    /// Whether this has no end of its own: a device, or a stream that does not say how long it is. Where its frames end, it has
    /// broken off.
    pub fn is_live(&self) -> bool {
        matches!(&self.backend, Backend::Video { is_live: true, .. })
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

fn is_image(path: &Path) -> bool {
    path.extension()
        .and_then(|e| e.to_str())
        .is_some_and(|e| ["jpg", "jpeg", "png"].iter().any(|known| e.eq_ignore_ascii_case(known)))
}

fn content(path: &Path, place: &str, problem: &str) -> Error {
    Error::Content { path: path.to_owned(), place: place.to_owned(), problem: problem.to_owned() }
}

fn unreadable(path: &Path, error: &image::ImageError) -> Error {
    content(path, "image", &format!("cannot be decoded ({error}); is the file whole?"))
}

fn wrong_size(path: &Path, place: &str, (w, h): (u32, u32), (width, height): (u32, u32)) -> Error {
    content(path, place, &format!("is {w} × {h}, the frames before it are {width} × {height}"))
}

/// The picture in three channels. Grey ones (masks) are copied three times: `image` converts their colour space pixel by
/// pixel, which takes longer than everything else that is done with a mask.
fn in_colour(picture: DynamicImage) -> RgbImage {
    match picture {
        DynamicImage::ImageLuma8(grey) => {
            RgbImage::from_fn(grey.width(), grey.height(), |x, y| Rgb([grey.get_pixel(x, y)[0]; 3]))
        }
        other => other.into_rgb8(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::FilmWriter;
    use image::Rgb;

    fn flat(level: u8) -> RgbImage {
        RgbImage::from_pixel(64, 48, Rgb([level, 128, 255 - level]))
    }

    #[test]
    fn folders_come_in_name_order_whatever_the_order_of_writing() {
        let folder = tempfile::tempdir().unwrap();
        for level in [30, 10, 20] {
            flat(level).save(folder.path().join(format!("{level:03}.png"))).unwrap();
        }
        std::fs::write(folder.path().join("notes.txt"), "not an image").unwrap();
        let mut source = FrameSource::open(folder.path().to_str().unwrap()).unwrap();
        assert_eq!((source.frame_count(), source.size(), source.rate()), (Some(3), (64, 48), None));
        let levels: Vec<u8> = source.read_all().unwrap().iter().map(|f| f.get_pixel(5, 5)[0]).collect();
        assert_eq!(levels, [10, 20, 30]);
        let mut source = FrameSource::open(folder.path().to_str().unwrap()).unwrap();
        let mut frame = RgbImage::default();
        assert!(source.is_recording() && source.skip().unwrap() && source.read(&mut frame).unwrap());
        assert_eq!(frame.get_pixel(5, 5)[0], 20);
        assert!(source.skip().unwrap() && !source.skip().unwrap() && !source.read(&mut frame).unwrap());

        let pattern = folder.path().join("%03d.png");
        for level in 0..5 {
            flat(level).save(folder.path().join(format!("{level:03}.png"))).unwrap();
        }
        assert!(FrameSource::open(pattern.to_str().unwrap()).unwrap().read_all().unwrap().len() >= 5);
    }

    #[test]
    fn a_film_comes_back_with_its_size_rate_and_colours() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.mp4");
        let mut writer = FilmWriter::create(&path, 64, 48, 12.0).unwrap();
        for level in [0, 60, 120, 180, 240] {
            writer.write(&flat(level)).unwrap();
        }
        writer.finish().unwrap();
        let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
        assert_eq!(source.size(), (64, 48));
        assert!((source.rate().unwrap() - 12.0).abs() < 0.01);
        let frames = source.read_all().unwrap();
        assert_eq!(frames.len(), 5);
        for (frame, level) in frames.iter().zip([0, 60, 120, 180, 240]) {
            let Rgb([r, _, b]) = *frame.get_pixel(32, 24);
            assert!(r.abs_diff(level) < 24 && b.abs_diff(255 - level) < 24, "{r}, {b} against {level}");
        }
    }

    #[test]
    fn bad_sources_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let said = |path: &Path| {
            let opened = FrameSource::open(path.to_str().unwrap()).and_then(|mut s| s.read_all());
            let text = opened.unwrap_err().to_string();
            assert!(text.contains(path.file_name().unwrap().to_str().unwrap()), "{text}");
            text
        };
        said(&folder.path().join("missing.mp4"));
        let empty = folder.path().join("empty.mp4");
        std::fs::write(&empty, "").unwrap();
        assert!(said(&empty).contains("empty"));
        let text = folder.path().join("text.mp4");
        std::fs::write(&text, "this is no video").unwrap();
        assert!(said(&text).contains("cannot be decoded"));

        let images = folder.path().join("images");
        std::fs::create_dir(&images).unwrap();
        assert!(said(&images).contains("no .jpg"));
        flat(1).save(images.join("1.png")).unwrap();
        RgbImage::new(32, 48).save(images.join("2.png")).unwrap();
        let odd = FrameSource::open(images.to_str().unwrap()).unwrap().read_all().unwrap_err().to_string();
        assert!(odd.contains("2.png") && odd.contains("32 × 48"), "{odd}");
    }
}
