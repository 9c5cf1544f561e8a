//! Confidence region of the camera poses by the picks.
//!
//! Other constraints move the cameras off their poses by the picks and their depths alone. If those constraints are
//! right, the picks' cost, a sum of squares in standard deviations, grows by χ² with as many degrees of freedom as the
//! cameras have parameters; a larger growth is rejected.

use super::state::POSE;

/// Tells whether the growth of the picks' cost rejects other constraints; `moving` cameras have free poses.
pub(super) fn picks_rule_out(grown: f64, moving: usize) -> bool {
    grown > chi_squared_99(POSE * moving)
}

/// 99 % quantile of χ² (E. B. Wilson, M. M. Hilferty, "The distribution of chi-square", PNAS 1931).
fn chi_squared_99(freedoms: usize) -> f64 {
    /// The same quantile of a normal variable.
    const QUANTILE: f64 = 2.326_347_9;
    let n = freedoms as f64;
    let spread = 2.0 / (9.0 * n);
    n * (1.0 - spread + QUANTILE * spread.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (freedoms, expected) in [(7, 18.475), (14, 29.141), (35, 57.342)] {
            let found = chi_squared_99(freedoms);
            assert!((found / expected - 1.0).abs() < 3e-3, "{found} for {expected}");
        }
        // Two cameras with free poses allow the cost a larger growth than one.
        assert!(picks_rule_out(20.0, 1) && !picks_rule_out(18.0, 1) && !picks_rule_out(20.0, 2));
    }
}
