//! Moments whose people are not told yet, because a little later more is known of them ([`Method::hindsight`]).

use std::collections::VecDeque;

use image::RgbImage;

use super::output::{Followed, Output};
use crate::foreground::Verdict;
use crate::method::Method;
use crate::moment::CameraFrame;
use crate::{Moment, PersonEstimate, Result};

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

    /// What its pictures take of memory.
    fn bytes(&self) -> usize {
        let masks = self.cameras.iter().filter_map(|c| c.mask.as_ref()).map(|m| m.as_raw().len());
        let images = self.cameras.iter().filter_map(|c| c.image.as_ref());
        let pictures = images.chain(self.real.iter().flatten()).map(|p| p.as_raw().len());
        masks.chain(pictures).sum()
    }
}

/// The moments that wait, the oldest first.
pub(super) struct WaitingRoom {
    lag_s: f64,
    /// What the pictures of all of them may take of memory; a moment that would not fit sends the oldest out early.
    most_bytes: usize,
    bytes: usize,
    moments: VecDeque<Waiting>,
    is_told: bool,
}

impl WaitingRoom {
    /// Where each moment waits for `lag_s` seconds.
    pub(super) fn new(lag_s: f64, most_bytes: usize) -> Self {
        Self { lag_s, most_bytes, bytes: 0, moments: VecDeque::new(), is_told: false }
    }

    pub(super) fn enter(&mut self, moment: Waiting) {
        self.bytes += moment.bytes();
        self.moments.push_back(moment);
    }

    /// Takes the first moment out if it has waited long enough at `now_s`, or takes up too much.
    pub(super) fn due(&mut self, now_s: f64) -> Option<Waiting> {
        // Rounding must not let a moment wait for one more.
        let is_due = self.moments.front()?.time_s + self.lag_s <= now_s + 1e-9;
        let is_too_much = self.bytes > self.most_bytes;
        if is_too_much && !is_due && !self.is_told {
            self.is_told = true;
            tracing::warn!(
                "the pictures of {} s take more memory than {} MiB: people are told earlier; give a shorter --lag",
                self.lag_s,
                self.most_bytes >> 20
            );
        }
        if is_due || is_too_much { self.leave() } else { None }
    }

    /// Takes the first moment out.
    pub(super) fn leave(&mut self) -> Option<Waiting> {
        let first = self.moments.pop_front()?;
        self.bytes -= first.bytes();
        Some(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::GrayImage;

    /// How many moments wait after each of 40 of 6 + 24 + 18 bytes, `step_s` apart.
    fn queue(step_s: f64, lag_s: f64, most_bytes: usize) -> Vec<usize> {
        let mut room = WaitingRoom::new(lag_s, most_bytes);
        let mut told = 0;
        (0..40)
            .map(|frame| {
                let time_s = f64::from(frame) * step_s;
                let mask = Some(GrayImage::new(2, 3));
                let cameras = vec![CameraFrame { mask, image: Some(RgbImage::new(2, 4)) }];
                let real = vec![Some(RgbImage::new(3, 2)), None];
                let (verdicts, people) = (vec![], vec![]);
                room.enter(Waiting { frame, time_s, cameras, real, verdicts, people });
                while let Some(first) = room.due(time_s) {
                    assert_eq!(first.frame, told, "one after the other");
                    told += 1;
                }
                room.moments.len()
            })
            .collect()
    }

    #[test]
    fn moments_wait_as_long_as_asked_while_their_pictures_fit() {
        assert_eq!(queue(0.1, 0.0, 1000), vec![0; 40]);
        let most = |n: usize| -> Vec<usize> { (0..40).map(|frame| (frame + 1).min(n)).collect() };
        // 0.1 is no binary fraction: a third tenth may come out above three tenths.
        assert_eq!(queue(0.1, 0.3, 1000), most(3));
        assert_eq!(queue(1.0 / 60.0, 0.4, 48 * 30), most(24));
        assert_eq!(queue(0.01, 10.0, 48 * 17), most(17));
        assert_eq!(queue(0.01, 10.0, 48 * 17 - 1), most(16));
    }
}
