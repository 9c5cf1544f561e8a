//! Usability of a camera's picture or mask in a moment.

use mot::CameraState;

/// Verdict on a camera's frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The mask can be used.
    Usable,
    /// The camera repeats the same picture.
    Frozen,
    /// The picture is dark.
    Dark,
    /// Nearly everything has suddenly become foreground: a switched light, or a moved camera.
    AllForeground,
    /// The camera stands elsewhere than the room has it.
    Moved,
    /// A background that is learnt during the run has not seen enough yet.
    Learning,
    /// A live stream has broken off; it is being opened again.
    Lost,
    /// A live camera has sent no picture for a while.
    Silent,
    /// The camera sends pictures of another shape than the room was calibrated for.
    OtherShape,
    /// The camera has no frame near this moment, because its rate is lower than another's; the camera works.
    Between,
}

impl Verdict {
    /// State of a camera with this verdict about its pictures; `None` for one that only learns its background.
    pub fn camera_state(self) -> Option<CameraState> {
        match self {
            Self::Usable | Self::Between => Some(CameraState::Back),
            Self::Frozen => Some(CameraState::Frozen),
            Self::Dark => Some(CameraState::Dark),
            Self::AllForeground | Self::Moved => Some(CameraState::Moved),
            Self::Lost | Self::Silent | Self::OtherShape => Some(CameraState::Lost),
            Self::Learning => None,
        }
    }

    /// Whether the camera has a fault now.
    pub fn is_set_aside(self) -> bool {
        !matches!(self, Self::Usable | Self::Between)
    }
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Usable => "usable",
            Self::Frozen => "frozen",
            Self::Dark => "dark",
            Self::AllForeground => "all foreground (light switched or camera moved)",
            Self::Moved => "it has turned or was moved",
            Self::Learning => "learning its background",
            Self::Lost => "its stream has broken off (it is opened again, once a second)",
            Self::Silent => "sends no pictures",
            Self::OtherShape => "sends pictures of another shape than the room was calibrated for",
            Self::Between => "between two of its frames",
        })
    }
}
