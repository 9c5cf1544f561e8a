//! A capture: the frames that one camera filmed on its way to its final pose, and its reference image.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use calib::Intrinsics;
use calib::video::FrameSource;
use image::RgbImage;
use serde::Serialize;

use crate::memory::{self, MemoryBound};
use crate::working_size::WorkingSize;
use crate::{Error, Result};

/// Least number of frames from which motion can be estimated.
const MIN_FRAMES: usize = 3;

/// Largest number of frames that are used. Longer films are sampled evenly: time and memory grow with the frames, while
/// the view of the room changes little from one to the next.
const MOST_FRAMES: usize = 120;

/// Horizontal fields of view from which the estimation of an unknown lens starts, degrees: the likeliest first. On generated
/// films of 25 to 118°, straight and bent, the first one alone finds the same lens: no film is known that needs the others.
pub const ASSUMED_FOV_DEG: [f64; 4] = [60.0, 42.0, 82.0, 106.0];

/// Choice of the frame at the installed pose.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum ReferenceFrame {
    /// The first frame.
    First,
    /// The last frame.
    #[default]
    Last,
    /// The frame with this number, counted from 1.
    Number(usize),
    /// The image with this file name, in a capture that is a folder of images.
    File(String),
}

impl FromStr for ReferenceFrame {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "first" => Ok(Self::First),
            "last" => Ok(Self::Last),
            _ => match text.parse() {
                Ok(number) if number >= 1 => Ok(Self::Number(number)),
                Err(_) if names_an_image(text) => Ok(Self::File(text.into())),
                _ => Err(Error::Room(format!(
                    "reference `{text}` is none of \"first\", \"last\", a frame counted from 1 or the file name of an image"
                ))),
            },
        }
    }
}

/// Whether a text is the file name of an image that a capture may hold.
fn names_an_image(text: &str) -> bool {
    let extension = Path::new(text).extension();
    extension.is_some_and(|own| ["jpg", "jpeg", "png"].iter().any(|known| own.eq_ignore_ascii_case(known)))
}

/// A capture on disk, checked but not read into memory: films of many cameras need not be held at once.
#[derive(Debug, Clone)]
pub struct CaptureFile {
    name: String,
    path: PathBuf,
    size: WorkingSize,
    /// Largest number of frames that are used.
    most_frames: usize,
    /// Number of frames filmed.
    count: usize,
    /// Index of the frame at the installed pose.
    reference: usize,
    intrinsics: Option<Intrinsics>,
    exif_focal_px: Option<f64>,
}

impl CaptureFile {
    /// Checks a folder of images (in name order) or a video file by decoding every frame.
    ///
    /// # Errors
    /// A file that cannot be opened, a frame that cannot be decoded, too few frames, a reference frame that does not
    /// exist, or frames whose size is not that of the intrinsics; each names the file.
    pub fn open(
        name: &str,
        path: &Path,
        reference: ReferenceFrame,
        intrinsics: Option<Intrinsics>,
    ) -> Result<Self> {
        let mut film = opened(path)?;
        let exif_focal_px = if intrinsics.is_none() { exif_focal_px(name, &film) } else { None };
        let size = film.size();
        // Every frame is decoded: a defect of the last of many captures should be reported before work on the first
        // begins.
        let (mut count, mut named) = (0, None);
        while film.advance_alike()? {
            if count == 0 {
                // Frames of one size and kind become pictures alike: one of them shows whether they can.
                film.picture(&mut RgbImage::new(1, 1))?;
            }
            if let ReferenceFrame::File(file) = &reference
                && film.image_path().and_then(Path::file_name).is_some_and(|name| name == file.as_str())
            {
                named = Some(count);
            }
            count += 1;
        }
        if count < MIN_FRAMES {
            let problem = format!("holds {count} frames, at least {MIN_FRAMES} are needed to see motion");
            return Err(Error::content(path, "whole capture", problem));
        }
        let reference = match reference {
            ReferenceFrame::First => 0,
            ReferenceFrame::Last => count - 1,
            ReferenceFrame::File(file) => named.ok_or_else(|| {
                let problem = format!(
                    "no image of the capture is called `{file}`; a film's frames have numbers, from 1"
                );
                Error::content(path, "reference", problem)
            })?,
            ReferenceFrame::Number(number) if (1..=count).contains(&number) => number - 1,
            ReferenceFrame::Number(number) => {
                let problem =
                    format!("the reference is frame {number}, but there are {count} (counted from 1)");
                return Err(Error::content(path, "reference", problem));
            }
        };
        if let Some(camera) = &intrinsics
            && (camera.width, camera.height) != size
        {
            let problem = format!(
                "frames are {} × {}, the intrinsics of camera `{name}` are for {} × {}; calibrate at the capture's size",
                size.0, size.1, camera.width, camera.height
            );
            return Err(Error::content(path, "frame 1", problem));
        }
        let (name, path) = (name.to_owned(), path.to_owned());
        let size = WorkingSize::of(size);
        Ok(Self { name, path, size, most_frames: MOST_FRAMES, count, reference, intrinsics, exif_focal_px })
    }

    /// Name of the camera.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Width and height of the frames as filmed, and as they are worked on.
    pub fn size(&self) -> WorkingSize {
        self.size
    }

    /// The same capture, of which no more frames are used than a bound on memory leaves.
    #[must_use]
    pub fn within(self, bound: MemoryBound) -> Self {
        Self { most_frames: bound.frames(self.size, MOST_FRAMES), ..self }
    }

    /// The same capture, worked on with a longest side of no more than this many pixels.
    #[must_use]
    pub fn worked_up_to(self, longest_px: u32) -> Self {
        Self { size: WorkingSize::up_to(self.size.filmed, longest_px), ..self }
    }

    /// Bytes that it takes while it is worked on.
    pub fn memory(&self) -> u64 {
        memory::need(self.size, self.count.div_ceil(self.stride()))
    }

    /// Number of frames filmed.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Step between the frames that are used, counted from the reference frame: a film of half a minute is sampled.
    pub fn stride(&self) -> usize {
        self.count.div_ceil(self.most_frames)
    }

    /// Reads the frames that are used, at the size at which they are worked on.
    ///
    /// # Errors
    /// A frame that cannot be decoded, or a file that ends before its header says; each names the file.
    pub fn read(&self) -> Result<Capture> {
        let (stride, first) = (self.stride(), self.first());
        let reference = (self.reference - first) / stride;
        let mut frames = Vec::with_capacity(self.count / stride + 1);
        let mut filmed = None;
        self.each_picture(&mut |film| {
            if frames.len() == reference && !self.size.is_same() {
                filmed = Some(picture_of(film, self.size.filmed)?);
            }
            frames.push(picture_of(film, self.size.worked)?);
            Ok(())
        })?;
        if frames.len() <= reference {
            return Err(self.changed());
        }
        Ok(Capture {
            name: self.name.clone(),
            frames,
            sampled: Sampled { first, stride },
            reference,
            intrinsics: self.intrinsics.as_ref().map(|filmed| self.size.worked_lens(filmed)),
            exif_focal_px: self.exif_focal_px.map(|filmed| filmed / self.size.enlargement()),
            larger: filmed.map(|reference| LargerPictures { file: self.clone(), reference }),
        })
    }

    /// Index in the film of the first frame that is used.
    fn first(&self) -> usize {
        self.reference % self.stride()
    }

    fn changed(&self) -> Error {
        let problem = format!("it has changed since it was looked through ({} frames then)", self.count);
        Error::content(&self.path, "whole capture", problem)
    }

    /// Calls `take` with each frame that is used, at a size that is at most the filmed one.
    ///
    /// # Errors
    /// As [`Self::read`]; the errors of `take`.
    pub fn each_frame(&self, size: (u32, u32), take: &mut dyn FnMut(RgbImage) -> Result<()>) -> Result<()> {
        self.each_picture(&mut |film| take(picture_of(film, size)?))
    }

    /// Calls `take` with the film at each frame that is used.
    fn each_picture(&self, take: &mut dyn FnMut(&mut FrameSource) -> Result<()>) -> Result<()> {
        let mut film = opened(&self.path)?;
        let stride = self.stride();
        for _ in 0..self.first() {
            film.skip();
        }
        while film.advance()? {
            if film.frame_size() != self.size.filmed {
                return Err(self.changed());
            }
            take(&mut film)?;
            for _ in 1..stride {
                film.skip();
            }
        }
        Ok(())
    }

    /// The reference picture as filmed.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn reference_picture(&self) -> Result<RgbImage> {
        let mut film = opened(&self.path)?;
        for _ in 0..self.reference {
            film.skip();
        }
        if film.advance_alike()? { picture_of(&mut film, self.size.filmed) } else { Err(self.changed()) }
    }
}

/// A film's present frame, at a size that is at most its own.
fn picture_of(film: &mut FrameSource, (width, height): (u32, u32)) -> Result<RgbImage> {
    let mut picture = RgbImage::new(width, height);
    film.picture(&mut picture)?;
    Ok(picture)
}

/// A capture whose pictures are worked on at a smaller size than they were filmed.
#[derive(Debug, Clone)]
pub struct LargerPictures {
    /// The capture on disk.
    pub file: CaptureFile,
    /// The reference picture as filmed.
    pub reference: RgbImage,
}

/// Mapping from the frames of a capture to the frames of its film.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Sampled {
    /// Index (from 0) in the film of the first frame.
    pub first: usize,
    /// Step from each frame to the next.
    pub stride: usize,
}

impl Sampled {
    /// All frames of the film.
    pub const ALL: Self = Self { first: 0, stride: 1 };

    /// Number in the film, counted from 1, of a capture's frame, counted from 0.
    pub fn number(self, frame: usize) -> usize {
        self.first + frame * self.stride + 1
    }
}

/// The frames of one camera, all of one size, at even intervals of time.
#[derive(Debug, Clone)]
pub struct Capture {
    /// The camera's name in `room.toml`.
    pub name: String,
    /// Frames in order of time.
    pub frames: Vec<RgbImage>,
    /// Position of these frames in the film.
    pub sampled: Sampled,
    /// Index (from 0) in `frames` of the frame at the installed pose.
    pub reference: usize,
    /// Calibrated intrinsics; `None` estimates the focal length from the motion.
    pub intrinsics: Option<Intrinsics>,
    /// Focal length that photographs state in EXIF where intrinsics are not given, pixels: the start of its estimation.
    pub exif_focal_px: Option<f64>,
    /// The pictures as filmed, where these are larger than `frames`: features are registered in them once more.
    pub larger: Option<LargerPictures>,
}

impl Capture {
    /// The reference picture as filmed.
    pub fn reference_picture(&self) -> &RgbImage {
        self.larger.as_ref().map_or_else(|| &self.frames[self.reference], |larger| &larger.reference)
    }

    /// Opens and reads a capture, see [`CaptureFile`].
    ///
    /// # Errors
    /// As [`CaptureFile::open`] and [`CaptureFile::read`].
    pub fn load(
        name: &str,
        source: &Path,
        reference: ReferenceFrame,
        intrinsics: Option<Intrinsics>,
    ) -> Result<Self> {
        CaptureFile::open(name, source, reference, intrinsics)?.read()
    }

    /// Lenses from which motion estimation starts, the likeliest first: the calibrated one, or one with the focal length that
    /// photographs state, or those of [`ASSUMED_FOV_DEG`].
    pub fn start_lenses(&self, (width, height): (u32, u32)) -> Vec<Intrinsics> {
        if let Some(given) = &self.intrinsics {
            return vec![given.clone()];
        }
        let assumed = ASSUMED_FOV_DEG.map(|deg| Intrinsics::from_horizontal_fov(width, height, deg));
        match self.exif_focal_px {
            Some(focal) => vec![Intrinsics { fx: focal, fy: focal, ..assumed[0].clone() }],
            None => assumed.to_vec(),
        }
    }
}

fn opened(path: &Path) -> Result<FrameSource> {
    let spec = path.to_str().ok_or_else(|| {
        Error::content(path, "file name", "is not valid UTF-8; rename the capture's file or folder")
    })?;
    Ok(FrameSource::open(spec)?)
}

/// Focal length in the first photograph's EXIF block, pixels; an unreadable block is only worth a warning.
fn exif_focal_px(camera: &str, film: &FrameSource) -> Option<f64> {
    let photograph = film.first_image()?;
    let (width, height) = film.size();
    calib::photograph::focal_px(photograph, [width, height]).unwrap_or_else(|error| {
        tracing::warn!("camera `{camera}`: {error}; its focal length is estimated without");
        None
    })
}

#[cfg(test)]
mod tests;
