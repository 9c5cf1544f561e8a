//! Where the picks say that the cameras are not: outside their region of confidence.
//!
//! What else joins the cameras moves them off where the picks and their depths alone put them. Where it is right, the
//! picks' cost, a sum of squares in standard deviations, grows by χ² of as many degrees of freedom as numbers move the
//! cameras; what grows it more, the picks rule out.

use super::state::POSE;

/// Whether picks rule out what makes their cost grow by so much; `moving` cameras are not where the picks alone put them.
pub(super) fn picks_rule_out(grown: f64, moving: usize) -> bool {
    grown > chi_squared_99(POSE * moving)
}

/// What χ² exceeds in one case of a hundred (Wilson and Hilferty 1931).
fn chi_squared_99(freedoms: usize) -> f64 {
    /// Of a normal variable.
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
        // Two cameras that move let the picks' cost grow by more than one.
        assert!(picks_rule_out(20.0, 1) && !picks_rule_out(18.0, 1) && !picks_rule_out(20.0, 2));
    }
}
