//! V(S): from pixel counts to a likelihood, in the named ways.

use serde::{Deserialize, Serialize};

/// What one camera's masks have in common. Pixels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Foreground (`Bg`).
    pub foreground: i64,
    /// Some body is in front of the static scene (`Sm`).
    pub simulated: i64,
    /// Both (`Bg ∩ Sm`).
    pub both: i64,
}

impl Counts {
    /// `|Bg ∩ Sm| / |Bg ∪ Sm|`; nothing seen and nothing expected is agreement, 1.
    pub fn overlap(&self) -> f64 {
        let union = self.foreground + self.simulated - self.both;
        if union == 0 { 1.0 } else { self.both as f64 / union as f64 }
    }
}

/// How the counts of all cameras become a likelihood.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", tag = "name")]
pub enum Rule {
    /// As published (equation 7): the mean over cameras of the overlap ratio, to a power. The published power is 1, which
    /// hardly discriminates: a wrong position still scores 0.5 where the right one scores 0.7.
    Overlap {
        /// The power.
        exponent: f64,
    },
    /// Every pixel is foreground with probability `detection` where a body is expected and `false_alarm` elsewhere.
    ///
    /// Neighbouring pixels fail together, so a silhouette is worth far fewer independent pixels than it has: counts are
    /// scaled so that a whole silhouette of typical size in that camera weighs `independent_pixels`. A camera that sees
    /// people small then counts as much as one that sees them large.
    Bernoulli {
        /// Probability that a pixel of a person is foreground.
        detection: f64,
        /// Probability that any other pixel is.
        false_alarm: f64,
        /// What a typical silhouette is worth in independent pixels.
        independent_pixels: f64,
    },
}

impl Rule {
    /// `log V(S)`, up to a constant that does not depend on the state.
    ///
    /// Each camera comes with its typical silhouette, in pixels. Without any camera nothing is known: 0.
    pub fn log_likelihood(&self, cameras: impl Iterator<Item = (Counts, f64)>) -> f64 {
        match *self {
            Self::Overlap { exponent } => {
                /// What complete disagreement of all cameras is worth; its logarithm has to stay a number.
                const LEAST: f64 = 1e-6;
                let (sum, n) = cameras.fold((0.0, 0), |(sum, n), (c, _)| (sum + c.overlap(), n + 1));
                if n == 0 { 0.0 } else { exponent * (sum / f64::from(n)).max(LEAST).ln() }
            }
            Self::Bernoulli { detection, false_alarm, independent_pixels } => {
                let found = (detection / false_alarm).ln();
                let missed = ((1.0 - detection) / (1.0 - false_alarm)).ln();
                cameras
                    .map(|(c, typical_px)| {
                        let nats = c.both as f64 * found + (c.simulated - c.both) as f64 * missed;
                        nats * independent_pixels / typical_px
                    })
                    .sum()
            }
        }
    }

    /// What explaining `part` of a typical silhouette in one camera is worth, in nats.
    pub fn worth_of(&self, part: f64) -> f64 {
        match *self {
            // Beside the other half of the union.
            Self::Overlap { exponent } => exponent * part,
            Self::Bernoulli { detection, false_alarm, independent_pixels } => {
                part * independent_pixels * (detection / false_alarm).ln()
            }
        }
    }

    /// Why this rule cannot be used, if it cannot.
    pub fn defect(&self) -> Option<String> {
        match *self {
            Self::Overlap { exponent } => (!(exponent > 0.0 && exponent.is_finite()))
                .then(|| "the exponent has to be positive".to_owned()),
            Self::Bernoulli { detection, false_alarm, independent_pixels } => {
                let ordered = 0.0 < false_alarm && false_alarm < detection && detection < 1.0;
                if !ordered {
                    return Some("needs 0 < false_alarm < detection < 1".to_owned());
                }
                (!(independent_pixels > 0.0 && independent_pixels.is_finite()))
                    .then(|| "independent_pixels has to be positive".to_owned())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn overlap_is_the_ratio_of_equation_7_and_nothing_against_nothing_agrees() {
        assert_relative_eq!(Counts { foreground: 30, simulated: 20, both: 10 }.overlap(), 0.25);
        assert_relative_eq!(Counts::default().overlap(), 1.0);
        let rule = Rule::Overlap { exponent: 1.0 };
        let cameras = [Counts { foreground: 30, simulated: 20, both: 10 }, Counts::default()];
        let v = rule.log_likelihood(cameras.into_iter().map(|c| (c, 1.0))).exp();
        assert_relative_eq!(v, 0.625, epsilon = 1e-12);
        assert_relative_eq!(rule.log_likelihood(std::iter::empty()), 0.0);
    }

    #[test]
    fn bernoulli_is_the_sum_over_pixels() {
        // 100 pixels, drawn out: 5 foreground under a body, 3 background under it, 2 stray, 90 empty.
        let (d, f) = (0.8_f64, 0.05_f64);
        let with = 5.0 * d.ln() + 3.0 * (1.0 - d).ln() + 2.0 * f.ln() + 90.0 * (1.0 - f).ln();
        let without = 7.0 * f.ln() + 93.0 * (1.0 - f).ln();
        let rule = Rule::Bernoulli { detection: d, false_alarm: f, independent_pixels: 8.0 };
        let counts = Counts { foreground: 7, simulated: 8, both: 5 };
        assert_relative_eq!(rule.log_likelihood([(counts, 8.0)].into_iter()), with - without, epsilon = 1e-9);
    }
}
