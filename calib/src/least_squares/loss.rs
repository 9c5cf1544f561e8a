//! Robust losses ρ(s) of a squared residual s, with ρ(s) ≈ s for small s.

/// Robust loss of a residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Loss {
    /// ρ = s.
    Squares,
    /// Quadratic up to this residual, linear beyond.
    Huber(f64),
    /// ρ = c² ln(1 + s / c²): the influence of outliers tends to zero.
    Cauchy(f64),
}

impl Loss {
    /// ρ(s).
    pub fn cost(self, squared: f64) -> f64 {
        match self {
            Self::Huber(c) if squared > c * c => 2.0 * c * squared.sqrt() - c * c,
            Self::Squares | Self::Huber(_) => squared,
            Self::Cauchy(c) => c * c * (squared / (c * c)).ln_1p(),
        }
    }

    /// dρ/ds: the weight in iteratively reweighted least squares.
    pub fn weight(self, squared: f64) -> f64 {
        match self {
            Self::Huber(c) if squared > c * c => c / squared.sqrt(),
            Self::Squares | Self::Huber(_) => 1.0,
            Self::Cauchy(c) => 1.0 / (1.0 + squared / (c * c)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_is_the_slope_of_the_cost() {
        for loss in [Loss::Squares, Loss::Huber(1.5), Loss::Cauchy(0.7)] {
            for s in [0.01_f64, 0.5, 2.0, 2.3, 10.0, 400.0] {
                let step = 1e-6 * s;
                let numeric = (loss.cost(s + step) - loss.cost(s - step)) / (2.0 * step);
                assert!((numeric - loss.weight(s)).abs() < 1e-6, "{loss:?} at {s}");
            }
        }
    }
}
