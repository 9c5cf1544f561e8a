//! Priors of people: E(S), walkable floor, and R(S), separation (Osawa et al., equations 5 and 6; cited in [`super`]).

use crate::silhouette::Body;

/// The logarithm of "impossible". Finite, so that a state that starts out impossible (a prediction inside a wall) can
/// be compared with another, and left.
pub const LOG_IMPOSSIBLE: f64 = -1e4;

/// Distance, in 1/λ, beyond which two people do not interact: `log ψ` is 2e-8.
const FAR_APART: f64 = 18.0;

/// `log ψ` of one pair: `ψ = 1 − exp(−λ D)`, D the distance on the floor. λ in 1/m; infinite means no repulsion.
pub fn log_separation(a: &Body, b: &Body, lambda: f64) -> f64 {
    let apart = lambda * a.floor_distance_m(b);
    if apart > FAR_APART { 0.0 } else { (-(-apart).exp_m1()).ln().max(LOG_IMPOSSIBLE) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn at(x_m: f64) -> Body {
        Body { x_m, y_m: 0.0, radius_m: 0.25, height_m: 1.7 }
    }

    #[test]
    fn people_repel_and_two_on_one_spot_are_impossible() {
        assert_relative_eq!(
            log_separation(&at(0.0), &at(0.5), 3.0).exp(),
            1.0 - (-1.5_f64).exp(),
            epsilon = 1e-12
        );
        assert_relative_eq!(log_separation(&at(0.0), &at(0.0), 3.0), LOG_IMPOSSIBLE);
    }
}
