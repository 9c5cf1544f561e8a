//! Height or radius of a person, averaged over all moments in which a detector's boxes measured it.

use super::options::Spread;

/// Length of a person's body that is averaged over moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Length {
    /// Height of a walking person.
    Height,
    /// Half of the width that the cameras see.
    Radius,
}

impl Length {
    /// Standard deviation of the length shown by one moment, beyond that of the boxes, metres: gait, posture and the side
    /// that is seen.
    fn pose_sigma_m(self) -> f64 {
        match self {
            Self::Height | Self::Radius => 0.02,
        }
    }

    /// Standard deviation of an average over many moments, metres: the cameras' errors last, and so does the side that a
    /// walking person shows.
    fn lasting_sigma_m(self) -> f64 {
        match self {
            Self::Height => 0.007,
            Self::Radius => 0.01,
        }
    }
}

/// Weighted sum of measured lengths.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct LearntLength {
    /// Sum of the weights, 1/m².
    weight: f64,
    /// Sum of the weighted lengths, 1/m.
    sum: f64,
}

impl LearntLength {
    /// Adds the length measured by one moment.
    pub(super) fn add(&mut self, length: Length, seen: &Spread) {
        let weight = 1.0 / (seen.sigma_m.powi(2) + length.pose_sigma_m().powi(2));
        self.weight += weight;
        self.sum += weight * seen.mean_m;
    }

    /// Sum over the moments of both.
    pub(super) fn with(&self, other: &Self) -> Self {
        Self { weight: self.weight + other.weight, sum: self.sum + other.sum }
    }

    /// Sum over the moments that are not in `part`.
    pub(super) fn without(&self, part: &Self) -> Self {
        let weight = self.weight - part.weight;
        // The difference of two equal sums is rounding, no measurement.
        if weight <= 1e-9 * self.weight { Self::default() } else { Self { weight, sum: self.sum - part.sum } }
    }

    /// The same average, as certain as lengths of another time can be compared with it: both have the lasting error.
    pub(super) fn of_another_time(&self, length: Length) -> Self {
        let share = 1.0 / (1.0 + self.weight * 2.0 * length.lasting_sigma_m().powi(2));
        Self { weight: share * self.weight, sum: share * self.sum }
    }

    /// Average length, with its standard deviation; `None` before the first measurement.
    pub(super) fn average(&self, length: Length) -> Option<Spread> {
        let sigma_m = || (1.0 / self.weight + length.lasting_sigma_m().powi(2)).sqrt();
        (self.weight > 0.0).then(|| Spread { mean_m: self.sum / self.weight, sigma_m: sigma_m() })
    }

    /// Log density of all lengths of the sum, of one person whose length has this prior, nats, up to the part that each length
    /// has by itself.
    pub(super) fn log_marginal(&self, prior: &Spread) -> f64 {
        let prior_weight = prior.sigma_m.powi(-2);
        let (weight, beyond) = (self.weight + prior_weight, self.sum - self.weight * prior.mean_m);
        0.5 * (beyond.powi(2) / weight - (weight / prior_weight).ln())
    }

    /// Log density that these are lengths of the person of whom `before` was learnt; `prior`: lengths of the people who are tracked.
    pub(super) fn log_density(&self, length: Length, before: &Self, prior: &Spread) -> f64 {
        let Some(seen) = self.average(length) else { return 0.0 };
        let expected = before.average(length).map_or(*prior, |learnt| {
            let weight = learnt.sigma_m.powi(-2) + prior.sigma_m.powi(-2);
            let sum = learnt.mean_m * learnt.sigma_m.powi(-2) + prior.mean_m * prior.sigma_m.powi(-2);
            Spread { mean_m: sum / weight, sigma_m: weight.powf(-0.5) }
        });
        Spread { sigma_m: expected.sigma_m.hypot(seen.sigma_m), ..expected }.log_density(seen.mean_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const PRIOR: Spread = Spread { mean_m: 1.7, sigma_m: 0.1 };

    fn of(heights_m: &[f64]) -> LearntLength {
        let mut learnt = LearntLength::default();
        for mean_m in heights_m {
            learnt.add(Length::Height, &Spread { mean_m: *mean_m, sigma_m: 0.03 });
        }
        learnt
    }

    #[test]
    fn a_part_can_be_taken_out_of_a_sum() {
        let (before, since) = (of(&[1.8, 1.82, 1.79]), of(&[1.6, 1.61]));
        let left = before.with(&since).without(&since);
        assert_relative_eq!(left.weight, before.weight, max_relative = 1e-9);
        assert_relative_eq!(left.sum, before.sum, max_relative = 1e-9);
        assert_eq!(since.without(&since), LearntLength::default());
    }

    /// Integral over the length by the midpoint rule.
    #[test]
    fn the_marginal_density_is_the_integral_over_the_length() {
        let nats = |heights_m: &[f64]| {
            let weight = (0.03_f64.powi(2) + Length::Height.pose_sigma_m().powi(2)).recip();
            let density = |length_m: f64| {
                let seen: f64 = heights_m
                    .iter()
                    .map(|h| -0.5 * weight * ((h - length_m).powi(2) - (h - PRIOR.mean_m).powi(2)))
                    .sum();
                (seen + PRIOR.log_density(length_m)).exp()
            };
            let step_m = 1e-4;
            let lengths = (0..20_000).map(|i| PRIOR.mean_m - 1.0 + (f64::from(i) + 0.5) * step_m);
            (lengths.map(density).sum::<f64>() * step_m).ln()
        };
        for heights_m in [&[1.75, 1.72, 1.80][..], &[1.5], &[1.7; 30], &[]] {
            assert_relative_eq!(of(heights_m).log_marginal(&PRIOR), nats(heights_m), epsilon = 1e-6);
        }
    }

    /// The difference of two averages of the same person has both their variances, and twice that of what lasts.
    #[test]
    fn an_average_is_compared_with_another_time_as_exactly_as_what_lasts_allows() {
        let lasting = 2.0 * Length::Height.lasting_sigma_m().powi(2);
        for moments in [1, 40, 4000] {
            let learnt = of(&vec![1.75; moments]);
            let known = learnt.of_another_time(Length::Height);
            assert_relative_eq!(1.0 / known.weight, 1.0 / learnt.weight + lasting, max_relative = 1e-9);
            assert_relative_eq!(known.sum / known.weight, 1.75, max_relative = 1e-9);
        }
        assert_eq!(LearntLength::default().of_another_time(Length::Height), LearntLength::default());
    }

    #[test]
    fn more_moments_tell_people_apart_better() {
        let own = of(&[1.75; 40]);
        let nats = |moments: usize| {
            let seen = of(&vec![1.75; moments]);
            seen.log_density(Length::Height, &own, &PRIOR)
                - seen.log_density(Length::Height, &of(&[1.69; 40]), &PRIOR)
        };
        assert!(nats(1) > 0.5 && nats(10) > 2.0 * nats(1), "{} {}", nats(1), nats(10));
        assert_relative_eq!(LearntLength::default().log_density(Length::Height, &own, &PRIOR), 0.0);
    }
}
