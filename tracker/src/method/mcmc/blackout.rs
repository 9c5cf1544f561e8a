//! Blackouts: masks from which everybody vanishes at once.
//!
//! People leave through exits; nobody vanishes in the middle of a room. A camera whose mask has no foreground any more,
//! though it saw people far from all exits a moment before, has lost its mask (a failed segmenter, a reset background, a
//! black picture), and says nothing about who is there. Its masks are set aside until foreground returns, for
//! [`LONGEST_S`] at most: what stays invisible for longer was nobody. After an outage of the camera itself people may have
//! left, so that an empty mask is believed.

use super::outage::OUTAGE_S;

/// Longest time for which empty masks are set aside, seconds.
const LONGEST_S: f64 = 5.0;
/// Fraction of the expected pixels below which a mask is empty.
const EMPTY: f64 = 0.05;
/// Least number of expected pixels of the full image.
const LEAST_PX: u32 = 100;

/// State of each camera.
#[derive(Debug, Clone, Default)]
pub(super) struct Blackouts {
    cameras: Vec<Camera>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Camera {
    /// Pixels of the people far from all exits, as the camera last saw them, in pixels of its view.
    expected_px: u32,
    /// Time of the latest mask, empty or not, seconds.
    given_s: f64,
    /// Time of the first empty mask, seconds.
    since_s: Option<f64>,
}

impl Blackouts {
    /// Sets masks aside that lost everybody: one mask a camera, packed, `None` where there is none. `block` is the number
    /// of pixels of the full image along a side of a pixel of each camera's view.
    pub(super) fn set_aside(
        &mut self,
        time_s: f64,
        masks: &mut [Option<Vec<u64>>],
        block: impl Fn(usize) -> u32,
    ) {
        self.cameras.resize(masks.len(), Camera::default());
        for (index, (camera, mask)) in self.cameras.iter_mut().zip(masks).enumerate() {
            let Some(words) = mask else { continue };
            if time_s - std::mem::replace(&mut camera.given_s, time_s) >= OUTAGE_S {
                *camera = Camera { given_s: time_s, ..Camera::default() };
            }
            let px: u32 = words.iter().map(|word| word.count_ones()).sum();
            let expected = camera.expected_px;
            let is_empty =
                expected * block(index).pow(2) >= LEAST_PX && f64::from(px) < EMPTY * f64::from(expected);
            if !is_empty {
                camera.since_s = None;
            } else if time_s - *camera.since_s.get_or_insert(time_s) < LONGEST_S {
                *mask = None;
            }
        }
    }

    /// Records the pixels of the people far from all exits that a camera with a mask sees.
    pub(super) fn expect(&mut self, camera: usize, px: u32) {
        if let Some(camera) = self.cameras.get_mut(camera) {
            camera.expected_px = px;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the mask of one camera is set aside in these moments: times, pixels of the mask, and expected pixels.
    fn set_aside(moments: &[(f64, u32, u32)]) -> Vec<bool> {
        let mut blackouts = Blackouts::default();
        let of_moment = |(time_s, px, expected): &(f64, u32, u32)| {
            let mut masks = [Some(vec![u64::MAX; (*px / 64) as usize])];
            blackouts.set_aside(*time_s, &mut masks, |_| 2);
            if masks[0].is_some() {
                blackouts.expect(0, *expected);
            }
            masks[0].is_none()
        };
        moments.iter().map(of_moment).collect()
    }

    #[test]
    fn a_mask_that_loses_people_is_set_aside_until_foreground_returns_or_five_seconds_pass() {
        let back = [(0.0, 640, 600), (0.1, 0, 600), (2.0, 0, 600), (3.1, 640, 600)];
        assert_eq!(set_aside(&back), [false, true, true, false]);
        let gone = [0.1, 1.9, 3.5, 5.0].map(|time_s| (time_s, 0, 600));
        let after = [(5.2, 0, 0), (6.0, 0, 0)];
        let moments = [&[(0.0, 640, 600)][..], &gone, &after].concat();
        assert_eq!(set_aside(&moments), [false, true, true, true, true, false, false]);
    }

    #[test]
    fn an_empty_mask_after_an_outage_of_the_camera_is_believed() {
        assert_eq!(set_aside(&[(0.0, 640, 600), (2.5, 0, 600)]), [false; 2]);
    }

    #[test]
    fn an_empty_mask_of_an_empty_room_is_taken_as_it_is() {
        assert_eq!(set_aside(&[(0.0, 0, 0), (0.1, 0, 0)]), [false; 2]);
        assert_eq!(set_aside(&[(0.0, 64, 10), (0.1, 0, 0)]), [false; 2], "too few pixels to tell");
    }
}
