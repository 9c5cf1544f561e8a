//! Messages from a station to the gathering: an observation, and the demanded pictures.

use std::sync::Arc;
use std::time::Duration;

use image::RgbImage;

use crate::Error;
use crate::observation::Observation;

/// One observed frame of a camera.
#[derive(Debug, Clone)]
pub struct ObservedFrame {
    /// Input of the trackers.
    pub observation: Observation,
    /// The demanded pictures.
    pub pictures: Pictures,
    /// Wall time of decoding.
    pub decode: Duration,
    /// Wall time from the decoded picture to the observation.
    pub foreground: Duration,
}

/// Pictures of a frame. They are shared, because a frame may belong to several moments.
#[derive(Debug, Clone, Default)]
pub struct Pictures {
    /// Pinhole image at the working size, for methods that read pictures.
    pub pinhole: Option<Arc<RgbImage>>,
    /// Filmed image, for films and pages.
    pub filmed: Option<Arc<RgbImage>>,
}

/// Message from a station to the gathering.
#[derive(Debug)]
pub enum Event {
    /// A frame was observed.
    Seen(Box<ObservedFrame>),
    /// The recording has no more frames.
    Ended,
    /// A frame cannot be decoded, or has no time. No event follows.
    Failed(Error),
}

/// Demand for the filmed picture of a station's frames.
#[derive(Clone, Default)]
pub enum PictureDemand {
    /// No picture is drawn.
    #[default]
    Never,
    /// Every frame is drawn, for a film.
    Always,
    /// Pictures are drawn while the function returns true, that is, while a viewer is connected.
    While(Arc<dyn Fn() -> bool + Send + Sync>),
}

impl std::fmt::Debug for PictureDemand {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Never => "Never",
            Self::Always => "Always",
            Self::While(_) => "While",
        })
    }
}

impl PictureDemand {
    /// Whether the next picture is wanted.
    pub fn is_wanted(&self) -> bool {
        match self {
            Self::Never => false,
            Self::Always => true,
            Self::While(is_watched) => is_watched(),
        }
    }
}
