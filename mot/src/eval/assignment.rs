//! Assignment of rows to columns with the greatest total weight.
//!
//! H. W. Kuhn, "The Hungarian method for the assignment problem", Naval Research Logistics 2 (1955) 83–97, as in the
//! `pathfinding` crate. That works on integers, so weights are scaled to 62 bits: differences above about 10⁻¹² of the
//! greatest weight decide, smaller ones are ties.

use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix as IntegerMatrix;

use super::grid::PairTable;

/// Pairs (row, column) of the assignment with the greatest total weight, by row; pairs of weight 0 are left out.
///
/// Weights are finite and not negative.
pub(super) fn best(weights: &PairTable) -> Vec<(usize, usize)> {
    let (rows, columns) = (weights.rows(), weights.columns());
    let greatest = weights.values().iter().copied().fold(0.0, f64::max);
    if greatest <= 0.0 {
        return Vec::new();
    }
    // The sums of n weights that the algorithm forms stay below 2⁶².
    let scale = 2f64.powi(61) / (greatest * (rows.min(columns) + 1) as f64);
    let at = |row: usize, column: usize| (weights.at(row, column) * scale).round() as i64;
    let mut pairs: Vec<(usize, usize)> = if rows <= columns {
        let (_, of_row) = kuhn_munkres(&IntegerMatrix::from_fn(rows, columns, |(r, c)| at(r, c)));
        of_row.into_iter().enumerate().collect()
    } else {
        let (_, of_column) = kuhn_munkres(&IntegerMatrix::from_fn(columns, rows, |(c, r)| at(r, c)));
        of_column.into_iter().enumerate().map(|(c, r)| (r, c)).collect()
    };
    pairs.retain(|(r, c)| weights.at(*r, *c) > 0.0);
    pairs.sort_unstable();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Tries every assignment.
    fn exhaustive(weights: &PairTable, row: usize, taken: &mut Vec<bool>) -> f64 {
        if row == weights.rows() {
            return 0.0;
        }
        let mut best = exhaustive(weights, row + 1, taken);
        for column in 0..weights.columns() {
            if !taken[column] {
                taken[column] = true;
                best = best.max(weights.at(row, column) + exhaustive(weights, row + 1, taken));
                taken[column] = false;
            }
        }
        best
    }

    proptest! {
        #[test]
        fn no_assignment_is_better(rows in 0usize..6, columns in 0usize..6,
                                   values in prop::collection::vec(prop_oneof![Just(0.0), 0.0..1.0, 1000.0..1001.0], 36)) {
            let grid = PairTable::from_fn(rows, columns, |r, c| values[r * 6 + c]);
            let pairs = best(&grid);
            let total: f64 = pairs.iter().map(|(r, c)| grid.at(*r, *c)).sum();
            prop_assert!((total - exhaustive(&grid, 0, &mut vec![false; columns])).abs() < 1e-9);
            let distinct: std::collections::HashSet<usize> = pairs.iter().map(|(_, c)| *c).collect();
            prop_assert_eq!(distinct.len(), pairs.len());
        }
    }
}
