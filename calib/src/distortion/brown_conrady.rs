//! OpenCV's five-parameter lens distortion (Brown–Conrady): `[k1, k2, p1, p2, k3]`.
//!
//! With `r² = x² + y²` on the normalised image plane (z = 1):
//!
//! ```text
//! x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)
//! y' = y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y
//! ```
//!
//! The polynomial folds back on itself far from the centre, where a point outside the lens's field of view would land
//! inside the image again. [`BrownConrady::max_radius`] is the radius at which that begins; beyond it a point has no
//! image.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use super::inverse::PlaneMap;
use super::roots::real_roots_of_cubic;

/// Lens distortion coefficients, in OpenCV's order in files: `[k1, k2, p1, p2, k3]`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(from = "[f64; 5]", into = "[f64; 5]")]
pub struct BrownConrady {
    /// Radial, r².
    pub k1: f64,
    /// Radial, r⁴.
    pub k2: f64,
    /// Tangential.
    pub p1: f64,
    /// Tangential.
    pub p2: f64,
    /// Radial, r⁶.
    pub k3: f64,
}

impl From<[f64; 5]> for BrownConrady {
    fn from([k1, k2, p1, p2, k3]: [f64; 5]) -> Self {
        Self { k1, k2, p1, p2, k3 }
    }
}

impl From<BrownConrady> for [f64; 5] {
    fn from(d: BrownConrady) -> Self {
        d.coefficients()
    }
}

impl BrownConrady {
    /// No distortion.
    pub const NONE: Self = Self { k1: 0.0, k2: 0.0, p1: 0.0, p2: 0.0, k3: 0.0 };

    /// Coefficients in OpenCV's order.
    pub fn coefficients(&self) -> [f64; 5] {
        [self.k1, self.k2, self.p1, self.p2, self.k3]
    }

    /// Image of a point of the normalised plane.
    pub fn distort(&self, p: Vector2<f64>) -> Vector2<f64> {
        let (x, y) = (p.x, p.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        Vector2::new(
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        )
    }

    /// Derivative of the image by the point.
    pub fn jacobian(&self, p: Vector2<f64>) -> Matrix2<f64> {
        let (x, y) = (p.x, p.y);
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        let slope = self.k1 + r2 * (2.0 * self.k2 + 3.0 * self.k3 * r2); // d radial / d r²
        let cross = 2.0 * x * y * slope + 2.0 * (self.p1 * x + self.p2 * y);
        Matrix2::new(
            radial + 2.0 * x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x,
            cross,
            cross,
            radial + 2.0 * y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x,
        )
    }

    /// Derivative of the image by each coefficient.
    pub fn coefficient_jacobian(&self, p: Vector2<f64>) -> [Vector2<f64>; 5] {
        let (x, y, r2) = (p.x, p.y, p.norm_squared());
        [
            p * r2,
            p * (r2 * r2),
            Vector2::new(2.0 * x * y, r2 + 2.0 * y * y),
            Vector2::new(r2 + 2.0 * x * x, 2.0 * x * y),
            p * (r2 * r2 * r2),
        ]
    }

    /// Factors of the derivatives by k1, `p a`, and by k2, `p a b`.
    pub(super) fn leading_factors(p: Vector2<f64>) -> [f64; 2] {
        [p.norm_squared(); 2]
    }

    /// Point that has this image; `None` beyond the fold.
    pub fn undistort(&self, distorted: Vector2<f64>) -> Option<Vector2<f64>> {
        if *self == Self::NONE { Some(distorted) } else { self.inverse(distorted) }
    }

    /// Normalised radius up to which the radial polynomial grows, so that images are unique: the smallest positive root
    /// of `d(r · radial(r))/dr = 1 + 3 k1 r² + 5 k2 r⁴ + 7 k3 r⁶`.
    pub fn max_radius(&self) -> f64 {
        let roots = real_roots_of_cubic(7.0 * self.k3, 5.0 * self.k2, 3.0 * self.k1, 1.0);
        let smallest = roots.into_iter().flatten().filter(|s| *s > 0.0).fold(f64::INFINITY, f64::min);
        smallest.sqrt()
    }
}

impl PlaneMap for BrownConrady {
    fn distort(&self, p: Vector2<f64>) -> Vector2<f64> {
        Self::distort(self, p)
    }

    fn jacobian(&self, p: Vector2<f64>) -> Matrix2<f64> {
        Self::jacobian(self, p)
    }

    fn radial_image(&self, radius: f64) -> f64 {
        let radial = Self { p1: 0.0, p2: 0.0, ..*self };
        Self::distort(&radial, Vector2::new(radius, 0.0)).x
    }

    fn max_radius(&self) -> f64 {
        Self::max_radius(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    /// EPFL terrace camera C1: a real lens with strong barrel distortion.
    const TERRACE: BrownConrady =
        BrownConrady { k1: -0.232_082_596, k2: 0.152_229_992, p1: 0.0, p2: 0.0, k3: -0.086_640_693 };

    fn lens() -> impl Strategy<Value = BrownConrady> {
        (-0.3..0.3, -0.1..0.1, -0.01..0.01, -0.01..0.01, -0.02..0.02)
            .prop_map(|(k1, k2, p1, p2, k3)| BrownConrady { k1, k2, p1, p2, k3 })
    }

    proptest! {
        #[test]
        fn undistort_inverts_distort(d in lens(), x in -0.6..0.6, y in -0.5..0.5) {
            let p = Vector2::new(x, y);
            prop_assume!(p.norm() < 0.9 * d.max_radius());
            let back = d.undistort(d.distort(p)).unwrap();
            prop_assert!((back - p).norm() < 1e-9, "{p:?} came back as {back:?}");
        }

        /// Lenses of all kinds, up to the radius at which their images fold: the slopes of some mislead Newton's full
        /// steps.
        #[test]
        fn every_image_has_its_ray(
            (k1, k2, k3) in (-0.4..0.25, -0.1..0.15, -0.02..0.02),
            (p1, p2) in (-0.01..0.01, -0.01..0.01),
            (x, y) in (-1.4..1.4, -1.0..1.0),
        ) {
            let d = BrownConrady { k1, k2, p1, p2, k3 };
            let p = Vector2::new(x, y);
            prop_assume!(p.norm() < 0.9 * d.max_radius());
            let back = d.undistort(d.distort(p)).unwrap();
            prop_assert!((back - p).norm() < 1e-8, "{p:?} came back as {back:?}");
        }

        #[test]
        fn jacobian_matches_finite_differences(d in lens(), x in -0.8..0.8, y in -0.6..0.6) {
            let (p, step) = (Vector2::new(x, y), 1e-6);
            let analytic = d.jacobian(p);
            for axis in 0..2 {
                let mut delta = Vector2::zeros();
                delta[axis] = step;
                let numeric = (d.distort(p + delta) - d.distort(p - delta)) / (2.0 * step);
                prop_assert!((analytic.column(axis) - numeric).norm() < 1e-8);
            }
        }
    }

    #[test]
    fn a_real_lens_round_trips_over_its_image() {
        for (u, v) in [(0.0, 0.0), (359.0, 287.0), (183.0, 152.0), (359.0, 0.0)] {
            let distorted = Vector2::new((u - 183.257) / 438.3, (v - 152.917) / 438.3);
            let p = TERRACE.undistort(distorted).unwrap();
            assert_relative_eq!(TERRACE.distort(p), distorted, epsilon = 1e-10);
        }
    }

    proptest! {
        #[test]
        fn images_are_unique_up_to_the_fold_and_no_further(k1 in -0.5..0.5, k2 in -0.2..0.2, k3 in -0.1..0.1) {
            let d = BrownConrady { k1, k2, k3, ..BrownConrady::NONE };
            let image = |r: f64| d.distort(Vector2::new(r, 0.0)).x;
            let fold = d.max_radius();
            for i in 0..200 {
                let r = fold.min(5.0) * i as f64 / 200.0;
                prop_assert!(image(r + 1e-6) >= image(r), "falls at {r}, before the fold at {fold}");
            }
            if fold < 1e3 {
                // A tangent zero of the slope does not turn the image back; anything else does.
                let (before, at, after) = (image(0.999 * fold), image(fold), image(1.001 * fold));
                prop_assert!(at >= before && (after <= at || (after - at) < 1e-5 * at.abs()));
            }
        }
    }

    /// Far from its fold, and Newton's steps from the distorted point go to and fro between this lens's centre and its fold.
    #[test]
    fn a_lens_that_pulls_outwards_before_it_folds_round_trips() {
        let d = BrownConrady::from([-0.0956, 0.144, 0.00907, 0.00734, -0.0189]);
        for i in 0..3600 {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i % 36) / 36.0).sin_cos();
            let p = Vector2::new(cos, sin) * (0.0098 * f64::from(i / 36) * d.max_radius());
            let back = d.undistort(d.distort(p));
            assert!(back.is_some_and(|back| (back - p).norm() < 1e-9), "{p:?} came back as {back:?}");
        }
    }

    #[test]
    fn beyond_the_fold_there_is_no_image() {
        let barrel = BrownConrady { k1: -0.3, ..BrownConrady::NONE };
        let fold = barrel.max_radius();
        assert_relative_eq!(fold, (1.0_f64 / 0.9).sqrt(), epsilon = 1e-9);
        let furthest = barrel.distort(Vector2::new(fold, 0.0)).x;
        assert!(barrel.undistort(Vector2::new(1.01 * furthest, 0.0)).is_none());
    }
}
