//! Sum over the matchings of people and boxes in one camera, by Bethe's approximation.
//!
//! Each box belongs to at most one person, each person has at most one box. With the odds `w(p, b)` of a pair, the
//! sum
//!
//! ```text
//! Z = Σ over matchings  Π over its pairs  w(p, b)
//! ```
//!
//! is similar to a permanent. Belief propagation sends one message along each pair in both directions until they
//! converge,
//!
//! ```text
//! μ(p→b) = w / (1 + Σ over b' ≠ b of w(p, b') ν(b'→p))      ν(b→p) = 1 / (1 + Σ over p' ≠ p of μ(p'→b))
//! ln Z ≈ Σ_p ln(1 + Σ_b w ν) + Σ_b ln(1 + Σ_p μ) − Σ_pairs ln(1 + μ ν)
//! ```
//!
//! which is exact where the pairs form a forest (Williams & Lau 2014, "Approximate evaluation of marginal association
//! probabilities with belief propagation", IEEE TAES 50(4)). Each term belongs to one person or one box, so that a
//! change of some people changes only the terms of those who are connected with them by pairs.

/// Largest number of sweeps of messages.
const MOST_SWEEPS: usize = 12;
/// Relative change below which a message has converged.
const STILL: f64 = 1e-5;

/// Pair of a person and a box, by their indices in the problem.
#[derive(Debug, Clone, Copy)]
struct Pair {
    in_box: u32,
    odds: f64,
    to_box: f64,
    to_person: f64,
}

/// Pairs of some people with some boxes. The memory is reused.
#[derive(Debug, Clone, Default)]
pub(super) struct Matching {
    pairs: Vec<Pair>,
    /// Index of the end of each person's pairs.
    ends: Vec<u32>,
    /// Sum of the messages to each box.
    to_box: Vec<f64>,
}

impl Matching {
    /// Removes all people; `boxes` is the number of boxes.
    pub(super) fn restart(&mut self, boxes: usize) {
        self.pairs.clear();
        self.ends.clear();
        self.to_box.clear();
        self.to_box.resize(boxes, 0.0);
    }

    /// Adds a person with the odds of each of these boxes.
    pub(super) fn add(&mut self, odds: impl Iterator<Item = (usize, f64)>) {
        self.pairs.extend(odds.map(|(in_box, odds)| Pair {
            in_box: in_box as u32,
            odds,
            to_box: 0.0,
            to_person: 1.0,
        }));
        self.ends.push(self.pairs.len() as u32);
    }

    /// Sends messages until they converge, at most [`MOST_SWEEPS`] times.
    pub(super) fn solve(&mut self) {
        for _ in 0..MOST_SWEEPS {
            if !self.sweep() {
                return;
            }
        }
    }

    /// Sends all messages once. Returns whether some message has changed.
    fn sweep(&mut self) -> bool {
        self.to_box.fill(0.0);
        let mut start = 0;
        for &end in &self.ends {
            let pairs = &mut self.pairs[start..end as usize];
            start = end as usize;
            let sum: f64 = 1.0 + pairs.iter().map(|pair| pair.odds * pair.to_person).sum::<f64>();
            for pair in pairs {
                pair.to_box = pair.odds / (sum - pair.odds * pair.to_person).max(1.0);
                self.to_box[pair.in_box as usize] += pair.to_box;
            }
        }
        let mut has_changed = false;
        for pair in &mut self.pairs {
            let message = 1.0 / (1.0 + (self.to_box[pair.in_box as usize] - pair.to_box).max(0.0));
            has_changed |= (message - pair.to_person).abs() > STILL * message;
            pair.to_person = message;
        }
        has_changed
    }

    /// Term of each person in `ln Z`, in the order in which they were added.
    pub(super) fn terms_of_people(&self) -> impl Iterator<Item = f64> + '_ {
        self.people().map(|pairs| {
            let (sum, product) = pairs.iter().fold((1.0, 1.0), |(sum, product), pair| {
                (sum + pair.odds * pair.to_person, product * (1.0 + pair.to_box * pair.to_person))
            });
            f64::ln(sum / product)
        })
    }

    /// Term of each box in `ln Z`.
    pub(super) fn terms_of_boxes(&self) -> impl Iterator<Item = f64> + '_ {
        self.to_box.iter().map(|sum| sum.ln_1p())
    }

    /// Probability that each box belongs to none of these people.
    pub(super) fn unexplained(&self) -> impl Iterator<Item = f64> + '_ {
        self.to_box.iter().map(|sum| 1.0 / (1.0 + sum))
    }

    /// Boxes of each person with the probabilities that they belong to the person.
    pub(super) fn matches(&self) -> impl Iterator<Item = impl Iterator<Item = (usize, f64)> + '_> + '_ {
        self.people().map(|pairs| {
            let sum: f64 = 1.0 + pairs.iter().map(|pair| pair.odds * pair.to_person).sum::<f64>();
            pairs.iter().map(move |pair| (pair.in_box as usize, pair.odds * pair.to_person / sum))
        })
    }

    fn people(&self) -> impl Iterator<Item = &[Pair]> + '_ {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| &self.pairs[start as usize..*end as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Z by enumeration of all matchings, as the oracle.
    fn exact(odds: &[Vec<f64>], taken: u32) -> f64 {
        let Some((first, rest)) = odds.split_first() else { return 1.0 };
        let free = (0..first.len()).filter(|b| taken >> b & 1 == 0 && first[*b] > 0.0);
        exact(rest, taken) + free.map(|b| first[b] * exact(rest, taken | 1 << b)).sum::<f64>()
    }

    fn bethe(odds: &[Vec<f64>]) -> Matching {
        let mut matching = Matching::default();
        matching.restart(odds.first().map_or(0, Vec::len));
        for row in odds {
            matching.add(row.iter().copied().enumerate().filter(|(_, w)| *w > 0.0));
        }
        matching.solve();
        matching
    }

    fn log_sum(matching: &Matching) -> f64 {
        matching.terms_of_people().sum::<f64>() + matching.terms_of_boxes().sum::<f64>()
    }

    /// Bethe's value is a lower bound of such sums (Gurvits 2011), and close to them.
    #[test]
    fn the_sum_over_matchings_is_nearly_exact() {
        let mut rng = Pcg64Mcg::seed_from_u64(7);
        for _ in 0..500 {
            let people = rng.random_range(1..6);
            let mut odds = |_| -> Vec<f64> {
                let log = |_| rng.random_range(-14.0..12.0_f64);
                (0..6).map(log).map(|log| if log > -7.0 { log.exp() } else { 0.0 }).collect()
            };
            let odds: Vec<Vec<f64>> = (0..people).map(&mut odds).collect();
            let (found, truth) = (log_sum(&bethe(&odds)), exact(&odds, 0).ln());
            assert!(found < truth + 0.05 && found > truth - 1.5, "{found}, not {truth}: {odds:?}");
        }
    }

    /// The pairs form a chain where no two people share two boxes; Bethe's value is then exact.
    #[test]
    fn a_chain_of_people_and_boxes_is_exact() {
        let mut rng = Pcg64Mcg::seed_from_u64(8);
        for _ in 0..500 {
            let mut odds = vec![vec![0.0; 5]; 4];
            for i in 0..8 {
                odds[i / 2][i / 2 + i % 2] = rng.random_range(-5.0..9.0_f64).exp();
            }
            let matching = bethe(&odds);
            let (found, truth) = (log_sum(&matching), exact(&odds, 0).ln());
            assert!((found - truth).abs() < 1e-2, "{found}, not {truth}");
            for matches in matching.matches() {
                let sum: f64 = matches.map(|(_, p)| p).sum();
                assert!((0.0..1.0).contains(&sum), "{sum}");
            }
        }
    }

    /// Differences decide a move, and they are far more accurate than the sums, because few people in a crowd share
    /// boxes.
    #[test]
    fn moves_are_weighed_as_by_the_exact_sum() {
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let mut worst = Vec::new();
        for _ in 0..300 {
            // Six people in a row, each with an own box, and some with the neighbours' boxes.
            let mut row = |p: usize| -> Vec<f64> {
                (0..6)
                    .map(|b: usize| match p.abs_diff(b) {
                        0 => rng.random_range(4.0..12.0_f64).exp(),
                        1 => rng.random_range(-6.0..6.0_f64).exp(),
                        _ => 0.0,
                    })
                    .collect()
            };
            let before: Vec<Vec<f64>> = (0..6).map(&mut row).collect();
            let mut after = before.clone();
            after[2] = row(2);
            let change = log_sum(&bethe(&after)) - log_sum(&bethe(&before));
            let truth = exact(&after, 0).ln() - exact(&before, 0).ln();
            worst.push((change - truth).abs());
        }
        worst.sort_by(f64::total_cmp);
        assert!(worst[150] < 0.01 && worst[297] < 0.5, "median {}, 99 % {}", worst[150], worst[297]);
    }
}
