//! One camera's part of every moment: decode, foreground, undistort.

use std::path::Path;
use std::time::{Duration, Instant};

use calib::undistort::UndistortMap;
use image::{GrayImage, RgbImage};

use crate::foreground::{Foreground, Verdict};
use crate::moment::CameraFrame;
use crate::source::{CameraSource, Times};
use crate::stage::Stage;
use crate::{Error, Result};

/// A ready-made mask with more foreground than this fraction says nothing.
const MOST_FOREGROUND: f64 = 0.9;

/// Turns one camera's sources into its part of moments, frame by frame.
pub struct CameraFeed {
    name: String,
    source: CameraSource,
    foreground: Option<Foreground>,
    undistort: UndistortMap,
    /// The value from which a ready-made mask is foreground.
    mask_from: u8,
    frame: u32,
    picture: RgbImage,
    mask_picture: RgbImage,
    mask: GrayImage,
}

/// What a feed gives for one frame.
#[derive(Debug)]
pub struct Fed {
    /// The camera's part of the moment.
    pub frame: CameraFrame,
    /// The picture as it was filmed, where that is not the pinhole picture.
    pub real: Option<RgbImage>,
    /// What the mask is worth; it is `None` unless usable.
    pub verdict: Verdict,
    /// Wall time of decoding.
    pub decode: Duration,
    /// Wall time of everything from the picture to the undistorted mask.
    pub foreground: Duration,
}

impl CameraFeed {
    /// A feed of the camera that the source is named after. `foreground` makes the masks where the source has none.
    ///
    /// # Errors
    /// When the stage does not have the camera, or there is neither a mask source nor a foreground.
    pub fn new(source: CameraSource, foreground: Option<Foreground>, stage: &Stage) -> Result<Self> {
        let Some(camera) = stage.camera_index(&source.name).map(|i| &stage.cameras[i]) else {
            return Err(Error::option("room", format!("the stage has no camera `{}`", source.name)));
        };
        if source.masks.is_none() && foreground.is_none() {
            return Err(Error::option(
                "--masks",
                format!("camera `{}` has neither masks nor a foreground model", source.name),
            ));
        }
        let (width, height) = (camera.width(), camera.height());
        Ok(Self {
            name: source.name.clone(),
            mask_from: source.masks.as_ref().map_or(1, |m| if is_exact(m.name()) { 1 } else { 128 }),
            foreground: if source.masks.is_some() { None } else { foreground },
            source,
            undistort: camera.undistort.clone(),
            frame: 0,
            picture: RgbImage::new(width, height),
            mask_picture: RgbImage::default(),
            mask: GrayImage::new(width, height),
        })
    }

    /// The camera's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The next frame, written into `spare`'s pictures where it has any; `None` when a source has ended.
    ///
    /// # Errors
    /// A frame that cannot be decoded, or has no time.
    pub fn next(&mut self, times: &Times, spare: Option<CameraFrame>) -> Result<Option<Fed>> {
        let mut decode = Duration::ZERO;
        if let Some(video) = &mut self.source.video {
            let Some(took) = video.read(&mut self.picture)? else { return Ok(None) };
            decode += took;
        }
        let started = Instant::now();
        if let Some(masks) = &mut self.source.masks
            && !masks.read(&mut self.mask_picture)?
        {
            return Ok(None);
        }
        let decoded = Instant::now();
        self.frame += 1;
        let time_s = times.of(self.frame)?;
        let verdict = match &mut self.foreground {
            Some(foreground) => foreground.mask(&self.picture, time_s, &mut self.mask)?,
            None => self.take_mask(),
        };
        let spare = spare.unwrap_or_default();
        let size = self.picture.dimensions();
        let mut mask =
            spare.mask.filter(|m| m.dimensions() == size).unwrap_or_else(|| GrayImage::new(size.0, size.1));
        let usable = verdict == Verdict::Usable;
        if usable {
            self.undistort.mask(&self.mask, &mut mask);
        }
        let image = self.source.video.is_some().then(|| self.pinhole_picture(spare.image));
        let real = (image.is_some() && !self.undistort.is_identity()).then(|| self.picture.clone());
        Ok(Some(Fed {
            frame: CameraFrame { mask: usable.then_some(mask), image },
            real,
            verdict,
            decode: decode + (decoded - started),
            foreground: decoded.elapsed(),
        }))
    }

    /// The picture in the pinhole image. The buffers change places where nothing has to be moved.
    fn pinhole_picture(&mut self, spare: Option<RgbImage>) -> RgbImage {
        if !self.undistort.is_identity() {
            return self.undistort.image(&self.picture);
        }
        let (width, height) = self.picture.dimensions();
        let spare = spare
            .filter(|i| i.dimensions() == (width, height))
            .unwrap_or_else(|| RgbImage::new(width, height));
        std::mem::replace(&mut self.picture, spare)
    }

    /// The ready-made mask: whatever is not background is foreground.
    fn take_mask(&mut self) -> Verdict {
        let mut foreground = 0;
        for (mask, p) in self.mask.iter_mut().zip(self.mask_picture.as_raw().chunks_exact(3)) {
            let set = p.iter().any(|v| *v >= self.mask_from);
            *mask = if set { 255 } else { 0 };
            foreground += usize::from(set);
        }
        if foreground as f64 > MOST_FOREGROUND * self.mask.len() as f64 {
            return Verdict::AllForeground;
        }
        Verdict::Usable
    }
}

/// Whether masks of this source hold exactly what was written: PNG does, video and JPEG smear.
fn is_exact(spec: &str) -> bool {
    let is_png = |p: &Path| p.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    let path = Path::new(spec);
    match std::fs::read_dir(path) {
        Ok(entries) => entries.filter_map(std::result::Result::ok).any(|e| is_png(&e.path())),
        Err(_) => is_png(path),
    }
}

/// Frames a second of a source list, and whether the sources disagree about it.
pub fn common_rate(sources: &[CameraSource]) -> (Option<f64>, bool) {
    let mut rates = sources.iter().filter_map(CameraSource::rate);
    let first = rates.next();
    let differ = first.is_some_and(|first| rates.any(|rate| (rate / first - 1.0).abs() > 0.01));
    (first, differ)
}

/// Frames that every source promises; `None` when one cannot know.
pub fn promised_frames(sources: &[CameraSource]) -> Option<usize> {
    let counts: Option<Vec<usize>> = sources
        .iter()
        .map(|s| {
            let all = s.sources().all(|f| f.frame_count().is_some());
            if all { s.frame_count() } else { None }
        })
        .collect();
    counts?.into_iter().min()
}
