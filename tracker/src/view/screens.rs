//! Present pictures, shared between drawers and viewers.

use std::io::Cursor;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;
use tokio::sync::watch::{Receiver, Sender};

use crate::film::{Audience, Painted};

/// JPEG quality: high enough for sharp edges of the drawing.
const JPEG_QUALITY: u8 = 85;

/// Time after a request during which its viewer counts as waiting.
const WATCHING: Duration = Duration::from_secs(2);

/// A screen for each camera, on which a new picture replaces the older one.
#[derive(Debug, Clone)]
pub struct Screens {
    now: Sender<ScreensState>,
    /// Time of the latest request for something new.
    asked: Arc<Mutex<Option<Instant>>>,
}

/// Present state, as sent to the page.
#[derive(Debug, Serialize)]
pub(super) struct ScreensState {
    /// Number of changes, from 1.
    pub(super) number: u64,
    /// Title of the page.
    title: String,
    /// Moment of the newest picture; `None` before the first.
    moment: Option<ShownMoment>,
    cameras: Vec<CameraScreen>,
    pub(super) has_ended: bool,
}

/// Moment, as sent to the page.
#[derive(Debug, Serialize)]
struct ShownMoment {
    frame: u32,
    time_s: f64,
    people: usize,
}

#[derive(Debug, Serialize)]
struct CameraScreen {
    name: String,
    /// Number of the change that brought the picture.
    picture: Option<u64>,
    #[serde(skip)]
    shown: Option<Arc<EncodedPicture>>,
}

/// A picture, encoded when it is first requested.
#[derive(Debug)]
pub(super) struct EncodedPicture {
    pixels: RgbImage,
    jpeg: OnceLock<Bytes>,
}

impl EncodedPicture {
    /// Picture as JPEG; empty when it has no pixels or too many.
    pub(super) fn jpeg(&self) -> Bytes {
        let encoded = || {
            let mut bytes = Cursor::new(Vec::new());
            match JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).encode_image(&self.pixels) {
                Ok(()) => bytes.into_inner().into(),
                Err(_) => Bytes::new(),
            }
        };
        self.jpeg.get_or_init(encoded).clone()
    }
}

impl Screens {
    /// Empty screens of cameras with these names, on a page with this title.
    pub fn new<'a>(title: String, names: impl Iterator<Item = &'a str>) -> Self {
        let cameras =
            names.map(|name| CameraScreen { name: name.to_owned(), picture: None, shown: None }).collect();
        let now = ScreensState { number: 1, title, moment: None, cameras, has_ended: false };
        Self { now: Sender::new(now), asked: Arc::default() }
    }

    /// Whether a viewer waits for something new.
    pub fn is_awaited(&self) -> bool {
        self.now.receiver_count() > 0
    }

    /// Whether a viewer waits for something new, or did so recently: then the present pictures will be requested.
    pub fn is_watched(&self) -> bool {
        let asked = *self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        self.is_awaited() || asked.is_some_and(|at| at.elapsed() < WATCHING)
    }

    /// Shows pictures together. Never waits for viewers.
    pub fn show(&self, pictures: impl IntoIterator<Item = Painted>) {
        self.now.send_modify(|now| {
            now.number += 1;
            for Painted { camera, frame, time_s, people, picture } in pictures {
                let Some(screen) = now.cameras.get_mut(camera) else { continue };
                screen.shown = Some(Arc::new(EncodedPicture { pixels: picture, jpeg: OnceLock::new() }));
                screen.picture = Some(now.number);
                // One camera's film may be a few frames behind another's.
                if now.moment.as_ref().is_none_or(|shown| shown.frame <= frame) {
                    now.moment = Some(ShownMoment { frame, time_s, people });
                }
            }
        });
    }

    /// Callback for a film that shows its frames.
    pub fn audience(&self) -> Audience {
        let screens = self.clone();
        Arc::new(move |painted| screens.show([painted]))
    }

    /// Marks the end of the run.
    pub(super) fn end(&self) {
        self.now.send_modify(|now| {
            now.number += 1;
            now.has_ended = true;
        });
    }

    /// Receiver of changes; its holder counts as a waiting viewer.
    pub(super) fn wait(&self) -> Receiver<ScreensState> {
        *self.asked.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        self.now.subscribe()
    }

    /// Calls `look` with the present state.
    pub(super) fn look<T>(&self, look: impl FnOnce(&ScreensState) -> T) -> T {
        look(&self.now.borrow())
    }
}

impl ScreensState {
    /// Newest picture of the camera with this index, if there is one.
    pub(super) fn picture(&self, camera: usize) -> Option<Arc<EncodedPicture>> {
        self.cameras.get(camera)?.shown.clone()
    }
}
