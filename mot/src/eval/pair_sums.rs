//! Sums over a recording for each person and track: few of all pairs ever meet, so that only these are held.

use std::collections::HashMap;

use super::assignment::best;
use super::grid::PairTable;

/// A number for each pair of a person and a track that have met; 0 for all others.
#[derive(Debug, Clone, Default)]
pub(super) struct PairSums(HashMap<(usize, usize), f64>);

impl PairSums {
    /// Adds to a pair's number, which is not negative.
    pub(super) fn add(&mut self, person: usize, track: usize, value: f64) {
        if value > 0.0 {
            *self.0.entry((person, track)).or_default() += value;
        }
    }

    pub(super) fn at(&self, person: usize, track: usize) -> f64 {
        self.0.get(&(person, track)).copied().unwrap_or(0.0)
    }

    /// Numbers of the pairs of the assignment with the greatest sum. Who meets nobody of another group, directly or through
    /// others, is assigned without it.
    pub(super) fn assigned(&self) -> Vec<f64> {
        self.groups().iter().flat_map(|pairs| assigned_in(pairs)).collect()
    }

    /// Pairs that have met, in groups without a person or a track in common, each in order.
    fn groups(&self) -> Vec<Vec<(usize, usize, f64)>> {
        let mut pairs: Vec<_> = self.0.iter().map(|((person, track), sum)| (*person, *track, *sum)).collect();
        pairs.sort_unstable_by_key(|(person, track, _)| (*person, *track));
        // People at the even indices, tracks at the odd ones.
        let size = pairs.iter().map(|(person, track, _)| 2 * (*person).max(*track) + 2).max().unwrap_or(0);
        let mut leaders = Leaders((0..size).collect());
        for (person, track, _) in &pairs {
            leaders.join(2 * person, 2 * track + 1);
        }
        let mut group_of: HashMap<usize, usize> = HashMap::new();
        let mut groups: Vec<Vec<(usize, usize, f64)>> = Vec::new();
        for pair in pairs {
            let group = *group_of.entry(leaders.of(2 * pair.0)).or_insert(groups.len());
            if group == groups.len() {
                groups.push(Vec::new());
            }
            groups[group].push(pair);
        }
        groups
    }
}

/// Disjoint sets (R. Tarjan, "Efficiency of a good but not linear set union algorithm", JACM 22, 1975), with halved paths.
struct Leaders(Vec<usize>);

impl Leaders {
    fn of(&mut self, mut member: usize) -> usize {
        while self.0[member] != member {
            self.0[member] = self.0[self.0[member]];
            member = self.0[member];
        }
        member
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.of(a), self.of(b));
        self.0[a] = b;
    }
}

/// Numbers of the assigned pairs of one group.
fn assigned_in(pairs: &[(usize, usize, f64)]) -> Vec<f64> {
    let index_of = |mut ids: Vec<usize>| {
        ids.sort_unstable();
        ids.dedup();
        ids
    };
    let people = index_of(pairs.iter().map(|(person, ..)| *person).collect());
    let tracks = index_of(pairs.iter().map(|(_, track, _)| *track).collect());
    let mut table = PairTable::zeros(people.len(), tracks.len());
    for (person, track, sum) in pairs {
        if let (Ok(row), Ok(column)) = (people.binary_search(person), tracks.binary_search(track)) {
            table.add(row, column, *sum);
        }
    }
    best(&table).into_iter().map(|(row, column)| table.at(row, column)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_assignment_is_as_good_as_that_of_the_dense_table(
            met in prop::collection::vec((0usize..12, 0usize..12, 1u32..9), 0..30),
        ) {
            let (mut sums, mut dense) = (PairSums::default(), PairTable::zeros(12, 12));
            for (person, track, value) in met {
                sums.add(person, track, f64::from(value));
                dense.add(person, track, f64::from(value));
            }
            for person in 0..12 {
                for track in 0..12 {
                    prop_assert!((sums.at(person, track) - dense.at(person, track)).abs() < 1e-12);
                }
            }
            let whole: f64 = best(&dense).into_iter().map(|(row, column)| dense.at(row, column)).sum();
            prop_assert!((sums.assigned().iter().sum::<f64>() - whole).abs() < 1e-9);
        }
    }

    #[test]
    fn groups_have_nobody_in_common() {
        let mut sums = PairSums::default();
        // A chain, a pair, and nobody.
        for (person, track) in [(0, 0), (1, 0), (1, 2), (5, 4)] {
            sums.add(person, track, 1.0);
        }
        sums.add(3, 3, 0.0);
        let sizes: Vec<usize> = sums.groups().iter().map(Vec::len).collect();
        assert_eq!(sizes, [3, 1]);
    }
}
