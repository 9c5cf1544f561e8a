//! Phases in which people may appear anywhere: at the start of a stream, and again after an outage of all cameras.
//!
//! While no camera has a usable mask, tracks are only predicted. People walk a metre a second, so after a few seconds
//! another person may stand at a track's predicted place, and after [`FORGOTTEN_AFTER_S`] the predictions cannot
//! distinguish people: the tracks end.

/// Time without a usable mask of any camera after which people may have come in unseen, seconds.
pub(super) const OUTAGE_S: f64 = 2.0;
/// Time without a usable mask of any camera after which all tracks end, seconds.
pub(super) const FORGOTTEN_AFTER_S: f64 = 30.0;

/// Times of masks and outages, which determine whether people may appear anywhere, seconds.
#[derive(Debug, Clone, Default)]
pub(super) struct Settling {
    /// Time of the latest moment with a usable mask.
    seen_s: Option<f64>,
    /// Time of the first moment with a usable mask since the start, or since the latest outage.
    since_s: Option<f64>,
    had_outage: bool,
}

impl Settling {
    /// Records a moment. Returns for how long no camera had a usable mask before it, seconds.
    pub(super) fn observe(&mut self, time_s: f64, sees_anything: bool) -> f64 {
        let unseen_s = self.seen_s.map_or(0.0, |seen_s| time_s - seen_s);
        if sees_anything {
            if self.seen_s.is_some() && unseen_s >= OUTAGE_S {
                self.had_outage = true;
                self.since_s = None;
            }
            self.since_s.get_or_insert(time_s);
            self.seen_s = Some(time_s);
        }
        unseen_s
    }

    /// Whether people may appear anywhere in this moment: within `settling_s` seconds of the start or of the end of
    /// an outage.
    pub(super) fn is_on(&self, time_s: f64, settling_s: f64) -> bool {
        settling_s > 0.0 && self.since_s.is_none_or(|since_s| time_s - since_s < settling_s)
    }

    /// Time of the first moment with a usable mask after the latest outage, seconds; `None` without an outage.
    pub(super) fn outage_end_s(&self) -> Option<f64> {
        self.since_s.filter(|_| self.had_outage)
    }

    /// Whether an outage has ended since the start of the stream.
    pub(super) fn had_outage(&self) -> bool {
        self.had_outage
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Phases of these moments, each given as its time and whether a camera has a mask: whether people may appear
    /// anywhere.
    fn phases(moments: &[(f64, bool)]) -> Vec<bool> {
        let mut settling = Settling::default();
        let phase = |(time_s, sees): &(f64, bool)| {
            settling.observe(*time_s, *sees);
            settling.is_on(*time_s, 0.5)
        };
        moments.iter().map(phase).collect()
    }

    #[test]
    fn settling_starts_with_the_first_mask_and_after_each_outage() {
        let moments = [(0.0, false), (9.0, true), (9.4, true), (9.6, true), (10.0, false), (11.5, true)];
        assert_eq!(phases(&moments), [true, true, true, false, false, false], "1.9 s are no outage");
        let away = [(0.0, true), (0.6, true), (2.0, false), (2.7, true), (3.1, true), (3.3, true)];
        assert_eq!(phases(&away), [true, false, false, true, true, false]);
        // No moments arrived during the outage.
        assert_eq!(
            phases(&[(0.0, true), (0.6, true), (600.0, true), (600.6, true)]),
            [true, false, true, false]
        );
    }
}
