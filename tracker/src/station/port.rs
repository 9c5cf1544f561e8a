//! One station as the gathering sees it, whether it works in this process or on another machine.

use std::sync::mpsc::Sender;

use super::seen::Event;
use crate::observation::Feedback;

/// Channel into which all stations put their observations, with the index of their camera in the prepared room.
pub type Inbox = Sender<(usize, Event)>;

/// Description of a station before its first observation, and the channel back to it.
pub struct Port {
    /// Name of its camera.
    pub name: String,
    /// Whether the station is live; otherwise it reads a recording.
    pub is_live: bool,
    /// Mean frame rate, frames a second, if the source states it.
    pub rate_hz: Option<f64>,
    /// Whether a detector's boxes are all that the station observes.
    pub has_boxes_alone: bool,
    /// Sends feedback to the station. Feedback for a station that has ended is dropped.
    pub feedback: Box<dyn FnMut(Feedback) + Send>,
}

impl std::fmt::Debug for Port {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Port")
            .field("name", &self.name)
            .field("is_live", &self.is_live)
            .field("rate_hz", &self.rate_hz)
            .finish_non_exhaustive()
    }
}
