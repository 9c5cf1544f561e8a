//! One station as the gathering sees it, whether it works in this process or on another machine.

use std::sync::mpsc::Sender;

use super::seen::Event;
use crate::observation::Feedback;

/// The channel into which all stations put what they observe, with the number of their camera in the stage.
pub type Inbox = Sender<(usize, Event)>;

/// Facts about a station before its first observation, and the channel back to it.
pub struct Port {
    /// Name of its camera.
    pub name: String,
    /// Whether it shows what happens now; else it reads a recording.
    pub is_live: bool,
    /// Frames a second, on average, where the source says so.
    pub rate_hz: Option<f64>,
    /// Takes feedback to the station. A station that has gone needs none.
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
