//! Offset between this station's clock and a peer's, estimated from the times of sending and of arrival.

use std::collections::VecDeque;

/// Time over which the smallest difference is searched, seconds.
const WINDOW_S: f64 = 30.0;
/// Length of the parts of the window, seconds: one value is kept for each.
const PART_S: f64 = 0.5;
/// Number of latest parts that show whether a clock was set.
const LATEST: usize = 6;
/// Smallest step of a clock that is recognised, seconds; less may be a network that has become slower.
const STEP_S: f64 = 0.25;
/// Offsets below this are not corrected, seconds: the delay of a packet is of this size.
const LEAST_S: f64 = 0.005;

/// Offset estimator of a peer's clock.
///
/// A packet arrives after it was sent, so the difference of arrival (own clock) and sending (peer's clock) is the
/// offset plus the packet's delay; the smallest difference of the last 30 s is nearly the offset, whatever the jitter.
/// A peer's clock that is set ahead (or an own one that is set back) shows at once; the opposite shows when all packets
/// of 3 s agree.
#[derive(Debug, Clone, Default)]
pub struct PeerClock {
    /// Index of a part of the window, and the smallest difference in it, seconds; the oldest first.
    parts: VecDeque<(i64, f64)>,
}

impl PeerClock {
    /// Adds a packet that was sent at `sent_s` on the peer's clock and arrived at `arrived_s` on the own.
    pub fn note(&mut self, sent_s: f64, arrived_s: f64) {
        let part = (arrived_s / PART_S).floor() as i64;
        let difference_s = arrived_s - sent_s;
        match self.parts.back_mut() {
            Some((latest, smallest_s)) if *latest == part => *smallest_s = smallest_s.min(difference_s),
            Some((latest, _)) if *latest > part => {
                // The own clock was set back, so earlier parts are meaningless.
                self.parts.clear();
                self.parts.push_back((part, difference_s));
            }
            _ => self.parts.push_back((part, difference_s)),
        }
        let oldest = part - (WINDOW_S / PART_S) as i64;
        while self.parts.front().is_some_and(|(first, _)| *first <= oldest) {
            self.parts.pop_front();
        }
        let before = self.parts.len().saturating_sub(LATEST);
        let smallest_s = |parts: &mut dyn Iterator<Item = &(i64, f64)>| {
            parts.map(|(_, difference_s)| *difference_s).fold(f64::INFINITY, f64::min)
        };
        let earlier_s = smallest_s(&mut self.parts.iter().take(before));
        let latest_s = smallest_s(&mut self.parts.iter().skip(before));
        if before > 0 && latest_s - earlier_s > STEP_S {
            self.parts.drain(..before);
        }
    }

    /// Seconds to add to a time of the peer to get the own clock; negative where the peer's clock is ahead. 0 before
    /// the first packet.
    pub fn offset_s(&self) -> f64 {
        self.parts.iter().map(|(_, difference_s)| *difference_s).reduce(f64::min).unwrap_or(0.0)
    }

    /// Converts a time of the peer's clock to the own. Differences below 5 ms are not corrected.
    pub fn to_own_s(&self, time_s: f64) -> f64 {
        let offset_s = self.offset_s();
        if offset_s.abs() < LEAST_S { time_s } else { time_s + offset_s }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Adds packets, 12 a second, with the peer's clock ahead by `ahead_s`, and the delay `way_s` of each.
    fn send(
        clock: &mut PeerClock,
        from_s: f64,
        packets: u32,
        ahead_s: f64,
        mut way_s: impl FnMut(u32) -> f64,
    ) {
        for i in 0..packets {
            let at_s = from_s + f64::from(i) / 12.0;
            clock.note(at_s + ahead_s, at_s + way_s(i));
        }
    }

    proptest! {
        #[test]
        fn the_offset_is_found_through_jitter(
            ahead_s in -4000.0..4000.0, ways in proptest::collection::vec(0.0..0.4, 120), quick in 0_usize..120,
        ) {
            let mut clock = PeerClock::default();
            let way_s = |i: u32| if i as usize == quick { 0.0002 } else { 0.0002 + ways[i as usize] };
            send(&mut clock, 1.7e9, 120, ahead_s, way_s);
            // The fast packet may be forgotten where all after it were slower by more than a step.
            let slowest_of_3_s = 0.25;
            let error_s = clock.offset_s() + ahead_s;
            prop_assert!((0.0..slowest_of_3_s).contains(&error_s), "{error_s}");
        }

        #[test]
        fn memory_is_bounded(times in proptest::collection::vec((-1e9..1e9, -1e9..1e9), 0..500)) {
            let mut clock = PeerClock::default();
            for (sent_s, arrived_s) in times {
                clock.note(sent_s, arrived_s);
                prop_assert!(clock.parts.len() <= 60 && clock.offset_s().is_finite());
            }
        }
    }

    #[test]
    fn small_offsets_are_left_and_large_ones_corrected() {
        for (ahead_s, moved_s) in [(0.004, 0.0), (-0.004, 0.0), (0.5, -0.5), (-0.5, 0.5), (3600.0, -3600.0)] {
            let mut clock = PeerClock::default();
            send(&mut clock, 1000.0, 30, ahead_s, |_| 0.0);
            assert!((clock.to_own_s(5.0) - 5.0 - moved_s).abs() < 1e-6, "{ahead_s}");
        }
    }

    #[test]
    fn a_clock_that_is_set_shows_within_seconds() {
        for (before_s, after_s, within_s) in [(0.0, 0.5, 0.1), (0.5, 0.0, 3.5), (3600.0, 0.0, 3.5)] {
            let mut clock = PeerClock::default();
            send(&mut clock, 1000.0, 240, before_s, |_| 0.001);
            send(&mut clock, 1020.0, (within_s * 12.0) as u32 + 1, after_s, |_| 0.001);
            assert!((clock.offset_s() + after_s).abs() < 0.01, "{before_s} {after_s} {}", clock.offset_s());
        }
    }

    #[test]
    fn a_slow_second_changes_nothing() {
        let mut clock = PeerClock::default();
        send(&mut clock, 1000.0, 120, 0.2, |_| 0.001);
        send(&mut clock, 1010.0, 12, 0.2, |_| 0.9);
        assert!((clock.offset_s() + 0.199).abs() < 1e-6);
    }

    #[test]
    fn drift_is_followed_over_the_window() {
        let mut clock = PeerClock::default();
        for i in 0..12 * 600 {
            let at_s = f64::from(i) / 12.0;
            // 100 ms in ten minutes, backwards: the harder way.
            clock.note(at_s - at_s / 6000.0, at_s + 0.001);
        }
        assert!((clock.offset_s() - 0.101).abs() < 0.006, "{}", clock.offset_s());
    }
}
