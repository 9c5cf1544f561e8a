//! Messages from a station to the gathering: an observation, and the pictures that somebody asked for.

use std::sync::Arc;
use std::time::Duration;

use image::RgbImage;

use crate::Error;
use crate::observation::Observation;

/// One frame of a camera, after its station's work.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Input of the trackers.
    pub observation: Observation,
    /// The pictures that were asked for.
    pub pictures: Pictures,
    /// Wall time of decoding.
    pub decode: Duration,
    /// Wall time from the decoded picture to the observation.
    pub foreground: Duration,
}

/// The pictures of a frame. Shared, because a frame may belong to several moments.
#[derive(Debug, Clone, Default)]
pub struct Pictures {
    /// In the pinhole image at the working size, for methods that read pictures.
    pub pinhole: Option<Arc<RgbImage>>,
    /// As it was filmed, for films and pages.
    pub filmed: Option<Arc<RgbImage>>,
}

/// Message from a station to the gathering.
#[derive(Debug)]
pub enum Event {
    /// A frame was observed.
    Seen(Box<Seen>),
    /// A recording has no more frames.
    Ended,
    /// A frame cannot be decoded, or has no time. Nothing comes after it.
    Failed(Error),
}

/// Frames of which a station keeps the picture as it was filmed.
#[derive(Clone, Default)]
pub enum PictureDemand {
    /// Nobody draws.
    #[default]
    Never,
    /// A film is made of every frame.
    Always,
    /// While somebody watches, as this tells.
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
