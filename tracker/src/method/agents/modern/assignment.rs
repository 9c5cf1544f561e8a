//! Joint assignment of one sender's measurements to people.
//!
//! Only pairs within the gate are listed. Each connected component of their graph is solved separately, as nearly all
//! components are a single pair. Larger ones are solved by H. W. Kuhn, "The Hungarian method for the assignment
//! problem", Naval Research Logistics 2 (1955) 83–97, as implemented in the `pathfinding` crate.

use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;

/// Cost of leaving a row unassigned: above that of any pair, so that as many rows as possible are assigned.
const UNASSIGNED: f64 = 200.0;
/// Integer steps per unit of cost; smaller differences are ignored.
const STEPS_PER_UNIT: f64 = 1e6;

/// Candidate pair of a row and a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pair {
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) cost: f64,
}

/// Assignment solver; its buffers are reused from problem to problem.
#[derive(Debug, Default)]
pub(super) struct Assignment {
    part_of_row: Vec<u16>,
    part_of_column: Vec<u16>,
    chosen: Vec<Pair>,
    in_part: Vec<Pair>,
    rows: Vec<usize>,
    columns: Vec<usize>,
}

/// Component of a column without pairs.
const NO_PART: u16 = u16::MAX;

impl Assignment {
    /// Finds the cheapest assignment of as many rows as possible. Returns its pairs by row. Costs must be below 200.
    pub(super) fn solve(&mut self, pairs: &[Pair], rows: usize, columns: usize) -> &[Pair] {
        self.find_parts(pairs, rows, columns);
        self.chosen.clear();
        for part in 0..rows as u16 {
            // A component has the number of its first row.
            if self.part_of_row[part as usize] != part {
                continue;
            }
            self.in_part.clear();
            self.in_part.extend(pairs.iter().filter(|p| self.part_of_row[p.row] == part));
            match self.in_part.as_slice() {
                [] => {}
                [only] => self.chosen.push(*only),
                _ => self.solve_part(),
            }
        }
        self.chosen.sort_unstable_by_key(|p| p.row);
        &self.chosen
    }

    /// Labels the connected components: each row and column gets the smallest row to which it is connected.
    fn find_parts(&mut self, pairs: &[Pair], rows: usize, columns: usize) {
        self.part_of_row.clear();
        self.part_of_row.extend(0..rows as u16);
        self.part_of_column.clear();
        self.part_of_column.resize(columns, NO_PART);
        loop {
            let mut is_changed = false;
            for pair in pairs {
                let (row, column) = (&mut self.part_of_row[pair.row], &mut self.part_of_column[pair.column]);
                if *row != *column {
                    let least = (*row).min(*column);
                    *row = least;
                    *column = least;
                    is_changed = true;
                }
            }
            if !is_changed {
                return;
            }
        }
    }

    fn solve_part(&mut self) {
        self.rows.clear();
        self.rows.extend(self.in_part.iter().map(|p| p.row));
        self.rows.sort_unstable();
        self.rows.dedup();
        self.columns.clear();
        self.columns.extend(self.in_part.iter().map(|p| p.column));
        self.columns.sort_unstable();
        self.columns.dedup();
        let is_wide = self.rows.len() <= self.columns.len();
        let (height, width) = if is_wide {
            (self.rows.len(), self.columns.len())
        } else {
            (self.columns.len(), self.rows.len())
        };
        let mut weights = Matrix::new(height, width, 0i64);
        for pair in &self.in_part {
            let (Ok(r), Ok(c)) =
                (self.rows.binary_search(&pair.row), self.columns.binary_search(&pair.column))
            else {
                continue;
            };
            let weight = ((UNASSIGNED - pair.cost).max(0.0) * STEPS_PER_UNIT) as i64;
            weights[if is_wide { (r, c) } else { (c, r) }] = weight;
        }
        let (_, of) = kuhn_munkres(&weights);
        for pair in &self.in_part {
            let (Ok(r), Ok(c)) =
                (self.rows.binary_search(&pair.row), self.columns.binary_search(&pair.column))
            else {
                continue;
            };
            if if is_wide { of[r] == c } else { of[c] == r } {
                self.chosen.push(*pair);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// Greatest sum of (200 − cost) over all assignments, by exhaustive search.
    fn exhaustive(pairs: &[Pair], rows: usize, row: usize, taken: &mut Vec<usize>) -> f64 {
        if row == rows {
            return 0.0;
        }
        let mut best = exhaustive(pairs, rows, row + 1, taken);
        for pair in pairs.iter().filter(|p| p.row == row) {
            if !taken.contains(&pair.column) {
                taken.push(pair.column);
                best = best.max(UNASSIGNED - pair.cost + exhaustive(pairs, rows, row + 1, taken));
                taken.pop();
            }
        }
        best
    }

    #[test]
    fn no_assignment_is_cheaper() {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut assignment = Assignment::default();
        for _ in 0..300 {
            let (rows, columns) = (random.random_range(1..6), random.random_range(1..6));
            let mut pairs = Vec::new();
            for row in 0..rows {
                for column in 0..columns {
                    if random.random_bool(0.4) {
                        pairs.push(Pair { row, column, cost: random.random_range(-5.0..60.0) });
                    }
                }
            }
            let chosen = assignment.solve(&pairs, rows, columns);
            let total: f64 = chosen.iter().map(|p| UNASSIGNED - p.cost).sum();
            assert!((total - exhaustive(&pairs, rows, 0, &mut Vec::new())).abs() < 1e-4);
            for (i, a) in chosen.iter().enumerate() {
                assert!(chosen[..i].iter().all(|b| b.row != a.row && b.column != a.column));
            }
        }
    }
}
