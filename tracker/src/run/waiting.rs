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

#[cfg(test)]
mod tests {
    use super::*;

    /// How many moments wait after each of 40, `step_s` apart.
    fn queue(step_s: f64, lag_s: f64) -> Vec<usize> {
        let mut waiting = VecDeque::new();
        let mut told = 0;
        (0..40)
            .map(|frame| {
                let time_s = f64::from(frame) * step_s;
                let (cameras, real, verdicts, people) = (vec![], vec![], vec![], vec![]);
                waiting.push_back(Waiting { frame, time_s, cameras, real, verdicts, people });
                while let Some(first) = due(&mut waiting, lag_s, time_s) {
                    assert_eq!(first.frame, told, "one after the other");
                    told += 1;
                }
                waiting.len()
            })
            .collect()
    }

    #[test]
    fn moments_wait_as_long_as_asked_but_never_too_many_at_once() {
        assert_eq!(queue(0.1, 0.0), vec![0; 40]);
        // 0.1 is no binary fraction: a third tenth may come out above three tenths.
        let three: Vec<usize> = (0..40).map(|frame| (frame + 1).min(3)).collect();
        assert_eq!(queue(0.1, 0.3), three);
        let most: Vec<usize> = (0..40).map(|frame| (frame + 1).min(MOST_MOMENTS)).collect();
        assert_eq!(queue(0.01, 10.0), most);
    }
}
