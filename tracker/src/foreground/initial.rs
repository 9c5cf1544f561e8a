//! Background with which the foreground of a camera begins.

use calib::vision::AdaptiveKind;
use image::RgbImage;

use super::backdrop::Backdrop;

/// Initial background of one camera.
#[derive(Debug, Clone)]
pub enum InitialBackground {
    /// An empty scene, learnt beforehand, in each of its lights ([`super::lights::learn`]); at least one.
    Backdrops(Vec<Backdrop>),
    /// No background: an adaptive model learns during the run.
    Nothing(AdaptiveKind),
    /// A reference picture of the room, taken at another time and in other light, in which only movable things may
    /// differ: the default adaptive model starts from it.
    Reference {
        /// Name of the camera, for the log.
        camera: String,
        /// The picture, at the size of the masks.
        picture: RgbImage,
    },
}

impl InitialBackground {
    /// The empty scene that is known beforehand, in its first light.
    pub fn empty_scene(&self) -> Option<&Backdrop> {
        match self {
            Self::Backdrops(scenes) => scenes.first(),
            Self::Nothing(_) | Self::Reference { .. } => None,
        }
    }
}

impl From<Backdrop> for InitialBackground {
    fn from(scene: Backdrop) -> Self {
        Self::Backdrops(vec![scene])
    }
}
