//! Cost of a plane hypothesis for a patch in another view: normalised cross-correlation of the patch's weighted samples.

use super::level::{PyramidLevel, ViewMapping};
use super::patch::{Affine, RADIUS, StereoPatch};
use super::support::Support;

/// Cost of a hypothesis outside the source image or where it was not filmed, and of one for which no correlation can be
/// computed.
pub(super) const WORST: f32 = 2.0;

impl StereoPatch {
    /// 1 − correlation of the patch with its image under `support` in `source`: 0 … [`WORST`].
    #[inline]
    pub(super) fn cost(&self, support: &Support, source: &PyramidLevel, pair: &ViewMapping) -> f32 {
        let [hx, hy, hz] = pair.map(self.u, self.v, support.w);
        if hz <= 1e-6 || self.variance.is_nan() {
            return WORST;
        }
        let inverse = 1.0 / hz;
        let (x, y) = (hx * inverse, hy * inverse);
        let (right, bottom) = (source.width as f32 - 1.0, source.height as f32 - 1.0);
        if !(x >= 0.0 && y >= 0.0 && x <= right && y <= bottom) {
            return WORST;
        }
        // The homography's derivative at the patch's centre: over 11 pixels an affine map is as good.
        let column = |c: usize, g: f32| -> (f32, f32) {
            let d: [f32; 3] = std::array::from_fn(|r| pair.a[r][c] + pair.b[r] * g);
            ((d[0] - x * d[2]) * inverse, (d[1] - y * d[2]) * inverse)
        };
        let ((xu, yu), (xv, yv)) = (column(0, support.gu), column(1, support.gv));
        let (reach_x, reach_y) = (RADIUS * (xu.abs() + xv.abs()), RADIUS * (yu.abs() + yv.abs()));
        let affine = [x, y, xu, yu, xv, yv];
        let sums = if x >= reach_x && y >= reach_y && x + reach_x <= right && y + reach_y <= bottom {
            self.sums_inside(&affine, source)
        } else if reach_x < 0.1 * right {
            self.sums(&affine, source)
        } else {
            return WORST;
        };
        let [covariance, mean, square] = sums;
        let variance = square - mean * mean;
        // Deviations below a grey level are noise; the constant gives flat patches the cost one instead of a random
        // one.
        let norm = (self.variance.max(0.05) * variance.max(0.05)).sqrt();
        let cost = 1.0 - covariance / norm;
        if cost.is_nan() { WORST } else { cost.clamp(0.0, WORST) }
    }

    /// [`Self::sums`] of a patch whose image lies inside the source.
    #[inline]
    fn sums_inside(&self, affine: &Affine, source: &PyramidLevel) -> [f32; 3] {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            return super::avx2::sums(avx2, self, affine, source);
        }
        self.sums(affine, source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dense::patch::Weights;
    use calib::Intrinsics;
    use image::{Rgb, RgbImage};
    use nalgebra::{Isometry3, Point2, Point3, Vector3};

    /// A slanted textured plane, 1/z = 0.4 + 0.1 x (in z = 1 coordinates), seen from the identity and from 0.3 to the side.
    fn views() -> (PyramidLevel, PyramidLevel, ViewMapping, Intrinsics) {
        let k = Intrinsics::from_horizontal_fov(160, 120, 60.0);
        let texture = |p: &Point3<f64>| {
            let value =
                120.0 + 50.0 * (29.0 * p.x + 13.0 * p.y).sin() + 40.0 * (31.0 * p.y - 12.0 * p.x).cos();
            Rgb([value as u8; 3])
        };
        // n·X = 1 with n = (0.1, 0, 0.4).
        let seen_from = |centre: f64| {
            RgbImage::from_fn(160, 120, |u, v| {
                let ray = k.unproject(&Point2::new(u as f64, v as f64)).unwrap();
                let t = (1.0 - 0.1 * centre) / (0.1 * ray.x + 0.4 * ray.z);
                texture(&(Point3::new(centre, 0.0, 0.0) + t * ray))
            })
        };
        let source_from_reference = Isometry3::translation(-0.3, 0.0, 0.0);
        let pair = ViewMapping::new(&k, &k, &source_from_reference);
        let level = |picture| PyramidLevel::new(&picture, &vec![true; 160 * 120], &k);
        (level(seen_from(0.0)), level(seen_from(0.3)), pair, k)
    }

    #[test]
    fn the_true_plane_costs_nothing_and_others_more() {
        let (reference, source, pair, k) = views();
        let n = Vector3::new(0.1 / k.fx, 0.0, 0.0);
        for (x, y) in [(60, 40), (80, 60), (100, 90)] {
            let ray = k.unproject(&Point2::new(x as f64, y as f64)).unwrap();
            let truth = Support { w: (0.4 + 0.1 * ray.x) as f32, gu: n.x as f32, gv: 0.0 };
            let patch = StereoPatch::new(&reference, x, y, &Weights::new(24.0));
            let at = |w: f32| patch.cost(&Support { w, ..truth }, &source, &pair);
            assert!(at(truth.w) < 0.02, "{}", at(truth.w));
            for wrong in [0.9, 0.95, 1.05, 1.1] {
                assert!(at(truth.w) + 0.01 < at(truth.w * wrong), "{wrong}: {}", at(truth.w * wrong));
            }
        }
    }

    #[test]
    fn outside_the_source_nothing_is_believed() {
        let (reference, source, pair, _) = views();
        let patch = StereoPatch::new(&reference, 5, 60, &Weights::new(24.0));
        let near = Support { w: 5.0, gu: 0.0, gv: 0.0 };
        assert!(patch.cost(&near, &source, &pair) >= WORST);
        let behind = Support { w: f32::NAN, gu: 0.0, gv: 0.0 };
        assert!(patch.cost(&behind, &source, &pair) >= WORST);
    }

    #[test]
    fn what_was_not_filmed_matches_nothing() {
        let k = Intrinsics::from_horizontal_fov(160, 120, 60.0);
        let here = ViewMapping::new(&k, &k, &Isometry3::identity());
        let picture = RgbImage::from_fn(160, 120, |u, v| Rgb([(7 * u + 3 * v + u * v / 5) as u8; 3]));
        // The lens's picture ends at column 80.
        let ends: Vec<bool> = (0..160 * 120).map(|i| i % 160 < 80).collect();
        let [whole, ending] =
            [vec![true; 160 * 120], ends].map(|filmed| PyramidLevel::new(&picture, &filmed, &k));
        let wall = Support { w: 0.25, gu: 0.0, gv: 0.0 };
        let cost = |x, reference, source| {
            StereoPatch::new(reference, x, 60, &Weights::new(24.0)).cost(&wall, source, &here)
        };
        for x in [0, 40, 70] {
            assert!(cost(x, &ending, &ending) < 1e-3 && cost(x, &whole, &ending) < 1e-3, "{x}");
        }
        // The pixel before the end is compared by the half of its patch that was filmed, with a view that shows it whole.
        assert!(cost(79, &ending, &whole) < 1e-3 && cost(79, &whole, &ending) >= WORST);
        for x in [80, 82, 120, 159] {
            assert!(cost(x, &ending, &whole) >= WORST && cost(x, &whole, &ending) >= WORST, "{x}");
        }
    }
}
