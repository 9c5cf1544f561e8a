//! The station of a live camera: it observes the newest picture, and never works off a backlog.
//!
//! A reader thread empties the stream as fast as frames arrive, so that nothing waits in a socket, and hands over at
//! most [`READY`] pictures; while the station is busy, pictures are passed over and missing in the sequence of its
//! observations. A stream that breaks off is opened again once a second, without end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use calib::video::FrameSource;
use image::RgbImage;

use super::observer::{FrameInput, Observer};
use super::permits::Permits;
use super::seen::{Event, ObservedFrame, PictureDemand, Pictures};
use crate::foreground::Verdict;
use crate::observation::{Feedback, Observation};
use crate::source::{ArrivalClock, LiveSource, utc_s};
use crate::{Error, Result};

/// Number of pictures that may wait for the station, beside the one it works on.
const READY: usize = 1;
/// Time between two attempts to open a stream.
const RETRY: Duration = Duration::from_secs(1);
/// Interval at which a station without pictures checks whether its receiver is still there.
const LISTEN: Duration = Duration::from_millis(200);
/// Largest relative difference of a picture's aspect ratio from the calibrated camera's.
const SAME_SHAPE: f64 = 0.01;

/// Station of one live camera.
pub struct LiveStation {
    /// Stream or device.
    pub source: LiveSource,
    /// Maker of the observations.
    pub observer: Observer,
    /// Width and height of the camera as the room has it, pixels.
    pub filmed_size: (u32, u32),
    /// Size of the drawn pictures, and the demand for them.
    pub drawn: ((u32, u32), PictureDemand),
}

/// A message from the reader to the station.
enum ReaderMessage {
    DecodedFrame(Box<DecodedFrame>),
    /// The stream is out of reach, or its pictures have another shape than the room was calibrated for.
    Nothing(Verdict),
}

struct DecodedFrame {
    sequence: u64,
    time_s: f64,
    picture: RgbImage,
    filmed: Option<RgbImage>,
    decode: Duration,
}

impl LiveStation {
    /// Observes until the receiver is gone, which `send` reports by `false`. Feedback is used as it arrives.
    pub fn run(self, feedback: &Receiver<Feedback>, permits: &Permits, mut send: impl FnMut(Event) -> bool) {
        let Self { source, mut observer, filmed_size, drawn } = self;
        let (give, take) = channel();
        let is_wanted = Arc::new(AtomicBool::new(true));
        let waiting = Arc::new(AtomicUsize::new(0));
        let reader = Reader {
            name: source.spec.clone(),
            sizes: (observer.size(), drawn.0),
            demand: drawn.1,
            filmed_size,
            give,
            waiting: Arc::clone(&waiting),
            is_wanted: Arc::clone(&is_wanted),
            sequence: 0,
            latest_health: Verdict::Usable,
        };
        // The thread ends by itself: a stream that does not answer may block it for seconds.
        thread::spawn(move || reader.run(source));
        loop {
            let read = match take.recv_timeout(LISTEN) {
                Ok(read) => Some(read),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => break,
            };
            match newest(feedback) {
                Ok(Some(newest)) => observer.expect(&newest),
                Ok(None) => {}
                Err(_) => break,
            }
            let event = match read {
                None => continue,
                Some(ReaderMessage::Nothing(health)) => Event::Seen(Box::new(nothing(health))),
                Some(ReaderMessage::DecodedFrame(frame)) => {
                    waiting.fetch_sub(1, Ordering::AcqRel);
                    let _permit = permits.acquire();
                    match observe(&mut observer, *frame) {
                        Ok(seen) => Event::Seen(Box::new(seen)),
                        Err(error) => Event::Failed(error),
                    }
                }
            };
            if !send(event) {
                break;
            }
        }
        is_wanted.store(false, Ordering::Relaxed);
    }
}

/// Newest feedback that has arrived, if any.
fn newest(feedback: &Receiver<Feedback>) -> std::result::Result<Option<Feedback>, TryRecvError> {
    let mut newest = None;
    loop {
        match feedback.try_recv() {
            Ok(later) => newest = Some(later),
            Err(TryRecvError::Empty) => return Ok(newest),
            Err(gone @ TryRecvError::Disconnected) => return Err(gone),
        }
    }
}

fn observe(observer: &mut Observer, frame: DecodedFrame) -> Result<ObservedFrame> {
    let started = Instant::now();
    let observed = {
        let shown = FrameInput { picture: Some(&frame.picture), ..FrameInput::default() };
        observer.observe(frame.sequence, frame.time_s, &shown)?
    };
    Ok(ObservedFrame {
        observation: observed.observation,
        pictures: Pictures { pinhole: observed.pinhole, filmed: frame.filmed.map(Arc::new) },
        decode: frame.decode,
        foreground: started.elapsed(),
    })
}

/// Observation of a camera whose stream is out of reach.
fn nothing(health: Verdict) -> ObservedFrame {
    ObservedFrame {
        observation: Observation::unusable(0, utc_s(SystemTime::now()), health),
        pictures: Pictures::default(),
        decode: Duration::ZERO,
        foreground: Duration::ZERO,
    }
}

/// Thread that empties the stream.
struct Reader {
    name: String,
    /// Sizes of the observed pictures, and of the drawn ones.
    sizes: ((u32, u32), (u32, u32)),
    demand: PictureDemand,
    filmed_size: (u32, u32),
    give: Sender<ReaderMessage>,
    /// Number of pictures that wait for the station.
    waiting: Arc<AtomicUsize>,
    is_wanted: Arc<AtomicBool>,
    sequence: u64,
    latest_health: Verdict,
}

impl Reader {
    fn run(mut self, source: LiveSource) {
        let mut opened = source.opened;
        let mut has_warned = source.has_warned;
        while self.is_wanted.load(Ordering::Relaxed) {
            let attempt =
                opened.take().map_or_else(|| FrameSource::open(&source.spec).map_err(Error::from), Ok);
            match attempt {
                Ok(stream) => {
                    has_warned = false;
                    self.drain(stream);
                }
                Err(error) if !has_warned => {
                    tracing::warn!("{error}; it is tried again, once a second");
                    has_warned = true;
                }
                Err(error) => tracing::debug!("{error}"),
            }
            if !self.is_wanted.load(Ordering::Relaxed) || !self.say(Verdict::Lost) {
                return;
            }
            thread::sleep(RETRY);
        }
    }

    /// Reads until the stream breaks off.
    fn drain(&mut self, mut stream: FrameSource) {
        let mut clock = ArrivalClock::new(&self.name);
        while self.is_wanted.load(Ordering::Relaxed) {
            let started = Instant::now();
            match stream.advance() {
                Ok(true) => {}
                Ok(false) => return,
                Err(error) => {
                    tracing::debug!("{error}");
                    return;
                }
            }
            let stamp = stream.stamp();
            let arrived_s = utc_s(SystemTime::now()) - stamp.arrival.elapsed().as_secs_f64();
            let time_s = clock.next(stamp.presentation_s, stamp.sender_s, arrived_s);
            if !self.is_of_shape(stream.frame_size()) {
                if !self.say(Verdict::OtherShape) {
                    return;
                }
                continue;
            }
            self.sequence += 1;
            if !self.hand_over(&mut stream, time_s, started) {
                return;
            }
        }
    }

    /// Whether a picture can be scaled to the calibrated camera's size.
    fn is_of_shape(&self, (width, height): (u32, u32)) -> bool {
        let (expected_width, expected_height) = self.filmed_size;
        let ratio = f64::from(width) * f64::from(expected_height)
            / (f64::from(height) * f64::from(expected_width)).max(1.0);
        (ratio - 1.0).abs() <= SAME_SHAPE
    }

    /// Hands over the frame that was decoded last, if the station has room for it. Returns whether the station still
    /// exists.
    fn hand_over(&mut self, stream: &mut FrameSource, time_s: f64, started: Instant) -> bool {
        if self.waiting.load(Ordering::Acquire) >= READY {
            // The gathering counts gaps in the sequence.
            return self.is_wanted.load(Ordering::Relaxed);
        }
        let ((width, height), (drawn_width, drawn_height)) = self.sizes;
        let mut picture = RgbImage::new(width, height);
        let mut filmed = self.demand.is_wanted().then(|| RgbImage::new(drawn_width, drawn_height));
        let made =
            stream.picture(&mut picture).and_then(|()| filmed.as_mut().map_or(Ok(()), |f| stream.picture(f)));
        if let Err(error) = made {
            tracing::debug!("{error}");
            return true;
        }
        self.latest_health = Verdict::Usable;
        self.waiting.fetch_add(1, Ordering::AcqRel);
        let frame =
            DecodedFrame { sequence: self.sequence, time_s, picture, filmed, decode: started.elapsed() };
        self.give.send(ReaderMessage::DecodedFrame(Box::new(frame))).is_ok()
    }

    /// Reports a change of the stream's health to the station. Returns whether the station still exists.
    fn say(&mut self, health: Verdict) -> bool {
        if std::mem::replace(&mut self.latest_health, health) == health {
            return true;
        }
        if health == Verdict::OtherShape {
            tracing::warn!(
                "{}: sends pictures of another shape than the {} × {} that the room was calibrated for; set it back",
                self.name,
                self.filmed_size.0,
                self.filmed_size.1
            );
        }
        self.give.send(ReaderMessage::Nothing(health)).is_ok()
    }
}
