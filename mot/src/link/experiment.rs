//! The paper's experiment on the user's data: tracking success with and without the direction constraint, against the
//! number of skipped frames (table 1 and figure 9).

use std::fmt::Write;

use serde::Serialize;

use super::LinkOptions;
use super::tune::{CrossValidation, TuneOptions, cross_validate};
use crate::Result;
use crate::chart::{Axis, Chart, Series};
use crate::rows::RowFile;

/// Numbers of skipped frames, as in figure 9.
pub const SKIPS: std::ops::RangeInclusive<u32> = 0..=3;

/// One point of figure 9, with and without the constraint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SkipComparison {
    /// Number of frames skipped after each one.
    pub skip: u32,
    /// Result without the direction constraint: the method of Pirsiavash et al.
    pub without: CrossValidation,
    /// Result with the constraint.
    pub with: CrossValidation,
}

/// Runs the experiment; thresholds are cross-validated separately for each number of skipped frames.
///
/// # Errors
/// Errors of [`cross_validate`].
pub fn run(
    detections: &RowFile,
    truth: &RowFile,
    folds: usize,
    link: &LinkOptions,
    mut step: impl FnMut(),
) -> Result<Vec<SkipComparison>> {
    SKIPS
        .map(|skip| {
            let mut validate = |direction: bool| {
                let link = LinkOptions { skip, ..link.clone() };
                let found = cross_validate(detections, truth, &TuneOptions { folds, direction, link });
                step();
                found
            };
            Ok(SkipComparison { skip, without: validate(false)?, with: validate(true)? })
        })
        .collect()
}

/// Text table with a line for each number of skipped frames.
pub fn table(rows: &[SkipComparison]) -> String {
    let mut text = format!(
        "{:>7} {:>22} {:>22}  {:>9} {:>9}  best with it\n",
        "skipped", "success without", "with direction", "IDF1", "IDF1"
    );
    for row in rows {
        let (a, b) = (&row.without.score, &row.with.score);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:>7} {:>20.1} % {:>20.1} %  {:>7.1} % {:>7.1} %  {}",
            row.skip,
            a.success,
            b.success,
            a.idf1,
            b.idf1,
            row.with.best.flags()
        );
    }
    text
}

/// Chart of figure 9.
pub fn figure(rows: &[SkipComparison]) -> Chart {
    let series = |name: &str, of: fn(&SkipComparison) -> f64| Series {
        name: name.to_owned(),
        points: rows.iter().map(|r| [f64::from(r.skip), of(r)]).collect(),
        is_line: true,
        color: None,
    };
    let series = vec![
        series("without the direction constraint", |r| r.without.score.success),
        series("with it", |r| r.with.score.success),
    ];
    let values = series.iter().flat_map(|s| &s.points).map(|p| p[1]);
    Chart {
        title: "people followed from their first frame to their last".to_owned(),
        x: Axis::new("skipped frames", [0.0, 3.0]).whole(),
        y: Axis::fitting("tracking success, %", values, [0.0, 10.0]),
        series,
    }
}
