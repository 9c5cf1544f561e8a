//! Spread of height and width between the people who are tracked, estimated from a detector's boxes.
//!
//! People differ by several centimetres, but the boxes may not show it: some detectors, and the boxes of some recordings, make
//! everybody equally tall. Averages of two people then differ by noise alone, which the prior's spread would turn into evidence of
//! who is who; and a person of the same size as somebody lost would be that one, though everybody is of that size. Mean and variance
//! are therefore estimated from the tracks of the last seconds, with the prior as one person more: one step of Fisher scoring from
//! the prior to the maximum likelihood (D. Harville, "Maximum likelihood approaches to variance component estimation", JASA 72, 1977),
//!
//! ```text
//! mean = ( m + Σ g a ) / ( 1 + Σ g )        variance = ( σ² + Σ g² ((a − mean)² − v) ) / ( 1 + Σ g² )        g = σ² / (σ² + v)
//! ```
//!
//! where `a` is the average of a track, `v` its variance, and `m` and `σ` the prior's mean and standard deviation. As maximum likelihood
//! has it, the variance of a few people comes out too low, by a third of it for one or two people, by a tenth for ten.

use std::collections::{BTreeMap, VecDeque};

use super::learnt_length::Length;
use super::options::Spread;
use super::person::Key;
use super::posture::Size;
use super::smoother::LaggedMoment;
use super::traits::LearntSize;

/// Number of people that the prior counts as.
const PRIOR_PEOPLE: f64 = 1.0;
/// Least standard deviation between people, metres.
const LEAST_SIGMA_M: f64 = 0.002;

/// Sizes of the people whose tracks are in these moments. Tracks stand for people, not names: names were decided by these very
/// sizes, and their spread would confirm itself. Tracks that exchanged their people make the spread smaller.
pub(super) fn estimated(moments: &VecDeque<LaggedMoment>, prior: &Size) -> Size {
    let mut tracks: BTreeMap<Key, LearntSize> = BTreeMap::new();
    for trace in moments.iter().flat_map(|moment| &moment.people) {
        tracks.entry(trace.key).or_default().add(&trace.shown);
    }
    let of = |length: Length, prior: &Spread| {
        spread_between(prior, tracks.values().filter_map(move |size| size.average(length)))
    };
    Size { radius: of(Length::Radius, &prior.radius), height: of(Length::Height, &prior.height) }
}

/// Mean and standard deviation between people with these averages, each with its own standard deviation.
fn spread_between(prior: &Spread, averages: impl Iterator<Item = Spread> + Clone) -> Spread {
    let prior_m2 = prior.sigma_m.powi(2);
    let weight = |average: &Spread| prior_m2 / (prior_m2 + average.sigma_m.powi(2));
    let (mut weights, mut sum_m) = (PRIOR_PEOPLE, PRIOR_PEOPLE * prior.mean_m);
    for average in averages.clone() {
        weights += weight(&average);
        sum_m += weight(&average) * average.mean_m;
    }
    let mean_m = sum_m / weights;
    let (mut squared_weights, mut sum_m2) = (PRIOR_PEOPLE, PRIOR_PEOPLE * prior_m2);
    for average in averages {
        let squared_weight = weight(&average).powi(2);
        squared_weights += squared_weight;
        sum_m2 += squared_weight * ((average.mean_m - mean_m).powi(2) - average.sigma_m.powi(2));
    }
    Spread { mean_m, sigma_m: (sum_m2 / squared_weights).max(LEAST_SIGMA_M.powi(2)).sqrt() }
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
    fn the_spread_between_people_leaves_out_the_errors_of_their_averages() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        for sigma_m in [0.03, 0.07, 0.12] {
            let heights = Spread { mean_m: 1.62, sigma_m };
            let found: Vec<Spread> = (0..50)
                .map(|_| spread_between(&PRIOR, averages(40, &heights, &mut rng).into_iter()))
                .collect();
            let mean = |of: fn(&Spread) -> f64| found.iter().map(of).sum::<f64>() / 50.0;
            assert!((mean(|spread| spread.mean_m) - 1.62).abs() < 0.01);
            // The prior is one of 41.
            let expected_m2 = (40.0 * sigma_m.powi(2) + PRIOR.sigma_m.powi(2)) / 41.0;
            let ratio = mean(|spread| spread.sigma_m.powi(2)) / expected_m2;
            assert!((0.85..1.15).contains(&ratio), "{sigma_m}: {ratio}");
        }
    }

    #[test]
    fn the_spread_of_equally_tall_people_falls_with_their_number() {
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        let equal = Spread { mean_m: 1.8, sigma_m: 0.0 };
        for people in [0, 1, 3, 24] {
            let found = spread_between(&PRIOR, averages(people, &equal, &mut rng).into_iter());
            let of_prior = PRIOR.sigma_m / (1.0 + people as f64).sqrt();
            assert!(found.sigma_m >= LEAST_SIGMA_M && found.sigma_m < 1.3 * of_prior, "{people}: {found:?}");
        }
        assert_eq!(spread_between(&PRIOR, std::iter::empty()), PRIOR, "nobody is seen");
    }
}
