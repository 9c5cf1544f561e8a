//! Blackouts: moments from whose masks everybody vanishes at once.
//!
//! People leave through exits; nobody vanishes in the middle of a room from all cameras. Masks without foreground right
//! after they showed people far from all exits are therefore a fault of what makes them (a failed segmenter, a background
//! that was learnt anew), and say nothing about who is there: such moments count as an outage of all cameras. That holds for
//! [`LONGEST_S`] at most: what stays invisible for longer was nobody. An empty mask after an outage is believed, since people
//! may have left meanwhile.

use super::outage::OUTAGE_S;

/// Longest time for which empty masks are set aside, seconds.
const LONGEST_S: f64 = 5.0;
/// Fraction of the expected pixels below which masks are empty.
const EMPTY: f64 = 0.05;
/// Least number of expected pixels of the full images.
const LEAST_PX: u64 = 200;
/// Distance from the exits within which somebody may leave from one moment to the next, metres.
pub(super) const LEAVES_WITHIN_M: f64 = 0.75;

/// Pixels of people in the masks, and since when they are missing.
#[derive(Debug, Clone, Default)]
pub(super) struct Blackout {
    /// Pixels of the full images that people far from all exits filled at the last moment with foreground.
    expected_px: u64,
    /// Time of the last moment with masks, seconds.
    latest_s: f64,
    /// Time of the first empty moment, seconds.
    since_s: Option<f64>,
}

impl Blackout {
    /// Whether a moment with masks is part of a blackout; `foreground_px` of the full images are foreground.
    pub(super) fn observe(&mut self, time_s: f64, foreground_px: u64) -> bool {
        if time_s - std::mem::replace(&mut self.latest_s, time_s) >= OUTAGE_S {
            (self.expected_px, self.since_s) = (0, None);
        }
        let is_empty =
            self.expected_px >= LEAST_PX && (foreground_px as f64) < EMPTY * self.expected_px as f64;
        if !is_empty {
            self.since_s = None;
            return false;
        }
        time_s - *self.since_s.get_or_insert(time_s) < LONGEST_S
    }

    /// Records the pixels of the full images in which the cameras see people far from all exits.
    pub(super) fn expect(&mut self, px: u64) {
        self.expected_px = px;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether each of these moments is part of a blackout: times, foreground, and the pixels expected from then on.
    fn blackouts(moments: &[(f64, u64, u64)]) -> Vec<bool> {
        let mut blackout = Blackout::default();
        let observed = moments.iter().map(|(time_s, foreground_px, expected_px)| {
            let is_on = blackout.observe(*time_s, *foreground_px);
            if !is_on {
                blackout.expect(*expected_px);
            }
            is_on
        });
        observed.collect()
    }

    #[test]
    fn masks_that_lose_everybody_at_once_are_a_blackout_until_foreground_is_back() {
        let lost = [(0.0, 900, 800), (0.1, 10, 800), (0.2, 0, 800), (1.0, 700, 800), (1.1, 0, 800)];
        assert_eq!(blackouts(&lost), [false, true, true, false, true]);
        let outage = [(0.0, 900, 800), (2.5, 0, 800)];
        assert_eq!(blackouts(&outage), [false, false], "people may have left during an outage");
        let some = [(0.0, 900, 800), (0.1, 90, 800)];
        assert_eq!(blackouts(&some), [false, false], "somebody is left");
        let near_an_exit = [(0.0, 900, 0), (0.1, 0, 0)];
        assert_eq!(blackouts(&near_an_exit), [false, false]);
    }

    #[test]
    fn people_who_stay_invisible_are_believed_to_be_gone() {
        let moments: Vec<(f64, u64, u64)> =
            (0..80).map(|i| (0.1 * f64::from(i), if i == 0 { 900 } else { 0 }, 800)).collect();
        let found = blackouts(&moments);
        assert!(found[1..50].iter().all(|is_on| *is_on));
        assert!(found[52..].iter().all(|is_on| !is_on));
    }
}
