//! Number of set bits of a packed mask in any rectangle, by four reads (F. C. Crow, "Summed-area tables for texture
//! mapping", SIGGRAPH 1984).

use std::ops::Range;

/// Cumulative counts of a mask's bits from its upper left corner.
#[derive(Debug, Clone, Default)]
pub struct SummedArea {
    /// Number of entries of a row: one more than the mask has columns, the first 0.
    stride: usize,
    sums: Vec<u32>,
}

impl SummedArea {
    /// Sums the words of a mask of `columns` columns, row by row, `words_per_row` a row.
    pub fn restart(&mut self, columns: usize, words_per_row: usize, words: impl Iterator<Item = u64>) {
        self.stride = columns + 1;
        self.sums.clear();
        self.sums.resize(self.stride, 0);
        let mut row_sum = 0;
        for (i, mut word) in words.enumerate() {
            let first = i % words_per_row * 64;
            if first == 0 {
                row_sum = 0;
                self.sums.push(0);
            }
            for _ in first..columns.min(first + 64) {
                row_sum += (word & 1) as u32;
                word >>= 1;
                self.sums.push(self.sums[self.sums.len() - self.stride] + row_sum);
            }
        }
    }

    /// Number of bits set in a rectangle that lies within the mask.
    pub fn count(&self, rows: &Range<usize>, columns: &Range<usize>) -> u32 {
        let at = |row: usize, column: usize| self.sums[row * self.stride + column];
        at(rows.end, columns.end) + at(rows.start, columns.start)
            - at(rows.end, columns.start)
            - at(rows.start, columns.end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn any_rectangle_counts_its_bits() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut table = SummedArea::default();
        for (columns, rows) in [(1, 1), (64, 3), (65, 40), (150, 17)] {
            let words_per_row = usize::div_ceil(columns, 64);
            let words: Vec<u64> = (0..rows * words_per_row).map(|_| rng.random()).collect();
            table.restart(columns, words_per_row, words.iter().copied());
            let bit = |v: usize, u: usize| words[v * words_per_row + u / 64] >> (u % 64) & 1;
            for _ in 0..50 {
                let (v0, u0) = (rng.random_range(0..rows), rng.random_range(0..columns));
                let (v1, u1) = (rng.random_range(v0..=rows), rng.random_range(u0..=columns));
                let slow: u64 =
                    (v0..v1).flat_map(|v| (u0..u1).map(move |u| (v, u))).map(|(v, u)| bit(v, u)).sum();
                assert_eq!(u64::from(table.count(&(v0..v1), &(u0..u1))), slow);
            }
        }
    }
}
