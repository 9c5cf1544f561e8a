//! Frames from whatever a user points at: a video file, a folder of images, a printf pattern, a stream URL or a
//! device number.

use std::path::Path;

use image::RgbImage;

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

fn content(path: &Path, place: &str, problem: &str) -> Error {
    Error::Content { path: path.to_owned(), place: place.to_owned(), problem: problem.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::video::FilmWriter;
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
        assert!(source.is_recording() && source.skip() && source.read(&mut frame).unwrap());
        assert_eq!(frame.get_pixel(5, 5)[0], 20);
        assert!(source.skip() && !source.skip() && !source.read(&mut frame).unwrap());

        let numbered = tempfile::tempdir().unwrap();
        for level in 0..5 {
            flat(level).save(numbered.path().join(format!("{level:03}.png"))).unwrap();
        }
        let mut source = FrameSource::open(numbered.path().join("%03d.png").to_str().unwrap()).unwrap();
        assert!(source.is_recording() && !source.is_live());
        assert_eq!((source.frame_count(), source.read_all().unwrap().len()), (Some(5), 5));
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

    /// A film of one picture, red at the left and blue at the right, and whether it is to be turned when it is seen.
    fn lying_film(path: &Path, matrix: [i32; 4]) {
        let mut writer = FilmWriter::create(path, 64, 48, 10.0).unwrap();
        let picture =
            RgbImage::from_fn(64, 48, |x, _| if x < 32 { Rgb([220, 30, 30]) } else { Rgb([30, 30, 220]) });
        writer.write(&picture).unwrap();
        writer.finish().unwrap();
        // The track's header (ISO 14496-12, `tkhd`) holds the matrix a b u, c d v, x y w as it stands on paper.
        let mut bytes = std::fs::read(path).unwrap();
        let header = bytes.windows(4).position(|name| name == b"tkhd").unwrap();
        for (index, value) in [(0, matrix[0]), (1, matrix[1]), (3, matrix[2]), (4, matrix[3])] {
            let at = header + 4 + 40 + 4 * index;
            bytes[at..at + 4].copy_from_slice(&(value << 16).to_be_bytes());
        }
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn a_telephones_film_is_turned_the_way_it_was_held() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("telephone.mp4");
        // Where the picture's x and y axes go, in axes right and down; the size; a pixel that is red then, and one that is blue.
        for (matrix, size, red, blue) in [
            ([1, 0, 0, 1], (64, 48), (10, 24), (54, 24)),
            ([0, 1, -1, 0], (48, 64), (24, 10), (24, 54)),
            ([-1, 0, 0, -1], (64, 48), (54, 24), (10, 24)),
            ([0, -1, 1, 0], (48, 64), (24, 54), (24, 10)),
        ] {
            lying_film(&path, matrix);
            let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
            let mut picture = RgbImage::default();
            assert!(source.read(&mut picture).unwrap());
            assert_eq!((source.size(), picture.dimensions()), (size, size), "{matrix:?}");
            assert!(picture[red][0] > 150 && picture[red][2] < 100, "{matrix:?}: {:?}", picture[red]);
            assert!(picture[blue][2] > 150 && picture[blue][0] < 100, "{matrix:?}: {:?}", picture[blue]);
        }
    }

    #[test]
    fn a_film_that_is_cut_off_is_told_at_the_frame_where_it_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("film.mp4");
        let mut writer = FilmWriter::create(&path, 64, 48, 10.0).unwrap();
        let mut noise = 1_u32;
        for _ in 0..60 {
            let mut grain = RgbImage::new(64, 48);
            for value in grain.iter_mut() {
                noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *value = (noise >> 24) as u8;
            }
            writer.write(&grain).unwrap();
        }
        writer.finish().unwrap();
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
        let said = source.read_all().unwrap_err().to_string();
        assert!((10..50).contains(&source.delivered()), "{}", source.delivered());
        let place =
            format!("frame {}: the file ends here, but its header promises 60", source.delivered() + 1);
        assert!(said.contains("film.mp4") && said.contains(&place), "{said}");
        // Its index lost, nothing of it can be read.
        std::fs::write(&path, &whole[..600]).unwrap();
        let said = FrameSource::open(path.to_str().unwrap()).unwrap_err().to_string();
        assert!(said.contains("film.mp4") && said.contains("cannot be decoded"), "{said}");
    }
}
