//! Sources of pictures: named videos and masks, matched with the room's cameras, and the time of each frame.

mod arrival;
mod box_stream;
mod capture_times;
mod detector_boxes;
mod detector_rows;
pub mod sampling;
pub mod times;

use std::path::Path;
use std::str::FromStr;

use calib::video::FrameSource;
use image::RgbImage;
use scenes::room::{Room, RoomCamera};

pub use arrival::{ArrivalClock, utc_s};
pub use box_stream::{ArrivedFrame, BoxStream, FrameAssembler, next_line};
pub use capture_times::CaptureTimes;
pub use detector_boxes::DetectorBoxes;
pub use detector_rows::{DetectedBox, DetectedFrame};
pub use times::Times;

use crate::{Error, Result};

/// A named source, `NAME=PATH` on the command line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedSource {
    /// The camera's name in the room.
    pub name: String,
    /// A file, a folder of images, a printf pattern, a URL or a device number.
    pub spec: String,
}

impl FromStr for NamedSource {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.split_once('=') {
            Some((name, spec)) if !name.is_empty() && !spec.is_empty() => {
                Ok(Self { name: name.to_owned(), spec: spec.to_owned() })
            }
            _ => Err(format!("`{text}` is not NAME=PATH, with a camera's name before the `=`")),
        }
    }
}

/// Input of one camera: a video, masks, a detector's boxes, or several of these.
#[derive(Debug)]
pub struct CameraSource {
    /// The camera's name in the room.
    pub name: String,
    /// Its pictures; `None` with masks alone.
    pub video: Option<VideoSource>,
    /// Ready-made masks, which replace background subtraction.
    pub masks: Option<FrameSource>,
    /// A detector's boxes of people.
    pub detections: Option<Detections>,
}

/// The sources of a run as they were named, each of them for one camera.
#[derive(Debug, Clone, Copy, Default)]
pub struct NamedSources<'a> {
    /// Videos.
    pub videos: &'a [NamedSource],
    /// Ready-made masks.
    pub masks: &'a [NamedSource],
    /// Files or pipes of detections.
    pub detections: &'a [NamedSource],
    /// Whether the frames' capture times are given. Then a pipe of detections is read to its end, as a file.
    pub are_timed: bool,
}

/// Boxes of one camera.
#[derive(Debug)]
pub enum Detections {
    /// All frames of a recording.
    Recorded(DetectorBoxes),
    /// A detector that writes while it sees.
    Live(BoxStream),
}

impl Detections {
    /// Opens a file, or a pipe.
    fn open(source: &NamedSource, is_timed: bool) -> Result<Self> {
        match BoxStream::of(&source.spec).filter(|_| !is_timed) {
            Some(stream) => Ok(Self::Live(stream)),
            None => DetectorBoxes::read(Path::new(BoxStream::path(&source.spec))).map(Self::Recorded),
        }
    }

    /// Boxes of a recording.
    pub fn recorded(&self) -> Option<&DetectorBoxes> {
        match self {
            Self::Recorded(boxes) => Some(boxes),
            Self::Live(_) => None,
        }
    }
}

/// Pictures of one camera.
#[derive(Debug)]
pub enum VideoSource {
    /// A recording: every frame is used.
    Recorded(FrameSource),
    /// A stream or a device: the newest frame is used.
    Live(LiveSource),
}

/// A stream or a device, which may be out of reach.
#[derive(Debug)]
pub struct LiveSource {
    /// URL or device number as the user gave it.
    pub spec: String,
    /// The stream, when it could be opened.
    pub opened: Option<FrameSource>,
    /// Whether the log already reports why it could not be opened.
    pub has_warned: bool,
}

/// Whether a source may be live: a URL or a device number.
fn may_be_live(spec: &str) -> bool {
    spec.contains("://") || spec.parse::<usize>().is_ok()
}

/// Opens the sources and matches them with the room's cameras, in the room's order. Cameras without a source are left
/// out.
///
/// # Errors
/// A name the room does not have (all of its names are listed), a name given twice, no source at all, a source that
/// cannot be opened, or one whose images do not have the camera's size.
pub fn open(room: &Room, named: NamedSources<'_>) -> Result<Vec<CameraSource>> {
    let NamedSources { videos, masks, detections, are_timed } = named;
    for (option, named) in [("videos", videos), ("masks", masks), ("detections", detections)] {
        for (i, source) in named.iter().enumerate() {
            room.camera(&source.name)
                .map_err(|e| Error::option(format!("{option} {}", written(source)), e.to_string()))?;
            if option == "detections"
                && BoxStream::of(&source.spec).is_some()
                && named[..i].iter().any(|earlier| earlier.spec == source.spec)
            {
                return Err(Error::option(
                    format!("{option} {}", written(source)),
                    "is the pipe of another camera, too; give each camera its own",
                ));
            }
            if named[..i].iter().any(|earlier| earlier.name == source.name) {
                return Err(Error::option(
                    format!("{option} {}", written(source)),
                    format!("camera `{}` already has one; give each camera once", source.name),
                ));
            }
        }
    }
    let mut sources = Vec::new();
    let mut failure = None;
    for camera in &room.cameras {
        let find = |named: &[NamedSource]| named.iter().find(|s| s.name == camera.name).cloned();
        let video = match find(videos) {
            Some(source) if may_be_live(&source.spec) => Some(open_live(&source, camera, &mut failure)?),
            Some(source) => Some(VideoSource::Recorded(open_one(camera, &source)?)),
            None => None,
        };
        let masks = find(masks).map(|source| open_one(camera, &source)).transpose()?;
        let detections = find(detections).map(|source| Detections::open(&source, are_timed)).transpose()?;
        if video.is_some() || masks.is_some() || detections.is_some() {
            sources.push(CameraSource { name: camera.name.clone(), video, masks, detections });
        }
    }
    // A live camera that is out of reach does not stop a run with other cameras; when no camera has a source, the
    // failure is the error.
    let is_there = |source: &CameraSource| match &source.video {
        Some(VideoSource::Live(live)) => live.opened.is_some(),
        _ => true,
    };
    if let Some(failure) = failure.take_if(|_| !sources.iter().any(is_there)) {
        return Err(failure);
    }
    if sources.is_empty() {
        let names: Vec<&str> = room.cameras.iter().map(|c| c.name.as_str()).collect();
        return Err(Error::option(
            "videos",
            format!(
                "no source is given; give a video, masks or detections, as NAME=PATH, for {}",
                names.join(", ")
            ),
        ));
    }
    // A detector may find nobody in one camera while others show people.
    let detected = || sources.iter().filter_map(CameraSource::recorded_boxes);
    check_vector_lengths(detected().filter(|boxes| boxes.frame_count() > 0))?;
    let frames = detected().map(DetectorBoxes::frame_count).max().unwrap_or(0);
    let has_files_alone = |source: &CameraSource| {
        source.video.is_none() && source.masks.is_none() && source.recorded_boxes().is_some()
    };
    if frames == 0 && sources.iter().all(has_files_alone) {
        let paths: Vec<String> = detected().map(|boxes| boxes.path().display().to_string()).collect();
        return Err(Error::option(
            "detections",
            format!(
                "no box in {}, so the run has no frames; give boxes, or a video or masks besides",
                paths.join(", ")
            ),
        ));
    }
    for source in &mut sources {
        if let Some(Detections::Recorded(boxes)) = &mut source.detections {
            boxes.extend_to(frames);
        }
    }
    Ok(sources)
}

/// Refuses appearance vectors of different lengths: they are of different networks and cannot be compared.
fn check_vector_lengths<'a>(mut detected: impl Iterator<Item = &'a DetectorBoxes>) -> Result<()> {
    let Some(first) = detected.next() else { return Ok(()) };
    match detected.find(|boxes| boxes.vector_length() != first.vector_length()) {
        Some(other) => Err(Error::option(
            "detections",
            format!(
                "{} has {} appearance values after the tenth column, {} has {}; give all cameras the same network's",
                first.path().display(),
                first.vector_length(),
                other.path().display(),
                other.vector_length()
            ),
        )),
        None => Ok(()),
    }
}

fn written(source: &NamedSource) -> String {
    format!("{}={}", source.name, source.spec)
}

fn open_one(camera: &RoomCamera, source: &NamedSource) -> Result<FrameSource> {
    of_size(FrameSource::open(&source.spec)?, camera, source)
}

/// The recording, checked to have the size of its camera.
fn of_size(opened: FrameSource, camera: &RoomCamera, source: &NamedSource) -> Result<FrameSource> {
    let (width, height) = opened.size();
    let intrinsics = &camera.camera.intrinsics;
    if (width, height) != (intrinsics.width, intrinsics.height) {
        return Err(Error::content(
            Path::new(&source.spec),
            "frame 1",
            format!(
                "is {width} × {height} pixels, but the room's camera `{}` has {} × {}; give the recording the room was \
                 calibrated for",
                camera.name, intrinsics.width, intrinsics.height
            ),
        ));
    }
    Ok(opened)
}

/// Opens a stream or device. A failure is logged, and stored in `failure` if it is the first.
fn open_live(source: &NamedSource, camera: &RoomCamera, failure: &mut Option<Error>) -> Result<VideoSource> {
    let spec = source.spec.clone();
    match FrameSource::open(&spec) {
        Ok(opened) if opened.is_live() => {
            Ok(VideoSource::Live(LiveSource { spec, opened: Some(opened), has_warned: false }))
        }
        Ok(opened) => of_size(opened, camera, source).map(VideoSource::Recorded),
        Err(error) => {
            tracing::warn!("camera `{}`: {error}; it is tried again, once a second", camera.name);
            failure.get_or_insert(error.into());
            Ok(VideoSource::Live(LiveSource { spec, opened: None, has_warned: true }))
        }
    }
}

impl CameraSource {
    /// First picture of a recording, read beside the run; `None` for a stream, and where it cannot be read, which the run
    /// reports.
    pub fn first_picture(&self) -> Option<RgbImage> {
        let Some(VideoSource::Recorded(video)) = self.video.as_ref() else { return None };
        let mut again = FrameSource::open(video.name()).ok().filter(|_| video.is_recording())?;
        let mut picture = RgbImage::default();
        again.read(&mut picture).ok()?.then_some(picture)
    }

    /// Number of frames, the lesser of video and masks; `None` for a live source, or where the number is unknown.
    pub fn frame_count(&self) -> Option<usize> {
        if self.is_live() {
            return None;
        }
        let counts: Option<Vec<usize>> = self.sources().map(FrameSource::frame_count).collect();
        let alone = self.recorded_boxes().filter(|_| self.sources().next().is_none());
        counts?.into_iter().chain(alone.map(|detections| detections.frame_count() as usize)).min()
    }

    /// Frames a second, if a source states them.
    pub fn rate(&self) -> Option<f64> {
        self.sources().find_map(FrameSource::rate)
    }

    /// Whether the source is live.
    pub fn is_live(&self) -> bool {
        matches!(self.video, Some(VideoSource::Live(_)))
            || matches!(self.detections, Some(Detections::Live(_)))
    }

    /// Boxes of a recording.
    pub fn recorded_boxes(&self) -> Option<&DetectorBoxes> {
        self.detections.as_ref().and_then(Detections::recorded)
    }

    /// Whether a detector's boxes are all that there is.
    pub fn has_boxes_alone(&self) -> bool {
        self.detections.is_some() && self.video.is_none() && self.masks.is_none()
    }

    /// The video and the masks, those that are open.
    pub fn sources(&self) -> impl Iterator<Item = &FrameSource> {
        let video = match &self.video {
            Some(VideoSource::Recorded(source)) => Some(source),
            Some(VideoSource::Live(live)) => live.opened.as_ref(),
            None => None,
        };
        video.into_iter().chain(&self.masks)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::{Camera, Intrinsics};
    use image::RgbImage;

    fn room(names: &[&str]) -> Room {
        let camera = Camera {
            intrinsics: Intrinsics::from_horizontal_fov(32, 24, 60.0),
            camera_from_world: nalgebra::Isometry3::identity(),
        };
        let cameras = names
            .iter()
            .map(|name| RoomCamera { name: (*name).to_owned(), camera: camera.clone(), reference: None })
            .collect();
        Room { cameras, ..Room::default() }
    }

    fn folder(width: u32) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        RgbImage::new(width, 24).save(folder.path().join("1.png")).unwrap();
        folder
    }

    fn named(name: &str, folder: &tempfile::TempDir) -> NamedSource {
        format!("{name}={}", folder.path().display()).parse().unwrap()
    }

    fn of<'a>(videos: &'a [NamedSource], masks: &'a [NamedSource]) -> NamedSources<'a> {
        NamedSources { videos, masks, ..NamedSources::default() }
    }

    #[test]
    fn names_split_at_the_first_equals_sign() {
        let source: NamedSource = "a=rtsp://host/x?y=1".parse().unwrap();
        assert_eq!((source.name.as_str(), source.spec.as_str()), ("a", "rtsp://host/x?y=1"));
        for bad in ["a", "=path", "a=", ""] {
            assert!(bad.parse::<NamedSource>().unwrap_err().contains("NAME=PATH"));
        }
    }

    #[test]
    fn sources_come_in_the_rooms_order_and_cameras_without_one_are_left_out() {
        let (room, images) = (room(&["a", "b", "c"]), folder(32));
        let sources =
            open(&room, of(&[named("c", &images), named("a", &images)], &[named("a", &images)])).unwrap();
        let names: Vec<&str> = sources.iter().map(|s| s.name.as_str()).collect();
        assert_eq!(names, ["a", "c"]);
        assert!(sources[0].masks.is_some() && sources[1].masks.is_none());
        assert_eq!(sources[0].frame_count(), Some(1));
    }

    #[test]
    fn wrong_names_sizes_and_repeats_are_named() {
        let (room, images, wide) = (room(&["a", "b"]), folder(32), folder(40));
        let said = |videos: &[NamedSource]| open(&room, of(videos, &[])).unwrap_err().to_string();
        let unknown = said(&[named("x", &images)]);
        assert!(unknown.contains("`x`") && unknown.contains("`a`, `b`"), "{unknown}");
        assert!(said(&[named("a", &images), named("a", &images)]).contains("already"));
        let size = said(&[named("a", &wide)]);
        assert!(size.contains("40 × 24") && size.contains("32 × 24"), "{size}");
        assert!(said(&[]).contains("NAME=PATH"));
    }
}
