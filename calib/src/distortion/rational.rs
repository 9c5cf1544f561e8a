//! OpenCV's rational lens distortion, `[k1, k2, p1, p2, k3, k4, k5, k6]` (D. Claus and A. Fitzgibbon, "A rational function
//! lens distortion model for general cameras", CVPR 2005, in the form of OpenCV's `CALIB_RATIONAL_MODEL`).
//!
//! With `r² = x² + y²` on the normalised image plane (z = 1):
//!
//! ```text
//! q  = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
//! x' = x q + 2 p1 x y + p2 (r² + 2 x²)
//! y' = y q + p1 (r² + 2 y²) + 2 p2 x y
//! ```

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use super::inverse::PlaneMap;
use super::roots::smallest_crossing;

/// Squared radius up to which a fold is looked for: a ray 89.9° from the axis.
const FARTHEST_SQUARED: f64 = 3e5;

/// Coefficients of the rational model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 8]", into = "[f64; 8]")]
pub struct Rational {
    /// `k1 k2 p1 p2 k3 k4 k5 k6`.
    numbers: [f64; 8],
    /// Computed once, since every projection asks for it.
    max_radius: f64,
}

impl From<[f64; 8]> for Rational {
    fn from(numbers: [f64; 8]) -> Self {
        Self { numbers, max_radius: max_radius(&numbers) }
    }
}

impl From<Rational> for [f64; 8] {
    fn from(d: Rational) -> Self {
        d.numbers
    }
}

/// Value and derivative by r² of a cubic in r² whose constant is 1.
fn cubic(r2: f64, [a, b, c]: [f64; 3]) -> (f64, f64) {
    (1.0 + r2 * (a + r2 * (b + r2 * c)), a + r2 * (2.0 * b + 3.0 * r2 * c))
}

impl Rational {
    /// Coefficients in OpenCV's order.
    pub fn coefficients(&self) -> [f64; 8] {
        self.numbers
    }

    /// Value of `q`, its derivative by r², and its numerator and denominator.
    fn quotient(&self, r2: f64) -> (f64, f64, [f64; 2]) {
        let [k1, k2, _, _, k3, k4, k5, k6] = self.numbers;
        let ((above, above_slope), (below, below_slope)) = (cubic(r2, [k1, k2, k3]), cubic(r2, [k4, k5, k6]));
        let q = above / below;
        (q, (above_slope - q * below_slope) / below, [above, below])
    }

    /// Image of a point of the normalised plane.
    pub fn distort(&self, p: Vector2<f64>) -> Vector2<f64> {
        let (x, y, r2) = (p.x, p.y, p.norm_squared());
        let [_, _, p1, p2, ..] = self.numbers;
        let (q, ..) = self.quotient(r2);
        Vector2::new(
            x * q + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * q + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// Derivative of the image by the point.
    pub fn jacobian(&self, p: Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (p.x, p.y);
        let [_, _, p1, p2, ..] = self.numbers;
        let (q, slope, _) = self.quotient(p.norm_squared());
        let cross = 2.0 * x * y * slope + 2.0 * (p1 * x + p2 * y);
        Matrix2::new(
            q + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x,
            cross,
            cross,
            q + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x,
        )
    }

    /// Derivative of the image by each coefficient.
    pub fn coefficient_jacobian(&self, p: Vector2<f64>) -> [Vector2<f64>; 8] {
        let (x, y, r2) = (p.x, p.y, p.norm_squared());
        let (q, _, [_, below]) = self.quotient(r2);
        let (above, under) = (p / below, p * (-q / below));
        [
            above * r2,
            above * (r2 * r2),
            Vector2::new(2.0 * x * y, r2 + 2.0 * y * y),
            Vector2::new(r2 + 2.0 * x * x, 2.0 * x * y),
            above * (r2 * r2 * r2),
            under * r2,
            under * (r2 * r2),
            under * (r2 * r2 * r2),
        ]
    }

    /// Factors of the derivatives by k1, `p a`, and by k2, `p a b`.
    pub(super) fn leading_factors(&self, p: Vector2<f64>) -> [f64; 2] {
        let r2 = p.norm_squared();
        let (_, _, [_, below]) = self.quotient(r2);
        [r2 / below, r2]
    }

    /// Point that has this image; `None` beyond the fold.
    pub fn undistort(&self, distorted: Vector2<f64>) -> Option<Vector2<f64>> {
        self.inverse(distorted)
    }

    /// Normalised radius up to which images are unique: up to the first pole of `q`, or where `r q(r)` ceases to grow.
    pub fn max_radius(&self) -> f64 {
        self.max_radius
    }
}

/// With `s = r²`, numerator N and denominator D: `r q` grows while `(N + 2 s N′) D − 2 s N D′` is positive, and has a pole
/// where D vanishes.
fn max_radius(numbers: &[f64; 8]) -> f64 {
    let [k1, k2, _, _, k3, k4, k5, k6] = *numbers;
    let (above, below) = ([1.0, k1, k2, k3], [1.0, k4, k5, k6]);
    let mut growth = [0.0; 7];
    for (i, n) in above.iter().enumerate() {
        for (j, d) in below.iter().enumerate() {
            growth[i + j] += (1.0 + 2.0 * i as f64 - 2.0 * j as f64) * n * d;
        }
    }
    let ends = [smallest_crossing(&growth, FARTHEST_SQUARED), smallest_crossing(&below, FARTHEST_SQUARED)];
    ends.into_iter().flatten().fold(f64::INFINITY, f64::min).sqrt()
}

impl PlaneMap for Rational {
    fn distort(&self, p: Vector2<f64>) -> Vector2<f64> {
        Self::distort(self, p)
    }

    fn jacobian(&self, p: Vector2<f64>) -> Matrix2<f64> {
        Self::jacobian(self, p)
    }

    fn radial_image(&self, radius: f64) -> f64 {
        radius * self.quotient(radius * radius).0
    }

    fn max_radius(&self) -> f64 {
        self.max_radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distortion::BrownConrady;
    use proptest::prelude::*;

    fn lens() -> impl Strategy<Value = Rational> {
        let radial = (-0.3..0.6, -0.2..0.2, -0.05..0.05);
        let below = (-0.2..0.8, -0.1..0.3, -0.02..0.05);
        (radial, (-0.005..0.005, -0.005..0.005), below).prop_map(|((k1, k2, k3), (p1, p2), (k4, k5, k6))| {
            Rational::from([k1, k2, p1, p2, k3, k4, k5, k6])
        })
    }

    proptest! {
        #[test]
        fn undistort_inverts_distort(d in lens(), x in -1.5..1.5, y in -1.2..1.2) {
            let p = Vector2::new(x, y);
            prop_assume!(p.norm() < 0.9 * d.max_radius());
            // A steep lens turns rounding into an error of the point.
            let steepness = 1.0 / d.jacobian(p).determinant().abs();
            prop_assume!(steepness < 100.0);
            let back = d.undistort(d.distort(p)).unwrap();
            prop_assert!((back - p).norm() < 1e-9 * (1.0 + steepness), "{p:?} came back as {back:?}");
        }

        #[test]
        fn derivatives_match_finite_differences(d in lens(), x in -0.9..0.9, y in -0.7..0.7) {
            let (p, step) = (Vector2::new(x, y), 1e-6);
            prop_assume!(p.norm() < 0.95 * d.max_radius());
            for axis in 0..2 {
                let mut delta = Vector2::zeros();
                delta[axis] = step;
                let numeric = (d.distort(p + delta) - d.distort(p - delta)) / (2.0 * step);
                prop_assert!((d.jacobian(p).column(axis) - numeric).norm() < 1e-6 * (1.0 + numeric.norm()));
            }
            for (k, analytic) in d.coefficient_jacobian(p).into_iter().enumerate() {
                let moved = |by: f64| {
                    let mut numbers = d.coefficients();
                    numbers[k] += by;
                    Rational::from(numbers).distort(p)
                };
                let numeric = (moved(step) - moved(-step)) / (2.0 * step);
                prop_assert!((analytic - numeric).norm() < 1e-6 * (1.0 + numeric.norm()), "coefficient {k}");
            }
        }

        #[test]
        fn images_are_unique_up_to_the_fold_and_no_further(d in lens()) {
            let image = |r: f64| d.radial_image(r);
            let fold = d.max_radius();
            for i in 0..400 {
                let r = fold.min(5.0) * f64::from(i) / 400.0;
                prop_assert!(image(r + 1e-6) >= image(r), "falls at {r}, before the fold at {fold}");
            }
            if fold < 100.0 {
                let (at, after) = (image(0.999 * fold), image(1.002 * fold));
                prop_assert!(after <= at * (1.0 + 1e-5), "still grows at {fold}: {at} to {after}");
            }
        }

        #[test]
        fn without_a_denominator_it_is_brown_conrady(k in prop::array::uniform5(-0.05..0.05f64), x in -0.8..0.8, y in -0.6..0.6) {
            let [k1, k2, p1, p2, k3] = k;
            let (plain, p) = (BrownConrady::from(k), Vector2::new(x, y));
            let rational = Rational::from([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]);
            prop_assert!((plain.distort(p) - rational.distort(p)).norm() < 1e-15);
            let (a, b) = (plain.max_radius(), rational.max_radius());
            prop_assert!((a.is_infinite() && b.is_infinite()) || (a - b).abs() < 1e-6 * a || a.min(b) > 500.0, "{a} {b}");
        }
    }
}
