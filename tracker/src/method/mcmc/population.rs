//! Heights and widths of the people who are tracked, as a detector's boxes show them: how surely sizes tell who is who.
//!
//! People differ by several centimetres, but the boxes may not show it: some detectors, and the boxes of some recordings, make
//! everybody equally tall. Differences of averages are noise then, which the prior of all people would take for evidence. The mean
//! and the variance between people are therefore learnt from the tracks, with the prior as one person more:
//!
//! ```text
//! variance = ( σ² + Σ g² ((a − mean)² − v) ) / ( 1 + Σ g² )        g = σ² / (σ² + v)
//! ```
//!
//! where `a` is the average of a track, `v` its variance, and `σ` the prior's standard deviation: the method of moments of
//! R. DerSimonian, N. Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7, 1986, with the weights of the prior.

use std::collections::{BTreeMap, VecDeque};

use super::learnt_length::Length;
use super::options::{McmcOptions, Spread};
use super::person::Key;
use super::smoother::LaggedMoment;
use super::traits::LearntSize;

/// Number of people that the prior counts as.
const PRIOR_PEOPLE: f64 = 1.0;
/// Least standard deviation between people, metres.
const LEAST_SIGMA_M: f64 = 0.002;

/// Sizes of people, as boxes show them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Population {
    /// Heights.
    pub(super) height: Spread,
    /// Half of the widths.
    pub(super) radius: Spread,
}

impl Population {
    /// Sizes of all people.
    pub(super) fn prior(options: &McmcOptions) -> Self {
        Self { height: options.height, radius: options.radius }
    }

    /// Sizes of the people whose tracks are in these moments.
    pub(super) fn of(moments: &VecDeque<LaggedMoment>, options: &McmcOptions) -> Self {
        let mut tracks: BTreeMap<Key, LearntSize> = BTreeMap::new();
        for trace in moments.iter().flat_map(|moment| &moment.people) {
            tracks.entry(trace.key).or_default().add(&trace.shown);
        }
        let of = |length: Length, prior: &Spread| {
            learnt(prior, tracks.values().filter_map(move |size| size.average(length)))
        };
        Self { height: of(Length::Height, &options.height), radius: of(Length::Radius, &options.radius) }
    }
}

/// Mean and standard deviation between people with these averages, each with its own standard deviation.
fn learnt(prior: &Spread, averages: impl Iterator<Item = Spread> + Clone) -> Spread {
    let between = prior.sigma_m.powi(2);
    let weight = |average: &Spread| between / (between + average.sigma_m.powi(2));
    let (mut count, mut sum) = (PRIOR_PEOPLE, PRIOR_PEOPLE * prior.mean_m);
    for average in averages.clone() {
        count += weight(&average);
        sum += weight(&average) * average.mean_m;
    }
    let mean_m = sum / count;
    let (mut count, mut squared) = (PRIOR_PEOPLE, PRIOR_PEOPLE * between);
    for average in averages {
        let counted = weight(&average).powi(2);
        count += counted;
        squared += counted * ((average.mean_m - mean_m).powi(2) - average.sigma_m.powi(2));
    }
    Spread { mean_m, sigma_m: (squared / count).max(LEAST_SIGMA_M.powi(2)).sqrt() }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    const PRIOR: Spread = Spread { mean_m: 1.7, sigma_m: 0.1 };

    /// Averages of people whose heights have this spread, each with an error of its own of 1 to 4 cm.
    fn averages(people: usize, heights: &Spread, rng: &mut Pcg64Mcg) -> Vec<Spread> {
        let mut of_one = || {
            let sigma_m = rng.random_range(0.01..0.04);
            let normal = |rng: &mut Pcg64Mcg| rng.sample::<f64, _>(StandardNormal);
            let height_m = heights.mean_m + heights.sigma_m * normal(rng);
            Spread { mean_m: height_m + sigma_m * normal(rng), sigma_m }
        };
        (0..people).map(|_| of_one()).collect()
    }

    #[test]
    fn the_spread_between_people_is_learnt_without_the_errors_of_their_averages() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        for sigma_m in [0.03, 0.07, 0.12] {
            let heights = Spread { mean_m: 1.62, sigma_m };
            let found: Vec<Spread> =
                (0..50).map(|_| learnt(&PRIOR, averages(40, &heights, &mut rng).into_iter())).collect();
            let mean = |of: fn(&Spread) -> f64| found.iter().map(of).sum::<f64>() / 50.0;
            assert!((mean(|spread| spread.mean_m) - 1.62).abs() < 0.01);
            // The prior is one of 41.
            let expected_m2 = (40.0 * sigma_m.powi(2) + PRIOR.sigma_m.powi(2)) / 41.0;
            let ratio = mean(|spread| spread.sigma_m.powi(2)) / expected_m2;
            assert!((0.85..1.15).contains(&ratio), "{sigma_m}: {ratio}");
        }
    }

    #[test]
    fn people_whom_boxes_make_equally_tall_have_hardly_any_spread() {
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        let equal = Spread { mean_m: 1.8, sigma_m: 0.0 };
        for people in [0, 1, 3, 24, 200] {
            let found = learnt(&PRIOR, averages(people, &equal, &mut rng).into_iter());
            let of_prior = PRIOR.sigma_m / (1.0 + people as f64).sqrt();
            assert!(found.sigma_m >= LEAST_SIGMA_M && found.sigma_m < 1.3 * of_prior, "{people}: {found:?}");
        }
        assert_eq!(learnt(&PRIOR, std::iter::empty()), PRIOR, "nobody is seen");
    }
}
