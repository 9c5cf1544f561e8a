//! Probability distribution of the number of people.

/// Distribution of the number of people who exist independently with these probabilities: entry `n` is the probability
/// of exactly `n` people (Poisson binomial, computed by adding one person after the other).
pub fn distribution(present: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut counts = vec![1.0];
    for p in present {
        counts.push(0.0);
        for n in (0..counts.len()).rev() {
            let with_one_less = if n == 0 { 0.0 } else { counts[n - 1] };
            counts[n] = (1.0 - p) * counts[n] + p * with_one_less;
        }
    }
    counts
}

/// Whether a number is in the smallest set of the most probable numbers whose total probability is at least `share`;
/// equally probable numbers are all in it or all outside.
pub fn is_likely(distribution: &[f64], number: usize, share: f64) -> bool {
    let own = distribution.get(number).copied().unwrap_or(0.0);
    own > 0.0 && distribution.iter().filter(|p| **p > own).sum::<f64>() < share
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn it_sums_over_who_is_there() {
        let present = [0.9, 0.2, 0.55, 1.0];
        let found = distribution(present);
        let mut expected = [0.0; 5];
        for subset in 0_u32..1 << present.len() {
            let there = |i: usize| subset >> i & 1 == 1;
            let probability: f64 =
                (0..present.len()).map(|i| if there(i) { present[i] } else { 1.0 - present[i] }).product();
            expected[subset.count_ones() as usize] += probability;
        }
        assert_eq!(found.len(), 5);
        for (found, expected) in found.iter().zip(expected) {
            assert_relative_eq!(*found, expected, epsilon = 1e-12);
        }
        assert_relative_eq!(found[0], 0.0);
    }

    #[test]
    fn equal_people_are_binomial_and_nobody_is_nobody() {
        let found = distribution([0.3; 3]);
        for (found, expected) in found.iter().zip([0.343, 0.441, 0.189, 0.027]) {
            assert_relative_eq!(*found, expected, epsilon = 1e-12);
        }
        assert_eq!(distribution([]), vec![1.0]);
    }

    #[test]
    fn likely_numbers_are_the_most_probable_ones_up_to_the_share() {
        let likely = |distribution: &[f64]| -> Vec<usize> {
            (0..7).filter(|n| is_likely(distribution, *n, 0.9)).collect()
        };
        assert_eq!(likely(&[0.05, 0.6, 0.25, 0.1]), [1, 2, 3], "0.85 are too little");
        assert_eq!(likely(&[0.04, 0.01, 0.95]), [2]);
        assert_eq!(likely(&[0.5, 0.25, 0.25]), [0, 1, 2], "equals go together");
        // By rounding, the probable ones may sum to slightly less than 1.
        assert!(!is_likely(&[0.0, 1.0 - 1e-15], 0, 1.0), "what is impossible is in no set");
        assert_eq!(
            likely(&[0.0, 1.0]),
            [1],
            "what is impossible is not likely, nor more people than anybody told of"
        );
    }
}
