//! Colour memory of a station: frequencies of each target's colours (Nakazawa et al., section 3.3, items 1c and 4).

use std::collections::BTreeMap;

use super::super::{Colour, Looks, TargetId};

const HUES: usize = 32;
const SATURATIONS: usize = 4;
/// Number of observations of a target from which the memory evaluates its colours.
const FEWEST: u32 = 10;
/// Maximum number of targets; those not recorded for the longest time are dropped first.
const MOST_TARGETS: usize = 256;

/// Frequencies of the hue and saturation of each of the three representative colours.
#[derive(Debug, Clone, Default)]
struct Frequencies {
    counts: [BTreeMap<u8, u32>; 3],
    total: u32,
    used_s: f64,
}

/// Colour memory: one table of frequencies per target.
#[derive(Debug, Clone, Default)]
pub(super) struct ColourMemory(BTreeMap<TargetId, Frequencies>);

impl ColourMemory {
    /// Adds the measured colours of a target at a time in seconds.
    pub(super) fn record(&mut self, target: TargetId, looks: &Looks, now_s: f64) {
        let frequencies = self.0.entry(target).or_default();
        for (counts, colour) in frequencies.counts.iter_mut().zip(&looks.colours) {
            *counts.entry(bin(colour)).or_default() += 1;
        }
        frequencies.total = frequencies.total.saturating_add(1);
        frequencies.used_s = now_s;
        if self.0.len() > MOST_TARGETS {
            let oldest = self.0.iter().min_by(|a, b| a.1.used_s.total_cmp(&b.1.used_s)).map(|(t, _)| *t);
            oldest.map(|target| self.0.remove(&target));
        }
    }

    /// Targets with enough observations.
    pub(super) fn targets(&self) -> impl Iterator<Item = TargetId> {
        self.0.iter().filter(|(_, f)| f.total >= FEWEST).map(|(target, _)| *target)
    }

    /// `eval_knowledge` of equation (1): +1 when two or three of the colours are frequent in the memory of the target,
    /// 0 when one is or the target has too few observations, -1 when none is. `frequent` is the fraction from which a
    /// colour is frequent.
    pub(super) fn evaluate(&self, target: TargetId, looks: &Looks, frequent: f64) -> f64 {
        let Some(frequencies) = self.0.get(&target).filter(|f| f.total >= FEWEST) else {
            return 0.0;
        };
        let least = frequent * f64::from(frequencies.total);
        let is_frequent = |(counts, colour): (&BTreeMap<u8, u32>, &Colour)| {
            f64::from(counts.get(&bin(colour)).copied().unwrap_or(0)) >= least
        };
        match frequencies.counts.iter().zip(&looks.colours).filter(|pair| is_frequent(*pair)).count() {
            0 => -1.0,
            1 => 0.0,
            _ => 1.0,
        }
    }
}

/// Index of a colour's cell in the table. Grey has no hue.
fn bin(colour: &Colour) -> u8 {
    let saturation = ((colour.saturation * SATURATIONS as f32) as usize).min(SATURATIONS - 1);
    let hue = (colour.hue_deg.rem_euclid(360.0) / 360.0 * HUES as f32) as usize % HUES;
    (if saturation == 0 { 0 } else { saturation * HUES + hue }) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looks(hues_deg: [f32; 3]) -> Looks {
        Looks { colours: hues_deg.map(|hue_deg| Colour { hue_deg, saturation: 0.9, value: 0.5 }) }
    }

    #[test]
    fn two_of_three_frequent_colours_give_plus_one() {
        let mut memory = ColourMemory::default();
        let target = TargetId(1);
        assert!(
            memory.evaluate(target, &looks([10.0, 100.0, 200.0]), 0.04).abs() < 1e-12,
            "nothing is known"
        );
        for _ in 0..20 {
            memory.record(target, &looks([10.0, 100.0, 200.0]), 0.0);
        }
        let evaluate = |hues| memory.evaluate(target, &looks(hues), 0.04) as i32;
        assert_eq!(evaluate([10.0, 100.0, 200.0]), 1);
        assert_eq!(evaluate([10.0, 100.0, 300.0]), 1);
        assert_eq!(evaluate([10.0, 300.0, 300.0]), 0);
        assert_eq!(evaluate([300.0; 3]), -1);
        // A colour counts at its own place on the body only.
        assert_eq!(evaluate([200.0, 10.0, 100.0]), -1);
    }

    #[test]
    fn grey_has_no_hue() {
        let grey = |hue_deg| Colour { hue_deg, saturation: 0.1, value: 0.5 };
        assert_eq!(bin(&grey(10.0)), bin(&grey(200.0)));
        assert_eq!(bin(&Colour { saturation: 1.0, ..grey(359.9) }), 127);
    }

    #[test]
    fn the_memory_is_bounded() {
        let mut memory = ColourMemory::default();
        for i in 0..1000 {
            memory.record(TargetId(i + 1), &looks([0.0; 3]), f64::from(i));
        }
        assert_eq!(memory.0.len(), MOST_TARGETS);
        assert!(memory.0.contains_key(&TargetId(1000)) && !memory.0.contains_key(&TargetId(1)));
    }
}
