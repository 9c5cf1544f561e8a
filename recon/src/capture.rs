//! A capture: the frames one camera filmed on its way to its final pose, and which of them is the reference image.

use std::path::Path;
use std::str::FromStr;

use calib::Intrinsics;
use calib::video::FrameSource;
use image::RgbImage;

use crate::project::ProjectCamera;
use crate::{Error, Result};

/// Fewer frames than this hold no motion worth the name.
const MIN_FRAMES: usize = 3;

/// Which frame was taken at the installed pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReferenceFrame {
    /// The first.
    First,
    /// The last.
    #[default]
    Last,
    /// This one, counted from 1.
    Number(usize),
}

impl FromStr for ReferenceFrame {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "first" => Ok(Self::First),
            "last" => Ok(Self::Last),
            _ => match text.parse() {
                Ok(number) if number >= 1 => Ok(Self::Number(number)),
                _ => Err(Error::Room(format!(
                    "reference `{text}` is none of \"first\", \"last\" or a frame counted from 1"
                ))),
            },
        }
    }
}

/// The frames of one camera, all of one size.
#[derive(Debug, Clone)]
pub struct Capture {
    /// The camera's name in `room.toml`.
    pub name: String,
    /// In order of time.
    pub frames: Vec<RgbImage>,
    /// Index (from 0) of the frame at the installed pose.
    pub reference: usize,
    /// Calibrated intrinsics; `None` estimates the focal length from the motion.
    pub intrinsics: Option<Intrinsics>,
}

impl Capture {
    /// Loads a folder of images (in name order) or a video file.
    ///
    /// # Errors
    /// A file that cannot be read or decoded, too few frames, a reference frame that does not exist, or frames whose
    /// size is not that of the intrinsics; each names the file.
    pub fn load(
        name: &str,
        source: &Path,
        reference: ReferenceFrame,
        intrinsics: Option<Intrinsics>,
    ) -> Result<Self> {
        let spec = source.to_str().ok_or_else(|| {
            Error::content(source, "file name", "is not valid UTF-8; rename the capture's file or folder")
        })?;
        let frames = FrameSource::open(spec)?.read_all()?;
        let count = frames.len();
        if count < MIN_FRAMES {
            let problem = format!("holds {count} frames, at least {MIN_FRAMES} are needed to see motion");
            return Err(Error::content(source, "whole capture", problem));
        }
        let reference = match reference {
            ReferenceFrame::First => 0,
            ReferenceFrame::Last => count - 1,
            ReferenceFrame::Number(number) if (1..=count).contains(&number) => number - 1,
            ReferenceFrame::Number(number) => {
                let problem =
                    format!("the reference is frame {number}, but there are {count} (counted from 1)");
                return Err(Error::content(source, "reference", problem));
            }
        };
        if let Some(camera) = &intrinsics {
            let (width, height) = frames[0].dimensions();
            if (camera.width, camera.height) != (width, height) {
                let problem = format!(
                    "frames are {width} × {height}, the intrinsics of camera `{name}` are for {} × {}; \
                     calibrate at the capture's size",
                    camera.width, camera.height
                );
                return Err(Error::content(source, "frame 1", problem));
            }
        }
        Ok(Self { name: name.to_owned(), frames, reference, intrinsics })
    }

    /// Loads the captures of all cameras of a project; `step` is told of each.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_all(cameras: &[ProjectCamera], step: &mut dyn FnMut(String)) -> Result<Vec<Self>> {
        let load = |camera: &ProjectCamera| {
            step(format!("{}: reading the capture", camera.name));
            Self::load(&camera.name, &camera.capture, camera.reference, camera.intrinsics.clone())
        };
        cameras.iter().map(load).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_reference_and_size_are_checked() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path();
        let load = |reference, intrinsics| Capture::load("cam", path, reference, intrinsics);
        for index in 0..2 {
            RgbImage::new(32, 24).save(path.join(format!("{index}.png"))).unwrap();
        }
        assert!(load(ReferenceFrame::Last, None).unwrap_err().to_string().contains("2 frames"));
        for index in 2..5 {
            RgbImage::new(32, 24).save(path.join(format!("{index}.png"))).unwrap();
        }
        for (reference, index) in
            [(ReferenceFrame::First, 0), (ReferenceFrame::Last, 4), (ReferenceFrame::Number(3), 2)]
        {
            let capture = load(reference, None).unwrap();
            assert_eq!((capture.reference, capture.frames.len()), (index, 5));
        }
        let beyond = load(ReferenceFrame::Number(6), None).unwrap_err().to_string();
        assert!(beyond.contains("frame 6") && beyond.contains(path.to_str().unwrap()), "{beyond}");
        let other = load(ReferenceFrame::Last, Some(Intrinsics::from_horizontal_fov(64, 48, 60.0)));
        assert!(other.unwrap_err().to_string().contains("64 × 48"));
        let missing = Capture::load("cam", &path.join("gone"), ReferenceFrame::Last, None).unwrap_err();
        assert!(missing.to_string().contains("gone"));
    }

    #[test]
    fn reference_words() {
        assert_eq!("first".parse::<ReferenceFrame>().unwrap(), ReferenceFrame::First);
        assert_eq!("last".parse::<ReferenceFrame>().unwrap(), ReferenceFrame::Last);
        assert_eq!("12".parse::<ReferenceFrame>().unwrap(), ReferenceFrame::Number(12));
        for bad in ["0", "-1", "middle", "", "1.5"] {
            assert!(bad.parse::<ReferenceFrame>().is_err(), "{bad}");
        }
    }
}
