//! Checks of a run's films before it: do they show what the room's cameras see, and do their times fit?
//!
//! * [`views`] — each film's empty scene against the room's reference pictures: films that were swapped, a camera that has
//!   turned since, another room, somebody who stands still for most of a film.
//! * [`film_times`] — the times that a film's file states: its start, gaps, and a rate that its header has wrong.
//! * [`shift`] — the times at which films show the same people.
//! * [`pose_watch`] — the same during a run: a camera that turns.
//!
//! A finding before a run is a warning: the run goes on with what it was given.

mod agreement;
pub mod film_times;
pub mod pose_watch;
pub mod shift;
mod still_people;
#[cfg(test)]
mod tests;
pub mod views;

use std::fmt;

/// Something about a film that does not fit, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Name of the film's camera.
    pub camera: String,
    /// Path of the film as it was given.
    pub film: String,
    /// Problem of the film, and the mend.
    pub text: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}: {}", self.camera, self.film, self.text)
    }
}
