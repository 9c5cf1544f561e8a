//! Buffer that holds moments for the lag, so that the smoother can correct their estimates ([`Method::smoothed`]).

use std::collections::VecDeque;

use super::output::{Output, ProcessedMoment};
use crate::foreground::Verdict;
use crate::gathering::LeftOut;
use crate::method::Method;
use crate::moment::CameraFrame;
use crate::station::Pictures;
use crate::{Moment, PersonEstimate, Result};

/// A held moment, with the estimates of its own time.
pub(super) struct HeldMoment {
    pub(super) frame: u32,
    pub(super) time_s: f64,
    pub(super) utc_s: Option<f64>,
    pub(super) left_out: LeftOut,
    pub(super) cameras: Vec<CameraFrame>,
    pub(super) pictures: Vec<Pictures>,
    pub(super) health: Vec<Verdict>,
    pub(super) people: Vec<PersonEstimate>,
}

impl HeldMoment {
    /// Passes the moment to the outputs, with its smoothed estimates where there are such.
    pub(super) fn emit(&self, method: &mut dyn Method, outputs: &mut [Box<dyn Output + '_>]) -> Result<()> {
        let later = method.smoothed(self.frame);
        let followed = ProcessedMoment {
            moment: Moment { frame: self.frame, time_s: self.time_s, cameras: &self.cameras },
            people: later.as_ref().unwrap_or(&self.people),
            verdicts: &self.health,
            pictures: &self.pictures,
            packets: method.packets(),
            utc_s: self.utc_s,
            left_out: self.left_out,
        };
        outputs.iter_mut().try_for_each(|output| output.put(&followed))
    }

    /// Memory of the moment's pictures, bytes.
    fn bytes(&self) -> usize {
        let pictures = self.pictures.iter().flat_map(|p| [&p.pinhole, &p.filmed]);
        pictures.flatten().map(|picture| picture.as_raw().len()).sum()
    }
}

/// Buffer of held moments, the oldest first.
pub(super) struct LagBuffer {
    lag_s: f64,
    /// Most memory for all held pictures, bytes; when it is exceeded, the oldest moment leaves early.
    most_bytes: usize,
    bytes: usize,
    moments: VecDeque<HeldMoment>,
    has_warned: bool,
}

impl LagBuffer {
    /// Buffer that holds each moment for `lag_s` seconds.
    pub(super) fn new(lag_s: f64, most_bytes: usize) -> Self {
        Self { lag_s, most_bytes, bytes: 0, moments: VecDeque::new(), has_warned: false }
    }

    pub(super) fn push(&mut self, moment: HeldMoment) {
        self.bytes += moment.bytes();
        self.moments.push_back(moment);
    }

    /// Removes the oldest moment if it has been held long enough at `now_s`, or the pictures take too much memory.
    pub(super) fn pop_due(&mut self, now_s: f64) -> Option<HeldMoment> {
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

    /// Removes the oldest moment.
    pub(super) fn pop(&mut self) -> Option<HeldMoment> {
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

    /// Numbers of held moments after each of 40 of 24 + 18 bytes, `step_s` apart.
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
                buffer.push(HeldMoment {
                    frame,
                    time_s,
                    utc_s: None,
                    left_out: LeftOut::default(),
                    cameras,
                    pictures: vec![pictures],
                    health,
                    people,
                });
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
        // 0.1 has no exact binary representation: a third tenth may exceed three tenths.
        assert_eq!(held(0.1, 0.3, 1000), most(3));
        assert_eq!(held(1.0 / 60.0, 0.4, 42 * 30), most(24));
        assert_eq!(held(0.01, 10.0, 42 * 17), most(17));
        assert_eq!(held(0.01, 10.0, 42 * 17 - 1), most(16));
    }
}
