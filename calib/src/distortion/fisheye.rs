//! OpenCV's fisheye lens, `[k1, k2, k3, k4]` (J. Kannala and S. Brandt, "A generic camera model and calibration method for
//! conventional, wide-angle, and fish-eye lenses", PAMI 2006, equation 6, in the form of `cv::fisheye`).
//!
//! A ray at the angle θ from the axis meets z = 1 at the radius `r = tan θ`, and the picture at the radius
//!
//! ```text
//! θ_d = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)
//! ```
//!
//! in the same direction. All numbers zero are the equidistant lens, not a pinhole. Rays more than 85° from the
//! axis have no image here: they hardly meet the plane z = 1, on which all computation takes place.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

use super::roots::smallest_crossing;

/// Angle from the axis up to which rays have an image, degrees.
pub(super) const WIDEST_DEG: f64 = 85.0;
/// Radius below which the lens is the identity to the last bit.
const NEAR_AXIS: f64 = 1e-8;

/// Coefficients of the fisheye model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 4]", into = "[f64; 4]")]
pub struct Fisheye {
    numbers: [f64; 4],
    /// Largest angle from the axis with an image, radians: up to the fold, and [`WIDEST_DEG`].
    widest: f64,
}

impl From<[f64; 4]> for Fisheye {
    fn from(numbers: [f64; 4]) -> Self {
        let [k1, k2, k3, k4] = numbers;
        let limit = WIDEST_DEG.to_radians();
        // d θ_d / d θ as a polynomial in θ².
        let growth = [1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3, 9.0 * k4];
        let fold = smallest_crossing(&growth, limit * limit).map(f64::sqrt);
        Self { numbers, widest: fold.unwrap_or(limit) }
    }
}

impl From<Fisheye> for [f64; 4] {
    fn from(d: Fisheye) -> Self {
        d.numbers
    }
}

impl Fisheye {
    /// Coefficients in OpenCV's order.
    pub fn coefficients(&self) -> [f64; 4] {
        self.numbers
    }

    /// Tells whether the picture stops growing before rays end.
    pub(super) fn folds(&self) -> bool {
        self.widest < WIDEST_DEG.to_radians()
    }

    /// `θ_d` of an angle θ, and its derivative.
    fn bent(&self, theta: f64) -> (f64, f64) {
        let [k1, k2, k3, k4] = self.numbers;
        let t = theta * theta;
        let factor = 1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4)));
        let slope = 1.0 + t * (3.0 * k1 + t * (5.0 * k2 + t * (7.0 * k3 + t * 9.0 * k4)));
        (theta * factor, slope)
    }

    /// Image of a point of the normalised plane.
    pub fn distort(&self, p: Vector2<f64>) -> Vector2<f64> {
        let r = p.norm();
        if r < NEAR_AXIS {
            return p;
        }
        p * (self.bent(r.atan()).0 / r)
    }

    /// Derivative of the image by the point.
    pub fn jacobian(&self, p: Vector2<f64>) -> Matrix2<f64> {
        let r = p.norm();
        if r < NEAR_AXIS {
            return Matrix2::identity();
        }
        let (bent, slope) = self.bent(r.atan());
        // Across the radius lengths scale as the radius does, along it by its derivative.
        let (across, along) = (bent / r, slope / (1.0 + r * r));
        let outwards = p / r;
        Matrix2::identity() * across + outwards * outwards.transpose() * (along - across)
    }

    /// Derivative of the image by each coefficient.
    pub fn coefficient_jacobian(&self, p: Vector2<f64>) -> [Vector2<f64>; 4] {
        let r = p.norm();
        if r < NEAR_AXIS {
            return [Vector2::zeros(); 4];
        }
        let theta = r.atan();
        let (outwards, t) = (p / r, theta * theta);
        let first = outwards * (theta * t);
        [first, first * t, first * (t * t), first * (t * t * t)]
    }

    /// Factors of the derivatives by k1, `p a`, and by k2, `p a b`.
    pub(super) fn leading_factors(p: Vector2<f64>) -> [f64; 2] {
        let r = p.norm();
        if r < NEAR_AXIS {
            return [0.0; 2];
        }
        let theta = r.atan();
        [theta * theta * theta / r, theta * theta]
    }

    /// Point that has this image; `None` beyond the fold, and for rays beside or behind the lens.
    pub fn undistort(&self, distorted: Vector2<f64>) -> Option<Vector2<f64>> {
        /// Steps after which neighbouring floats are reached by bisection alone.
        const STEPS: usize = 60;
        let target = distorted.norm();
        if target < NEAR_AXIS {
            return Some(distorted);
        }
        let (mut low, mut high) = (0.0, self.widest);
        let is_shown = target <= self.bent(high).0;
        if !is_shown {
            return None;
        }
        // Newton's method, which bisection keeps between two angles that enclose the root.
        let mut theta = target.min(high);
        for _ in 0..STEPS {
            let (bent, slope) = self.bent(theta);
            if bent < target {
                low = theta;
            } else {
                high = theta;
            }
            let newton = theta - (bent - target) / slope;
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - theta).abs() <= f64::EPSILON * theta {
                theta = next;
                break;
            }
            theta = next;
        }
        Some(distorted * (theta.tan() / target))
    }

    /// Radius on the plane z = 1 up to which points have an image.
    pub fn max_radius(&self) -> f64 {
        self.widest.tan()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn lens() -> impl Strategy<Value = Fisheye> {
        (-0.1..0.1, -0.03..0.03, -0.01..0.01, -0.003..0.003)
            .prop_map(|(k1, k2, k3, k4)| Fisheye::from([k1, k2, k3, k4]))
    }

    fn ray(theta: f64, direction: f64) -> Vector2<f64> {
        Vector2::new(direction.cos(), direction.sin()) * theta.tan()
    }

    proptest! {
        #[test]
        fn undistort_inverts_distort(d in lens(), theta in 0.0..1.48f64, direction in 0.0..std::f64::consts::TAU) {
            prop_assume!(theta < 0.99 * d.widest);
            let p = ray(theta, direction);
            let back = d.undistort(d.distort(p)).unwrap();
            // Compared by their angle: a plane point 85° away is ten times as sensitive as one in the middle.
            prop_assert!((back - p).norm() < 1e-9 * (1.0 + p.norm_squared()), "{p:?} came back as {back:?}");
        }

        #[test]
        fn derivatives_match_finite_differences(d in lens(), theta in 0.0..1.4f64, direction in 0.0..std::f64::consts::TAU) {
            let (p, step) = (ray(theta, direction), 1e-6);
            for axis in 0..2 {
                let mut delta = Vector2::zeros();
                delta[axis] = step;
                let numeric = (d.distort(p + delta) - d.distort(p - delta)) / (2.0 * step);
                prop_assert!((d.jacobian(p).column(axis) - numeric).norm() < 1e-7);
            }
            for (k, analytic) in d.coefficient_jacobian(p).into_iter().enumerate() {
                let moved = |by: f64| {
                    let mut numbers = d.coefficients();
                    numbers[k] += by;
                    Fisheye::from(numbers).distort(p)
                };
                let numeric = (moved(step) - moved(-step)) / (2.0 * step);
                prop_assert!((analytic - numeric).norm() < 1e-6 * (1.0 + numeric.norm()), "coefficient {k}");
            }
        }
    }

    #[test]
    fn an_equidistant_lens_has_its_angle_as_radius() {
        let d = Fisheye::from([0.0; 4]);
        for deg in [0.0_f64, 1e-9, 10.0, 45.0, 70.0, 84.9] {
            let image = d.distort(ray(deg.to_radians(), 0.3));
            assert_relative_eq!(image.norm(), deg.to_radians(), epsilon = 1e-12);
        }
        assert!(
            d.undistort(Vector2::new(1.47, 0.0)).is_some() && d.undistort(Vector2::new(1.49, 0.0)).is_none()
        );
        assert_relative_eq!(d.max_radius(), WIDEST_DEG.to_radians().tan());
    }

    #[test]
    fn a_lens_that_folds_has_no_ray_beyond_its_fold() {
        // 1 + 3 k1 θ² vanishes at θ = 1.
        let d = Fisheye::from([-1.0 / 3.0, 0.0, 0.0, 0.0]);
        assert_relative_eq!(d.max_radius(), 1.0_f64.tan(), epsilon = 1e-9);
        let furthest = d.distort(ray(1.0, 0.0)).x;
        assert!(d.undistort(Vector2::new(0.999 * furthest, 0.0)).is_some());
        assert!(d.undistort(Vector2::new(1.001 * furthest, 0.0)).is_none());
    }
}
