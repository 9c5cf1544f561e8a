//! One camera's work: source → picture with its capture time → mask → observation.
//!
//! * [`Observer`] — one picture → one [`crate::observation::Observation`].
//! * [`RecordedStation`] — every frame of a recording in order, as fast as the gathering takes them or at the recorded
//!   speed.
//! * [`LiveStation`] — the newest picture of a live camera; frames that it cannot keep up with are passed over.
//! * [`LiveBoxStation`] — the boxes of a detector that writes to a pipe.
//! * [`PoseFollower`] — a camera that turns during the run.
//! * [`start`] — a station on a thread of this process, and the [`Port`] by which the gathering reaches it. A station in a
//!   process of its own does the same work and sends its events over the network ([`crate::wire`]).

mod live;
mod live_boxes;
mod observer;
mod permits;
mod port;
mod pose_follower;
mod recorded;
mod seen;

use std::sync::mpsc::{Receiver, channel};
use std::thread;

pub use live::LiveStation;
pub use live_boxes::LiveBoxStation;
pub use observer::{FrameInput, Masks, Observer};
pub use permits::Permits;
pub use port::{Inbox, Port};
pub use pose_follower::PoseFollower;
pub use recorded::{Pace, RecordedStation};
pub use seen::{Event, ObservedFrame, PictureDemand, Pictures};

use crate::observation::Feedback;

/// A station that has not been started.
pub struct Station {
    /// Name of its camera.
    pub name: String,
    /// Mean frame rate, frames a second, if the source states it.
    pub rate_hz: Option<f64>,
    /// Kind of the station, with all that it works with.
    pub work: Work,
}

/// The kinds of stations.
pub enum Work {
    /// Of a recording.
    Recorded(Box<RecordedStation>),
    /// Of a live camera.
    Live(Box<LiveStation>),
    /// Of a live detector.
    LiveBoxes(Box<LiveBoxStation>),
}

impl Station {
    /// Whether the station's frames are live.
    pub fn is_live(&self) -> bool {
        match &self.work {
            Work::Recorded(station) => station.pace != Pace::Free,
            Work::Live(_) | Work::LiveBoxes(_) => true,
        }
    }

    /// Whether a detector's boxes are all that the station observes.
    pub fn has_boxes_alone(&self) -> bool {
        match &self.work {
            Work::Recorded(station) => {
                station.detections.is_some() && station.video.is_none() && station.masks.is_none()
            }
            Work::Live(_) => false,
            Work::LiveBoxes(_) => true,
        }
    }

    /// Works until the source ends or fails, or the receiver is gone, which `send` reports by `false`.
    pub fn run(self, feedback: &Receiver<Feedback>, permits: &Permits, send: impl FnMut(Event) -> bool) {
        match self.work {
            Work::Recorded(station) => station.run(feedback, permits, send),
            Work::Live(station) => station.run(feedback, permits, send),
            Work::LiveBoxes(station) => station.run(feedback, send),
        }
    }
}

/// Starts a station on a thread of its own, as the camera of this number. It ends when its port is dropped.
pub fn start(station: Station, camera: usize, inbox: Inbox, permits: &Permits) -> Port {
    let (give_feedback, feedback) = channel();
    let (name, is_live, rate_hz) = (station.name.clone(), station.is_live(), station.rate_hz);
    let has_boxes_alone = station.has_boxes_alone();
    let permits = permits.clone();
    thread::spawn(move || station.run(&feedback, &permits, |event| inbox.send((camera, event)).is_ok()));
    let feedback = Box::new(move |feedback| {
        // A station that has ended needs no feedback.
        let _ = give_feedback.send(feedback);
    });
    Port { name, is_live, rate_hz, has_boxes_alone, feedback }
}
