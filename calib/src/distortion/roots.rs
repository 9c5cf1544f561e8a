//! Roots of the polynomials that tell where a lens folds.

/// Real roots of `a x³ + b x² + c x + d`, by Cardano and Viète; lower degrees where leading terms vanish.
pub(super) fn real_roots_of_cubic(a: f64, b: f64, c: f64, d: f64) -> [Option<f64>; 3] {
    const NEGLIGIBLE: f64 = 1e-12;
    if a.abs() < NEGLIGIBLE {
        if b.abs() < NEGLIGIBLE {
            return [(c.abs() >= NEGLIGIBLE).then(|| -d / c), None, None];
        }
        let discriminant = c * c - 4.0 * b * d;
        if discriminant < 0.0 {
            return [None; 3];
        }
        // This form avoids cancellation: one root from the sum, the other from the product.
        let q = -0.5 * (c + c.signum() * discriminant.sqrt());
        return [Some(q / b), (q != 0.0).then(|| d / q), None];
    }
    let (b, c, d) = (b / a, c / a, d / a);
    let (q, r) = ((b * b - 3.0 * c) / 9.0, (2.0 * b * b * b - 9.0 * b * c + 27.0 * d) / 54.0);
    if r * r < q * q * q {
        let theta = (r / (q * q * q).sqrt()).acos();
        let root = |k: f64| -2.0 * q.sqrt() * ((theta + std::f64::consts::TAU * k) / 3.0).cos() - b / 3.0;
        return [Some(root(0.0)), Some(root(1.0)), Some(root(-1.0))];
    }
    let s = -r.signum() * (r.abs() + (r * r - q * q * q).sqrt()).cbrt();
    let t = if s == 0.0 { 0.0 } else { q / s };
    [Some(s + t - b / 3.0), None, None]
}

/// Smallest root of `Σ coefficients[k] xᵏ` in `(0, to]` at which the polynomial changes its sign; `None` without one.
///
/// Between two neighbouring roots of its derivative a polynomial is monotonic, so each of these stretches has at most one
/// root, which bisection finds; the derivative's roots come from its own derivative, and so on down to a line.
pub(super) fn smallest_crossing(coefficients: &[f64], to: f64) -> Option<f64> {
    crossings(coefficients, to).into_iter().next()
}

/// All roots in `(0, to]` at which the polynomial changes its sign, in rising order.
fn crossings(coefficients: &[f64], to: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let value = |x: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let derivative: Vec<f64> = (1..).zip(&coefficients[1..]).map(|(k, c)| f64::from(k) * c).collect();
    let mut roots = Vec::new();
    let mut from = 0.0;
    for end in crossings(&derivative, to).into_iter().chain([to]) {
        let (at_from, at_end) = (value(from), value(end));
        if (at_from > 0.0 && at_end <= 0.0) || (at_from < 0.0 && at_end >= 0.0) {
            roots.push(bisected(&value, from, end, at_from > 0.0));
        }
        from = end;
    }
    roots
}

/// Root in a stretch over which the sign changes.
fn bisected(value: &impl Fn(f64) -> f64, mut from: f64, mut to: f64, falls: bool) -> f64 {
    /// Halvings after which neighbouring floats are reached from any start that occurs.
    const HALVINGS: usize = 200;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (from + to);
        if middle <= from || middle >= to {
            break;
        }
        if (value(middle) > 0.0) == falls { from = middle } else { to = middle }
    }
    0.5 * (from + to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_first_of_known_roots_is_found(mut roots in prop::collection::vec(-2.0..9.0f64, 1..7), scale in 0.01..50.0f64) {
            let mut coefficients = vec![scale];
            for root in &roots {
                // (x − root) · polynomial
                let mut next = vec![0.0; coefficients.len() + 1];
                for (k, c) in coefficients.iter().enumerate() {
                    next[k + 1] += c;
                    next[k] -= root * c;
                }
                coefficients = next;
            }
            roots.sort_by(f64::total_cmp);
            prop_assume!(roots.windows(2).all(|pair| pair[1] - pair[0] > 0.05));
            prop_assume!(roots.iter().all(|root| root.abs() > 0.01));
            let expected = roots.iter().copied().find(|root| *root > 0.0);
            let found = smallest_crossing(&coefficients, 10.0);
            prop_assert_eq!(found.is_some(), expected.is_some());
            if let (Some(found), Some(expected)) = (found, expected) {
                prop_assert!((found - expected).abs() < 1e-5, "{} for {}", found, expected);
            }
        }
    }

    #[test]
    fn numbers_that_are_none_have_no_roots() {
        for odd in [f64::NAN, f64::INFINITY] {
            assert!(smallest_crossing(&[1.0, odd, -1.0], 10.0).is_none_or(f64::is_finite));
        }
        assert_eq!(smallest_crossing(&[1.0], 10.0), None);
        assert_eq!(smallest_crossing(&[1.0, 0.0, 1.0], 10.0), None);
    }
}
