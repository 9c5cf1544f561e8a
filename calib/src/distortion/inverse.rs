//! Numerical inverse of a lens that is given as a map of the normalised plane.

use nalgebra::{Matrix2, Vector2};

/// Newton steps after which an undistortion that has not converged is given up.
const MAX_NEWTON_STEPS: usize = 50;
/// Residual on the normalised plane at which an undistortion counts as exact (1e-12 is 1e-9 px at f = 1000).
const NEWTON_TOLERANCE: f64 = 1e-12;
/// Far beyond any lens; for the search of lenses that have no fold.
const FARTHEST: f64 = 1e3;

/// A lens whose radial part grows up to a radius, with a small tangential part beside it.
pub(super) trait PlaneMap {
    /// Image of a point.
    fn distort(&self, p: Vector2<f64>) -> Vector2<f64>;
    /// Derivative of the image by the point.
    fn jacobian(&self, p: Vector2<f64>) -> Matrix2<f64>;
    /// Radius of the image of a radius, without the tangential part.
    fn radial_image(&self, radius: f64) -> f64;
    /// Radius up to which the radial part grows.
    fn max_radius(&self) -> f64;

    /// Point within [`Self::max_radius`] that has this image, by Newton's method.
    fn inverse(&self, distorted: Vector2<f64>) -> Option<Vector2<f64>> {
        let limit = self.max_radius();
        let mut start = distorted;
        if start.norm() > limit {
            start *= 0.9 * limit / start.norm();
        }
        // Lenses that pull far outwards before they fold can make Newton's full steps oscillate about the root.
        self.newton(distorted, start, limit)
            .or_else(|| self.newton(distorted, self.radial_inverse(distorted, limit), limit))
            .or_else(|| self.damped(distorted, self.radial_inverse(distorted, limit), limit))
    }

    /// Newton's method with steps that are halved until they come nearer: for lenses so flat far out that full steps go
    /// far beyond.
    fn damped(&self, distorted: Vector2<f64>, start: Vector2<f64>, limit: f64) -> Option<Vector2<f64>> {
        const HALVINGS: usize = 30;
        let off = |p: Vector2<f64>| (self.distort(p) - distorted).norm();
        let mut p = start;
        for _ in 0..MAX_NEWTON_STEPS {
            let error = off(p);
            if error < NEWTON_TOLERANCE {
                return Some(p);
            }
            let mut step = self.jacobian(p).try_inverse()? * (self.distort(p) - distorted);
            let nearer = (0..HALVINGS).find_map(|_| {
                let next = p - step;
                step *= 0.5;
                (next.norm() <= limit && off(next) < error).then_some(next)
            });
            p = nearer?;
        }
        None
    }

    /// Newton's method from a start.
    fn newton(&self, distorted: Vector2<f64>, start: Vector2<f64>, limit: f64) -> Option<Vector2<f64>> {
        let mut p = start;
        for _ in 0..MAX_NEWTON_STEPS {
            let residual = self.distort(p) - distorted;
            if residual.norm() < NEWTON_TOLERANCE {
                return (p.norm() <= limit).then_some(p);
            }
            let step = self.jacobian(p).try_inverse()? * residual;
            p -= step;
            // A step across the fold would converge to the wrong branch: come back inside.
            if p.norm() > limit {
                p *= 0.99 * limit / p.norm();
            }
        }
        None
    }

    /// The pinhole point that the radial part alone moves to `distorted`, by bisection, or the last before the fold: up
    /// to the fold the radial part only grows, and the tangential one is small beside it.
    fn radial_inverse(&self, distorted: Vector2<f64>, limit: f64) -> Vector2<f64> {
        let target = distorted.norm();
        let (mut low, mut high) = (0.0, (0.99 * limit).min(FARTHEST));
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if self.radial_image(middle) < target { low = middle } else { high = middle }
        }
        if target > 0.0 { distorted * (low / target) } else { distorted }
    }
}
