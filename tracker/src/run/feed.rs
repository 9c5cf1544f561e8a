//! One camera's part of every moment: decode, foreground, undistort.

use std::path::Path;
use std::time::{Duration, Instant};

use calib::undistort::UndistortMap;
use calib::video::FrameSource;
use image::{GrayImage, RgbImage};

use crate::foreground::health::{self, Health};
use crate::foreground::{Foreground, Verdict};
use crate::moment::CameraFrame;
use crate::source::{self, CameraSource, Footage, Schedule};
use crate::stage::Stage;
use crate::{Error, Result};

/// A ready-made mask with more foreground than this fraction says nothing.
const MOST_FOREGROUND: f64 = 0.9;

/// Turns one camera's sources into its part of moments, frame by frame.
pub struct CameraFeed {
    name: String,
    source: CameraSource,
    foreground: Option<Foreground>,
    /// Of a feed of pictures alone, without masks.
    health: Option<Health>,
    undistort: UndistortMap,
    /// The value from which a ready-made mask is foreground.
    mask_from: u8,
    /// The latest frame of the sources that was taken or passed over.
    frame: u32,
    /// The latest moment.
    moment: Option<u32>,
    /// The latest part, where the next moment has the same frame.
    shown: Option<Fed>,
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

impl Fed {
    /// Of a camera that has no frame.
    fn nothing(verdict: Verdict) -> Self {
        Self {
            frame: CameraFrame::default(),
            real: None,
            verdict,
            decode: Duration::ZERO,
            foreground: Duration::ZERO,
        }
    }

    /// The same once more, which takes no time.
    fn again(&self) -> Self {
        Self {
            frame: self.frame.clone(),
            real: self.real.clone(),
            verdict: self.verdict,
            decode: Duration::ZERO,
            foreground: Duration::ZERO,
        }
    }
}

impl CameraFeed {
    /// A feed of the camera that the source is named after. `foreground` makes the masks where the source has none.
    ///
    /// # Errors
    /// When the stage does not have the camera, or there is neither a mask source nor a foreground.
    pub fn new(source: CameraSource, foreground: Option<Foreground>, stage: &Stage) -> Result<Self> {
        if source.masks.is_none() && foreground.is_none() {
            return Err(Error::option(
                "--masks",
                format!("camera `{}` has neither masks nor a foreground model", source.name),
            ));
        }
        Self::start(source, foreground, None, stage)
    }

    /// A feed of pictures alone, for methods that need no masks. Pictures of a camera that is frozen or dark are left out.
    ///
    /// # Errors
    /// When the stage does not have the camera, or the source has no video.
    pub fn pictures(source: CameraSource, stage: &Stage) -> Result<Self> {
        if source.video.is_none() {
            let problem = format!("camera `{0}` has masks alone; give --video {0}=PATH", source.name);
            return Err(Error::option("--video", problem));
        }
        Self::start(CameraSource { masks: None, ..source }, None, Some(Health::default()), stage)
    }

    fn start(
        source: CameraSource,
        foreground: Option<Foreground>,
        health: Option<Health>,
        stage: &Stage,
    ) -> Result<Self> {
        let Some(camera) = stage.camera_index(&source.name).map(|i| &stage.cameras[i]) else {
            return Err(Error::option("room", format!("the stage has no camera `{}`", source.name)));
        };
        let (width, height) = (camera.width(), camera.height());
        Ok(Self {
            name: source.name.clone(),
            mask_from: source.masks.as_ref().map_or(1, |m| if is_exact(m.name()) { 1 } else { 128 }),
            foreground: if source.masks.is_some() { None } else { foreground },
            source,
            health,
            undistort: camera.undistort.clone(),
            frame: 0,
            moment: None,
            shown: None,
            picture: RgbImage::new(width, height),
            mask_picture: RgbImage::default(),
            mask: GrayImage::new(width, height),
        })
    }

    /// The camera's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The camera's part of the next moment, written into `spare`'s pictures where it has any; `None` when a source has
    /// ended. `camera` is its number in the schedule.
    ///
    /// # Errors
    /// A frame that cannot be decoded, or has no time.
    pub fn next(
        &mut self,
        schedule: &Schedule,
        camera: usize,
        spare: Option<CameraFrame>,
    ) -> Result<Option<Fed>> {
        let moment = self.moment.map_or(schedule.first(), |latest| latest + 1);
        self.moment = Some(moment);
        let Some(frame) = schedule.frame(camera, moment)? else {
            return Ok(Some(Fed::nothing(Verdict::Between)));
        };
        if let Some(shown) = self.shown.take_if(|_| frame == self.frame) {
            if self.is_shown_again(schedule, camera) {
                self.shown = Some(shown.again());
            }
            return Ok(Some(shown));
        }
        let started = Instant::now();
        while self.frame + 1 < frame {
            if !self.skip() {
                return Ok(None);
            }
        }
        let skipped = started.elapsed();
        let Some(mut fed) = self.take(schedule, camera, spare)? else { return Ok(None) };
        fed.decode += skipped;
        if self.is_shown_again(schedule, camera) {
            self.shown = Some(fed.again());
        }
        Ok(Some(fed))
    }

    /// Whether the frame that was shown last belongs to the next moment as well.
    fn is_shown_again(&self, schedule: &Schedule, camera: usize) -> bool {
        let next = self.moment.map(|moment| schedule.frame(camera, moment + 1));
        matches!(next, Some(Ok(Some(frame))) if frame == self.frame)
    }

    /// Passes over a frame of every source; `false` at an end.
    fn skip(&mut self) -> bool {
        self.frame += 1;
        let video = self.source.video.as_mut().is_none_or(Footage::skip);
        let masks = self.source.masks.as_mut().is_none_or(FrameSource::skip);
        video && masks
    }

    /// The next frame of the sources.
    fn take(
        &mut self,
        schedule: &Schedule,
        camera: usize,
        spare: Option<CameraFrame>,
    ) -> Result<Option<Fed>> {
        let mut decode = Duration::ZERO;
        if let Some(video) = &mut self.source.video {
            match video.read(&mut self.picture)? {
                source::Next::Frame(took) => decode += took,
                source::Next::Missing => {
                    self.frame += 1;
                    return Ok(Some(Fed::nothing(Verdict::Lost)));
                }
                source::Next::End => return Ok(None),
            }
        }
        let started = Instant::now();
        if let Some(masks) = &mut self.source.masks
            && !masks.read(&mut self.mask_picture)?
        {
            return Ok(None);
        }
        let decoded = Instant::now();
        self.frame += 1;
        let time_s = schedule.frame_time_s(camera, self.frame)?;
        if let Some(health) = &mut self.health {
            let verdict = match () {
                () if health::is_dark(&self.picture) => Verdict::Dark,
                () if health.is_frozen(&self.picture, time_s) => Verdict::Frozen,
                () => Verdict::Usable,
            };
            let usable = verdict == Verdict::Usable;
            let real = (!usable || !self.undistort.is_identity()).then(|| self.picture.clone());
            let image = usable.then(|| self.pinhole_picture(spare.and_then(|s| s.image)));
            let foreground = decoded.elapsed();
            let frame = CameraFrame { mask: None, image };
            return Ok(Some(Fed { frame, real, verdict, decode: decode + (decoded - started), foreground }));
        }
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
            // No short cut: the compiler then takes many pixels at once.
            let set = p[0].max(p[1]).max(p[2]) >= self.mask_from;
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
