//! The station of a recording: every frame in order, as fast as the gathering takes them.

use std::path::Path;
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use calib::video::FrameSource;
use image::RgbImage;

use super::observer::{FrameInput, Observer};
use super::permits::Permits;
use super::seen::{Event, ObservedFrame, PictureDemand, Pictures};
use crate::observation::Feedback;
use crate::source::{CaptureTimes, DetectorBoxes, utc_s};
use crate::{Error, Result};

/// Station of one camera's recording.
pub struct RecordedStation {
    /// Pictures.
    pub video: Option<FrameSource>,
    /// Ready-made masks.
    pub masks: Option<FrameSource>,
    /// A detector's boxes.
    pub detections: Option<DetectorBoxes>,
    /// Capture times of the frames.
    pub times: CaptureTimes,
    /// Maker of the observations.
    pub observer: Observer,
    /// Size of the drawn pictures, and the demand for them.
    pub drawn: ((u32, u32), PictureDemand),
    /// Playback speed.
    pub pace: Pace,
}

/// Playback speed of a recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// As fast as the frames are processed.
    Free,
    /// At the recorded speed, with capture times that begin at the station's start, as a camera beside live cameras.
    Live,
    /// As [`Self::Live`], but time 0 of the recording is this time, seconds since 1970; late frames are passed over, so
    /// that a slow station never lags.
    From(f64),
}

/// Delay beyond which a frame is passed over, seconds.
const LATE_S: f64 = 0.1;

/// Result of reading a frame.
enum RecordedFrame {
    Seen(Box<ObservedFrame>),
    PassedOver,
    Ended,
}

impl RecordedStation {
    /// Observes frame after frame until the recording ends or fails, or the receiver is gone, which `send` reports by
    /// `false`.
    ///
    /// `feedback` has one message for each observation. It is used exactly [`Feedback::WINDOW`] observations later, so
    /// that its effect does not depend on the speed of any thread; in a paced recording it is used as it arrives.
    pub fn run(
        mut self,
        feedback: &Receiver<Feedback>,
        permits: &Permits,
        mut send: impl FnMut(Event) -> bool,
    ) {
        let (width, height) = self.observer.size();
        let [mut picture, mut mask] = [(); 2].map(|()| RgbImage::new(width, height));
        let mut sequence = 0;
        let first_s = match self.pace {
            Pace::Free => None,
            Pace::Live => Some(utc_s(SystemTime::now())),
            Pace::From(first_s) => Some(first_s),
        };
        loop {
            sequence += 1;
            if first_s.is_some() {
                for newest in feedback.try_iter() {
                    self.observer.expect(&newest);
                }
            } else if sequence > Feedback::WINDOW {
                match feedback.recv() {
                    Ok(newest) => self.observer.expect(&newest),
                    Err(_) => return,
                }
            }
            let permit = permits.acquire();
            let event = match self.next(sequence, &mut picture, &mut mask) {
                Ok(RecordedFrame::Seen(seen)) => Event::Seen(seen),
                Ok(RecordedFrame::PassedOver) => continue,
                Ok(RecordedFrame::Ended) => Event::Ended,
                Err(error) => Event::Failed(error),
            };
            drop(permit);
            let (is_last, event) = match (event, first_s) {
                (Event::Seen(mut seen), Some(first_s)) => {
                    wait(&mut seen, first_s);
                    (false, Event::Seen(seen))
                }
                (Event::Seen(seen), None) => (false, Event::Seen(seen)),
                (last, _) => (true, last),
            };
            if !send(event) || is_last {
                return;
            }
        }
    }

    /// Reads and observes the next frame; the shorter of pictures and masks determines the end, without either the
    /// detections do. `picture` and `mask` are buffers.
    fn next(&mut self, sequence: u64, picture: &mut RgbImage, mask: &mut RgbImage) -> Result<RecordedFrame> {
        let started = Instant::now();
        let mut stamp_s = None;
        if let Some(video) = &mut self.video {
            if !video.advance()? {
                return Ok(RecordedFrame::Ended);
            }
            stamp_s = video.stamp().presentation_s;
        }
        if let Some(masks) = &mut self.masks {
            if !masks.advance()? {
                return Ok(RecordedFrame::Ended);
            }
            if self.video.is_none() {
                stamp_s = masks.stamp().presentation_s;
            }
        }
        let boxes = self.detections.as_ref().map(|detections| detections.of(sequence));
        if self.video.is_none() && self.masks.is_none() {
            let frames = self.detections.as_ref().map_or(0, DetectorBoxes::frame_count);
            if sequence > u64::from(frames) {
                return Ok(RecordedFrame::Ended);
            }
        }
        let time_s = self.times.next(stamp_s)?;
        if matches!(self.pace, Pace::From(first_s) if utc_s(SystemTime::now()) > first_s + time_s + LATE_S) {
            return Ok(RecordedFrame::PassedOver);
        }
        let mut filmed = None;
        if let Some(video) = &mut self.video {
            check_size(video)?;
            video.picture(picture)?;
            let ((width, height), demand) = &self.drawn;
            if demand.is_wanted() {
                let mut drawn = RgbImage::new(*width, *height);
                video.picture(&mut drawn)?;
                filmed = Some(drawn.into());
            }
        }
        if let Some(masks) = &mut self.masks {
            check_size(masks)?;
            masks.picture(mask)?;
        }
        let decode = started.elapsed();
        let picture = self.video.is_some().then_some(&*picture);
        let mask = self.masks.is_some().then_some(&*mask);
        let observed = self.observer.observe(sequence, time_s, &FrameInput { picture, mask, boxes })?;
        Ok(RecordedFrame::Seen(Box::new(ObservedFrame {
            observation: observed.observation,
            pictures: Pictures { pinhole: observed.pinhole, filmed },
            decode,
            foreground: started.elapsed().saturating_sub(decode),
        })))
    }
}

/// Checks that the size of the frame is that of the first: a part of another size was not filmed with the calibrated
/// camera.
///
/// # Errors
/// Names the recording and the frame.
fn check_size(video: &FrameSource) -> Result<()> {
    let ((width, height), (first_width, first_height)) = (video.frame_size(), video.size());
    if (width, height) == (first_width, first_height) {
        return Ok(());
    }
    let problem = format!(
        "is {width} × {height} pixels, the frames before it are {first_width} × {first_height}; give a recording of one size"
    );
    let path = video.image_path().unwrap_or(Path::new(video.name()));
    Err(Error::content(path, format!("frame {}", video.delivered()), problem))
}

/// Waits until the frame would have been filmed if the recording had started at `first_s`, seconds since 1970, and
/// makes that its capture time.
fn wait(seen: &mut ObservedFrame, first_s: f64) {
    let due_s = first_s + seen.observation.time_s.max(0.0);
    let rest = Duration::try_from_secs_f64(due_s - utc_s(SystemTime::now())).unwrap_or_default();
    thread::sleep(rest);
    seen.observation.time_s += first_s;
}
