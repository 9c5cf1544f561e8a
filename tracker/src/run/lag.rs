//! Moments held for the lag, so that what comes after them can correct their estimates ([`Method::hindsight`]).

use std::collections::VecDeque;

use super::output::{Followed, Output};
use crate::foreground::Verdict;
use crate::method::Method;
use crate::moment::CameraFrame;
use crate::station::Pictures;
use crate::{Moment, PersonEstimate, Result};

/// A moment with the estimates that were made at once.
pub(super) struct Held {
    pub(super) frame: u32,
    pub(super) time_s: f64,
    pub(super) cameras: Vec<CameraFrame>,
    pub(super) pictures: Vec<Pictures>,
    pub(super) health: Vec<Verdict>,
    pub(super) people: Vec<PersonEstimate>,
}

impl Held {
    /// Gives the outputs the best estimates there are now.
    pub(super) fn emit(&self, method: &mut dyn Method, outputs: &mut [Box<dyn Output + '_>]) -> Result<()> {
        let later = method.hindsight(self.frame);
        let followed = Followed {
            moment: Moment { frame: self.frame, time_s: self.time_s, cameras: &self.cameras },
            people: later.as_ref().unwrap_or(&self.people),
            verdicts: &self.health,
            pictures: &self.pictures,
            packets: method.packets(),
        };
        outputs.iter_mut().try_for_each(|output| output.put(&followed))
    }

    /// Memory of its pictures, bytes.
    fn bytes(&self) -> usize {
        let pictures = self.pictures.iter().flat_map(|p| [&p.pinhole, &p.filmed]);
        pictures.flatten().map(|picture| picture.as_raw().len()).sum()
    }
}

/// The moments that are held, the oldest first.
pub(super) struct LagBuffer {
    lag_s: f64,
    /// Most memory of all held pictures, bytes; a moment that would not fit sends the oldest out early.
    most_bytes: usize,
    bytes: usize,
    moments: VecDeque<Held>,
    has_warned: bool,
}

impl LagBuffer {
    /// A buffer in which each moment is held for `lag_s` seconds.
    pub(super) fn new(lag_s: f64, most_bytes: usize) -> Self {
        Self { lag_s, most_bytes, bytes: 0, moments: VecDeque::new(), has_warned: false }
    }

    pub(super) fn push(&mut self, moment: Held) {
        self.bytes += moment.bytes();
        self.moments.push_back(moment);
    }

    /// Takes the oldest moment out if it has been held long enough at `now_s`, or the pictures take too much memory.
    pub(super) fn pop_due(&mut self, now_s: f64) -> Option<Held> {
        // Rounding must not hold a moment for one more.
        let is_due = self.moments.front()?.time_s + self.lag_s <= now_s + 1e-9;
        let is_too_much = self.bytes > self.most_bytes;
        if is_too_much && !is_due && !self.has_warned {
            self.has_warned = true;
            tracing::warn!(
                "the pictures of {} s take more memory than {} MiB: estimates are written earlier; give a shorter --lag",
                self.lag_s,
                self.most_bytes >> 20
            );
        }
        if is_due || is_too_much { self.pop() } else { None }
    }

    /// Takes the oldest moment out.
    pub(super) fn pop(&mut self) -> Option<Held> {
        let oldest = self.moments.pop_front()?;
        self.bytes -= oldest.bytes();
        Some(oldest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::RgbImage;
    use std::sync::Arc;

    /// Moments held after each of 40 of 24 + 18 bytes, `step_s` apart.
    fn held(step_s: f64, lag_s: f64, most_bytes: usize) -> Vec<usize> {
        let mut buffer = LagBuffer::new(lag_s, most_bytes);
        let mut expected = 0;
        (0..40)
            .map(|frame| {
                let time_s = f64::from(frame) * step_s;
                let pictures = Pictures {
                    pinhole: Some(Arc::new(RgbImage::new(2, 4))),
                    filmed: Some(Arc::new(RgbImage::new(3, 2))),
                };
                let (cameras, health, people) = (vec![], vec![], vec![]);
                buffer.push(Held { frame, time_s, cameras, pictures: vec![pictures], health, people });
                while let Some(first) = buffer.pop_due(time_s) {
                    assert_eq!(first.frame, expected, "moments leave in their order");
                    expected += 1;
                }
                buffer.moments.len()
            })
            .collect()
    }

    #[test]
    fn moments_are_held_for_the_lag_while_their_pictures_fit() {
        assert_eq!(held(0.1, 0.0, 1000), vec![0; 40]);
        let most = |n: usize| -> Vec<usize> { (0..40).map(|frame| (frame + 1).min(n)).collect() };
        // 0.1 is no binary fraction: a third tenth may come out above three tenths.
        assert_eq!(held(0.1, 0.3, 1000), most(3));
        assert_eq!(held(1.0 / 60.0, 0.4, 42 * 30), most(24));
        assert_eq!(held(0.01, 10.0, 42 * 17), most(17));
        assert_eq!(held(0.01, 10.0, 42 * 17 - 1), most(16));
    }
}
