//! Lenses that fold within their own picture.
//!
//! Far from the axis a radial polynomial may stop growing and turn back: two rays then have the same pixel, and pixels farther
//! out have none. A calibration whose boards did not reach the corners gives such a lens, which is right up to there.

use nalgebra::{Point2, Vector2};

use crate::Intrinsics;

/// Number of places along the width and the height at which the picture is looked at.
const GRID: (u32, u32) = (33, 25);

/// Circle in a picture beyond which its lens model has folded back on itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensFold {
    /// Angle of its rays from the axis, degrees.
    pub angle_deg: f64,
    /// Its radius about the principal point, pixels (the mean of both axes).
    pub radius_px: f64,
    /// Share of the picture that lies beyond it and has no rays, above 0.
    pub share: f64,
}

impl Intrinsics {
    /// Fold of the lens within the picture; `None` for a lens that has a ray for every pixel, and for a fisheye whose picture
    /// only reaches farther out than rays are computed.
    pub fn fold(&self) -> Option<LensFold> {
        let radius = self.distortion.fold_radius()?;
        let bent = self.distortion.distort(Vector2::new(radius, 0.0)).norm();
        let at = |i: u32, count: u32, side: u32| f64::from(i) / f64::from(count - 1) * f64::from(side) - 0.5;
        let places = (0..GRID.1).flat_map(|y| (0..GRID.0).map(move |x| (x, y)));
        let beyond = places
            .filter(|(x, y)| {
                let pixel = Point2::new(at(*x, GRID.0, self.width), at(*y, GRID.1, self.height));
                self.unproject(&pixel).is_none()
            })
            .count();
        let share = beyond as f64 / f64::from(GRID.0 * GRID.1);
        let radius_px = bent * (self.fx * self.fy).sqrt();
        (beyond > 0).then(|| LensFold { angle_deg: radius.atan().to_degrees(), radius_px, share })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Distortion, Fisheye, Rational};

    fn camera(fov_deg: f64, distortion: impl Into<Distortion>) -> Intrinsics {
        Intrinsics { distortion: distortion.into(), ..Intrinsics::from_horizontal_fov(640, 480, fov_deg) }
    }

    #[test]
    fn a_polynomial_folds_where_its_derivative_vanishes() {
        // r (1 + k r²) stops growing at r = 1 / √(−3 k), where it has reached two thirds of r.
        let k = -0.3_f64;
        let lens = camera(100.0, [k, 0.0, 0.0, 0.0, 0.0]);
        let r = (-1.0 / (3.0 * k)).sqrt();
        let fold = lens.fold().unwrap();
        assert!((fold.angle_deg - r.atan().to_degrees()).abs() < 1e-6, "{fold:?}");
        assert!((fold.radius_px - 2.0 / 3.0 * r * lens.fx).abs() < 1e-6, "{fold:?}");
        // Pixels of the whole picture that lie outside that circle.
        let outside = (0..640 * 480).filter(|i| {
            let (x, y) = (f64::from(i % 640) - lens.cx, f64::from(i / 640) - lens.cy);
            x.hypot(y) > fold.radius_px
        });
        let share = outside.count() as f64 / (640.0 * 480.0);
        assert!(share > 0.05 && (fold.share - share).abs() < 0.05, "{fold:?} {share}");
    }

    #[test]
    fn lenses_that_fold_outside_their_picture_or_not_at_all_are_no_fault() {
        assert_eq!(camera(100.0, Distortion::NONE).fold(), None);
        assert_eq!(camera(45.0, [-0.3, 0.0, 0.0, 0.0, 0.0]).fold(), None);
        assert_eq!(camera(70.0, [-0.35, 0.12, 0.0, 0.0, 0.0]).fold(), None);
        assert_eq!(camera(100.0, Rational::from([0.0; 8])).fold(), None);
        // The picture of a lens of 180° reaches farther than rays are computed: that is no fold.
        let wide = Intrinsics { fx: 204.0, fy: 204.0, ..camera(60.0, Fisheye::from([0.0; 4])) };
        assert!(wide.unproject(&Point2::new(0.0, 0.0)).is_none());
        assert_eq!(wide.fold(), None);
        let folding = Intrinsics { distortion: Fisheye::from([-0.2, 0.0, 0.0, 0.0]).into(), ..wide };
        // θ (1 − 0.2 θ²) stops growing at θ² = 1 / 0.6.
        let angle = (1.0_f64 / 0.6).sqrt().to_degrees();
        assert!((folding.fold().unwrap().angle_deg - angle).abs() < 1e-6, "{:?}", folding.fold());
    }
}
