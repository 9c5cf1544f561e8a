//! Moments whose people are not told yet, because a little later more is known of them ([`Method::hindsight`]).

use std::collections::VecDeque;

use image::RgbImage;

use super::output::{Followed, Output};
use crate::foreground::Verdict;
use crate::method::Method;
use crate::moment::CameraFrame;
use crate::{Moment, PersonEstimate, Result};

/// No more moments than this wait, with their pictures, however fast they come.
const MOST_MOMENTS: usize = 12;

/// A moment that waits.
pub(super) struct Waiting {
    pub(super) frame: u32,
    pub(super) time_s: f64,
    pub(super) cameras: Vec<CameraFrame>,
    pub(super) real: Vec<Option<RgbImage>>,
    pub(super) verdicts: Vec<Verdict>,
    /// As known then.
    pub(super) people: Vec<PersonEstimate>,
}

impl Waiting {
    /// Gives the outputs what is known now.
    pub(super) fn tell(&self, method: &mut dyn Method, outputs: &mut [Box<dyn Output + '_>]) -> Result<()> {
        let later = method.hindsight(self.frame);
        let followed = Followed {
            moment: Moment { frame: self.frame, time_s: self.time_s, cameras: &self.cameras },
            people: later.as_ref().unwrap_or(&self.people),
            verdicts: &self.verdicts,
            real: &self.real,
        };
        outputs.iter_mut().try_for_each(|output| output.put(&followed))
    }
}

/// Takes the first moment out if it has waited long enough at `now_s`.
pub(super) fn due(waiting: &mut VecDeque<Waiting>, lag_s: f64, now_s: f64) -> Option<Waiting> {
    // Rounding must not let a moment wait for one more.
    let long_enough = |first: &Waiting| first.time_s + lag_s <= now_s + 1e-9;
    let is_due = waiting.len() > MOST_MOMENTS || waiting.front().is_some_and(long_enough);
    if is_due { waiting.pop_front() } else { None }
}
