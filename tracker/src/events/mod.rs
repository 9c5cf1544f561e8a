//! Events, counts, stays and groups of a run, from the lines of `tracks.jsonl`.
//!
//! * [`Events`] — the detector: a pure state machine, one line of `tracks.jsonl` after the other. Start here.
//! * [`Event`] — a line of `events.jsonl`.
//! * [`Tally`] — people inside, in and out, by place.
//! * [`Groups`] — people who walk together.
//! * [`EventFiles`] — the files of a run; [`of_run`] writes them for a finished one.
//! * [`stats`] — the day in words and as CSV.
//! * [`Clock`] — time of day.

mod border;
mod cameras;
mod change_point;
mod clock;
mod detector;
mod doors;
mod event;
#[cfg(test)]
mod file_tests;
mod files;
mod fix;
mod gap;
mod groups;
mod heat;
mod open_visits;
mod passing;
#[cfg(test)]
mod property_tests;
pub mod stats;
mod tally;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod unseen_tests;
mod words;

pub use clock::Clock;
pub(crate) use clock::{civil_from_days, days_from_civil};
pub use detector::Events;
pub use event::{Direction, Event, EventKind};
pub use files::{EventFileOptions, EventFiles, of_run};
pub(crate) use files::{HEAT_PICTURE, are_in, derive, remove};
pub use groups::{Group, Groups};
pub use mot::CameraState;
pub use tally::{PlaceCount, Tally};
pub(crate) use words::duration;

/// Options of the detector.
#[derive(Debug, Clone, PartialEq)]
pub struct EventOptions {
    /// Distance beyond a border at which a person counts as being on its other side, in standard deviations of their
    /// position: at 2, the probability of that is 98 %. Chosen with `border_s` on synthetic paths of seeds 101 to 110.
    pub border_sigmas: f64,
    /// Time for which they are there before it is decided, seconds: a single wild position is no change of side.
    pub border_s: f64,
    /// Standard deviation that is added to the posterior's, metres: bodies sway, and a tracker's errors last.
    pub path_sigma_m: f64,
    /// Least duration of a track before it appears, seconds. Shorter ones are no events.
    pub seen_s: f64,
    /// Least confidence of a track when it appears.
    pub least_confidence: f64,
    /// Time after which somebody who is missing has disappeared, seconds.
    pub lost_s: f64,
    /// Time within which somebody who disappeared away from an exit and is found under the same id was there all the
    /// time, seconds: their disappearance is revoked.
    pub found_s: f64,
    /// Least duration of a camera's state, seconds.
    pub camera_s: f64,
}

impl Default for EventOptions {
    fn default() -> Self {
        Self {
            border_sigmas: 2.0,
            border_s: 0.1,
            path_sigma_m: 0.03,
            seen_s: 0.5,
            least_confidence: 0.5,
            lost_s: 2.0,
            found_s: 20.0,
            camera_s: 1.0,
        }
    }
}

impl EventOptions {
    /// Time after which an event is neither missing nor taken back, seconds; one of a person who stands on a border may
    /// come even later.
    pub fn settle_s(&self) -> f64 {
        self.found_s.max(self.lost_s) + 1.0
    }
}
