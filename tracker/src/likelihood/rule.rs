//! V(S): rules that turn pixel counts into a likelihood.

use serde::{Deserialize, Serialize};

use crate::silhouette::Shape;

/// Pixel counts of one camera's masks.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of foreground pixels (`Bg`).
    pub foreground: i64,
    /// Number of pixels at which some body is in front of the static scene (`Sm`).
    pub simulated: i64,
    /// Number of pixels that are both (`Bg ∩ Sm`).
    pub both: i64,
}

impl Counts {
    /// `|Bg ∩ Sm| / |Bg ∪ Sm|`; 1 when nothing is seen and nothing is expected.
    pub fn overlap(&self) -> f64 {
        let union = self.foreground + self.simulated - self.both;
        if union == 0 { 1.0 } else { self.both as f64 / union as f64 }
    }
}

/// Rule by which the counts of all cameras become a likelihood.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "name")]
pub enum LikelihoodRule {
    /// The published rule (equation 7): the mean over cameras of the overlap ratio, to a power. The published power is
    /// 1, which hardly discriminates: a wrong position still scores 0.5 where the right one scores 0.7.
    Overlap {
        /// Power of the mean overlap.
        exponent: f64,
    },
    /// Each pixel is foreground with a probability of its own: that of the innermost shape of any body that is expected
    /// to be seen there ([`Shape::CORE`], [`Shape::LIMBS`], [`Shape::REACH`]), `outside` elsewhere.
    ///
    /// Errors of neighbouring pixels are correlated, so a silhouette holds far fewer independent pixels than pixels:
    /// counts are scaled so that a whole core of typical size in that camera weighs `independent_pixels`. A camera that
    /// sees people small then counts as much as one that sees them large.
    Bernoulli {
        /// Probability that a pixel of a person's core is foreground.
        core: f64,
        /// Probability that a pixel of the limbs' region around the core is foreground.
        limbs: f64,
        /// Probability that a pixel farther out, within the reach of limbs, is foreground.
        reach: f64,
        /// Probability that any other pixel is foreground.
        outside: f64,
        /// Effective number of independent pixels of a typical core.
        independent_pixels: f64,
    },
}

impl LikelihoodRule {
    /// Shapes that this rule compares with the masks, the innermost first.
    pub fn shapes(&self) -> &'static [Shape] {
        match self {
            Self::Overlap { .. } => &[Shape::BODY],
            Self::Bernoulli { .. } => &[Shape::CORE, Shape::LIMBS, Shape::REACH],
        }
    }

    /// Prepares the rule: takes the logarithms once, since it is evaluated thousands of times a frame.
    pub fn prepared(&self) -> PreparedLikelihood {
        match *self {
            Self::Overlap { exponent } => PreparedLikelihood::Overlap { exponent },
            Self::Bernoulli { core, limbs, reach, outside, independent_pixels } => {
                PreparedLikelihood::Bernoulli {
                    // A pixel of the core is in the others, too: each layer counts the difference to the one around it.
                    weights: [odds(core, limbs), odds(limbs, reach), odds(reach, outside)]
                        .map(|o| o.map(|nats| nats * independent_pixels)),
                }
            }
        }
    }

    /// Log-likelihood gain, in nats, from explaining the share `part` of a typical silhouette in one camera.
    pub fn worth_of(&self, part: f64) -> f64 {
        match *self {
            // Beside the other half of the union.
            Self::Overlap { exponent } => exponent * part,
            Self::Bernoulli { core, outside, independent_pixels, .. } => {
                part * independent_pixels * odds(core, outside)[0]
            }
        }
    }

    /// Reason why this rule cannot be used; `None` if it can.
    pub fn defect(&self) -> Option<String> {
        match *self {
            Self::Overlap { exponent } => (!(exponent > 0.0 && exponent.is_finite()))
                .then(|| "the exponent has to be positive".to_owned()),
            Self::Bernoulli { core, limbs, reach, outside, independent_pixels } => {
                if ![0.0, outside, reach, limbs, core, 1.0].is_sorted_by(|less, more| less < more) {
                    return Some("needs 0 < outside < reach < limbs < core < 1".to_owned());
                }
                (!(independent_pixels > 0.0 && independent_pixels.is_finite()))
                    .then(|| "independent_pixels has to be positive".to_owned())
            }
        }
    }
}

/// A [`LikelihoodRule`] prepared for evaluation ([`LikelihoodRule::prepared`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PreparedLikelihood {
    /// [`LikelihoodRule::Overlap`].
    Overlap {
        /// Power of the mean overlap.
        exponent: f64,
    },
    /// [`LikelihoodRule::Bernoulli`].
    Bernoulli {
        /// For each shape, the log-likelihood that a typical core's foreground and background add to the shape around
        /// it, nats.
        weights: [[f64; 2]; 3],
    },
}

impl PreparedLikelihood {
    /// `log V(S)`, up to a constant that does not depend on the state.
    ///
    /// Takes the counts of each layer with the index of its shape in [`LikelihoodRule::shapes`] and the pixels of a typical
    /// silhouette of the innermost shape in its camera. Without any camera the result is 0.
    pub fn log_likelihood(&self, layers: impl Iterator<Item = (usize, Counts, f64)>) -> f64 {
        match self {
            Self::Overlap { exponent } => {
                /// Value of complete disagreement of all cameras; its logarithm has to stay finite.
                const LEAST: f64 = 1e-6;
                let (sum, n) = layers.fold((0.0, 0), |(sum, n), (_, c, _)| (sum + c.overlap(), n + 1));
                if n == 0 { 0.0 } else { exponent * (sum / f64::from(n)).max(LEAST).ln() }
            }
            Self::Bernoulli { weights } => layers
                .map(|(shape, c, typical_px)| {
                    let [found, missed] = weights[shape];
                    (c.both as f64 * found + (c.simulated - c.both) as f64 * missed) / typical_px
                })
                .sum(),
        }
    }
}

/// Log odds, in nats, of a foreground and of a background pixel whose probability of foreground is `here` instead of
/// `there`.
fn odds(here: f64, there: f64) -> [f64; 2] {
    [(here / there).ln(), ((1.0 - here) / (1.0 - there)).ln()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn overlap_is_the_ratio_of_equation_7_and_nothing_against_nothing_agrees() {
        assert_relative_eq!(Counts { foreground: 30, simulated: 20, both: 10 }.overlap(), 0.25);
        assert_relative_eq!(Counts::default().overlap(), 1.0);
        let rule = LikelihoodRule::Overlap { exponent: 1.0 };
        let cameras = [Counts { foreground: 30, simulated: 20, both: 10 }, Counts::default()];
        let rule = rule.prepared();
        let v = rule.log_likelihood(cameras.into_iter().map(|c| (0, c, 1.0))).exp();
        assert_relative_eq!(v, 0.625, epsilon = 1e-12);
        assert_relative_eq!(rule.log_likelihood(std::iter::empty()), 0.0);
    }

    /// The counts of a complete match therefore give an upper bound.
    #[test]
    fn explained_foreground_never_lowers_and_missed_foreground_never_raises_the_likelihood() {
        let rules = [
            LikelihoodRule::Overlap { exponent: 3.0 },
            LikelihoodRule::Bernoulli {
                core: 0.8,
                limbs: 0.6,
                reach: 0.3,
                outside: 0.05,
                independent_pixels: 20.0,
            },
        ];
        for rule in rules {
            let shapes = rule.shapes().len();
            let value = |found: i64, missed: i64, shape: usize| {
                let seen = |both: i64, missed: i64| Counts { foreground: 40, simulated: both + missed, both };
                let layers =
                    (0..shapes).map(|s| (s, if s == shape { seen(found, missed) } else { seen(7, 5) }, 30.0));
                rule.prepared().log_likelihood(layers)
            };
            for (shape, found, missed) in [(0, 0, 0), (0, 12, 3), (shapes - 1, 0, 30), (shapes - 1, 39, 1)] {
                assert!(value(found + 1, missed, shape) > value(found, missed, shape));
                assert!(value(found, missed + 1, shape) <= value(found, missed, shape));
            }
        }
    }

    #[test]
    fn bernoulli_is_the_sum_over_pixels() {
        // 100 pixels, drawn out: foreground and background are 5 and 3 in the core, 4 and 2 around it, 3 and 6 around
        // that, and 2 and 75 elsewhere.
        let [core, limbs, reach, outside] = [0.8_f64, 0.6, 0.3, 0.05];
        let nats =
            |p: f64, [foreground, background]: [f64; 2]| foreground * p.ln() + background * (1.0 - p).ln();
        let with = nats(core, [5.0, 3.0])
            + nats(limbs, [4.0, 2.0])
            + nats(reach, [3.0, 6.0])
            + nats(outside, [2.0, 75.0]);
        let without = nats(outside, [14.0, 86.0]);
        let rule = LikelihoodRule::Bernoulli { core, limbs, reach, outside, independent_pixels: 8.0 };
        let within = |simulated: i64, both: i64| Counts { foreground: 14, simulated, both };
        let layers = [within(8, 5), within(14, 9), within(23, 12)];
        let layers = layers.into_iter().enumerate().map(|(shape, counts)| (shape, counts, 8.0));
        let found = rule.prepared().log_likelihood(layers);
        assert_relative_eq!(found, with - without, epsilon = 1e-9);
    }
}
