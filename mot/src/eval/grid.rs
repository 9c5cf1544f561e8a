//! Table of a number for each pair, such as similarity or distance.

/// A dense table of numbers, row by row.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PairTable {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl PairTable {
    pub(super) fn from_fn(rows: usize, columns: usize, value: impl Fn(usize, usize) -> f64) -> Self {
        let values = (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))).map(|(r, c)| value(r, c));
        Self { rows, columns, values: values.collect() }
    }
    /// Two tables whose numbers are computed together.
    pub(super) fn pair_from_fn(
        rows: usize,
        columns: usize,
        values: impl Fn(usize, usize) -> (f64, f64),
    ) -> (Self, Self) {
        let cells = (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c)));
        let (a, b) = cells.map(|(r, c)| values(r, c)).unzip();
        (Self { rows, columns, values: a }, Self { rows, columns, values: b })
    }
    pub(super) fn zeros(rows: usize, columns: usize) -> Self {
        Self { rows, columns, values: vec![0.0; rows * columns] }
    }
    pub(super) fn rows(&self) -> usize {
        self.rows
    }
    pub(super) fn columns(&self) -> usize {
        self.columns
    }
    pub(super) fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }
    pub(super) fn add(&mut self, row: usize, column: usize, value: f64) {
        self.values[row * self.columns + column] += value;
    }
    pub(super) fn values(&self) -> &[f64] {
        &self.values
    }
}
