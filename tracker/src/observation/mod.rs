//! Observations: all data that the trackers need of one picture, and all that leaves a station.
//!
//! * [`Mask`] — the foreground, one bit a pixel, in the camera's pinhole image at the working size.
//! * [`Colours`] — the colours of that foreground on a coarse grid, for appearance.
//! * [`PersonBox`] — a detector's box around one person.
//! * [`Observation`] — all of these with capture time, sequence number and health.
//! * [`Feedback`] — the tracker's estimates of the people, sent back so that they are not learnt as background.

mod boxes;
mod colours;
mod mask;

use nalgebra::Vector2;

pub use self::boxes::PersonBox;
pub use self::colours::Colours;
pub use self::mask::Mask;
use crate::foreground::Verdict;
use crate::silhouette::Body;

/// Observation of one camera at one time, without its picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Number of the frame among those that its camera delivered, from 1.
    pub sequence: u64,
    /// Capture time on the run's clock, seconds.
    pub time_s: f64,
    /// Health of the camera: whether the frame can be used.
    pub health: Verdict,
    /// Foreground in the pinhole image at the working size; `None` unless the health is [`Verdict::Usable`], and for
    /// methods that need no masks.
    pub mask: Option<Mask>,
    /// Colours of the foreground; `None` without a picture.
    pub colours: Option<Colours>,
    /// Boxes of people; `None` without a detector.
    pub boxes: Option<Vec<PersonBox>>,
}

impl Observation {
    /// Observation of a camera without a usable frame.
    pub fn unusable(sequence: u64, time_s: f64, health: Verdict) -> Self {
        Self { sequence, time_s, health, mask: None, colours: None, boxes: None }
    }
}

/// The tracker's estimates of the people after an observation was used or passed over.
///
/// A station of a recording is at most [`Feedback::WINDOW`] observations ahead of its feedback: so the feedback that
/// each observation gets is the same in every run, and no queue grows.
#[derive(Debug, Clone, PartialEq)]
pub struct Feedback {
    /// The observation's sequence number.
    pub sequence: u64,
    /// Bodies of the people, by the latest estimates.
    pub people: Vec<Body>,
}

impl Feedback {
    /// Number of observations that a station may be ahead of its feedback.
    pub const WINDOW: u64 = 8;

    /// Whether all people stand within a millimetre of their positions in `other`, so that they need not be drawn
    /// again.
    pub fn is_like(&self, other: &[Body]) -> bool {
        self.people.len() == other.len()
            && self.people.iter().zip(other).all(|(a, b)| {
                let moved = Vector2::new(a.x_m - b.x_m, a.y_m - b.y_m).norm();
                moved < 1e-3 && (a.height_m - b.height_m).abs() < 1e-3
            })
    }
}
