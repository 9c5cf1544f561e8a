//! Cost of a plane hypothesis for a patch in another view: normalised cross-correlation, weighted so that pixels of
//! another colour than the centre (usually another surface) count little.
//!
//! A patch's samples are summed eight at a time, in the same order on every processor; where it has AVX2 ([`super::avx2`]),
//! eight are one vector.

use wide::{f32x4, f32x8};

use super::level::{PyramidLevel, ViewMapping};
use super::support::Support;

/// Offsets of the patch's samples in both directions: 11 × 11 pixels, every second one.
const OFFSETS: [i32; 6] = [-5, -3, -1, 1, 3, 5];
/// Number of samples of a patch.
const SAMPLES: usize = OFFSETS.len() * OFFSETS.len();
/// Number of vectors of eight samples, the last of which repeats the last sample, with no weight.
pub(super) const EIGHTS: usize = SAMPLES.div_ceil(8);
/// Offsets of the samples of each vector to the right and downwards, row by row.
pub(super) const ASIDE: [[[f32; 8]; 2]; EIGHTS] = by_eights();
/// Patch radius, pixels.
const RADIUS: f32 = 5.0;
/// Cost of a hypothesis outside the source image or where it was not filmed, and of one for which no correlation can be
/// computed.
pub(super) const WORST: f32 = 2.0;

/// Bilateral weights of the support, tabulated over the difference in brightness.
pub(super) struct Weights {
    by_difference: [f32; 256],
    by_place: [f32; SAMPLES],
}

impl Weights {
    /// `sigma` is the difference in grey levels at which a sample's weight has fallen to 1/e.
    pub(super) fn new(sigma: f32) -> Self {
        Self {
            by_difference: std::array::from_fn(|d| (-(d as f32) / sigma).exp()),
            by_place: std::array::from_fn(|i| {
                let (du, dv) = offset(i);
                (-(du * du + dv * dv) / (2.0 * RADIUS * RADIUS)).exp()
            }),
        }
    }
}

const fn by_eights() -> [[[f32; 8]; 2]; EIGHTS] {
    let mut aside = [[[0.0; 8]; 2]; EIGHTS];
    let mut i = 0;
    while i < 8 * EIGHTS {
        let sample = if i < SAMPLES { i } else { SAMPLES - 1 };
        aside[i / 8][0][i % 8] = OFFSETS[sample % OFFSETS.len()] as f32;
        aside[i / 8][1][i % 8] = OFFSETS[sample / OFFSETS.len()] as f32;
        i += 1;
    }
    aside
}

fn offset(i: usize) -> (f32, f32) {
    (OFFSETS[i % OFFSETS.len()] as f32, OFFSETS[i / OFFSETS.len()] as f32)
}

/// A patch of the reference view, prepared once and compared with many hypotheses.
pub(super) struct StereoPatch {
    /// Weights, summing to one.
    pub(super) weights: [f32x8; EIGHTS],
    /// Weight × (brightness − mean).
    pub(super) centred: [f32x8; EIGHTS],
    /// Weighted variance of the patch, grey levels squared.
    pub(super) variance: f32,
    u: f32,
    v: f32,
}

impl StereoPatch {
    pub(super) fn new(reference: &PyramidLevel, x: usize, y: usize, table: &Weights) -> Self {
        let reach = RADIUS as usize;
        if x >= reach && y >= reach && x + reach < reference.width && y + reach < reference.height {
            // Away from the border samples need no bounds check.
            let row = |dv: i32| reference.row(x - reach, (y as i32 + dv) as usize, 2 * reach + 1);
            let rows = OFFSETS.map(row);
            return Self::of_samples(x, y, table, reference.at(x as isize, y as isize), |i, j| {
                Some(rows[j][2 * i][0])
            });
        }
        let at = |du: i32, dv: i32| {
            let (sx, sy) = (x as isize + du as isize, y as isize + dv as isize);
            let inside =
                sx >= 0 && sy >= 0 && sx < reference.width as isize && sy < reference.height as isize;
            inside.then(|| reference.at(sx, sy))
        };
        Self::of_samples(x, y, table, reference.at(x as isize, y as isize), |i, j| at(OFFSETS[i], OFFSETS[j]))
    }

    /// `value`: the sample at the i-th offset to the right and the j-th downwards; `None` outside the image. A patch around a
    /// pixel that was not filmed has a variance of NaN.
    #[inline]
    fn of_samples(
        x: usize,
        y: usize,
        table: &Weights,
        centre: f32,
        value: impl Fn(usize, usize) -> Option<f32>,
    ) -> Self {
        let mut weights = [0.0; 8 * EIGHTS];
        let mut values = [0.0; SAMPLES];
        let (mut total, mut sum) = (0.0, 0.0);
        for j in 0..OFFSETS.len() {
            for i in 0..OFFSETS.len() {
                let Some(value) = value(i, j).filter(|value| !value.is_nan()) else { continue };
                let k = j * OFFSETS.len() + i;
                let difference = ((value - centre).abs() as usize).min(255);
                let weight = table.by_difference[difference] * table.by_place[k];
                (weights[k], values[k]) = (weight, value);
                total += weight;
                sum += weight * value;
            }
        }
        let (scale, mean) = (1.0 / total, if centre.is_nan() { f32::NAN } else { sum / total });
        let mut centred = [0.0; 8 * EIGHTS];
        let mut variance = 0.0;
        for i in 0..SAMPLES {
            weights[i] *= scale;
            centred[i] = weights[i] * (values[i] - mean);
            variance += centred[i] * (values[i] - mean);
        }
        let eights = |all: [f32; 8 * EIGHTS]| {
            std::array::from_fn(|k| f32x8::new(std::array::from_fn(|lane| all[8 * k + lane])))
        };
        Self { weights: eights(weights), centred: eights(centred), variance, u: x as f32, v: y as f32 }
    }

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

    /// Sums of the patch's centred values times those of its image, of the image's weighted values, and of its weighted squares.
    /// Samples beyond the source's border are those at the border.
    pub(super) fn sums(&self, affine: &Affine, source: &PyramidLevel) -> [f32; 3] {
        let [x, y, xu, yu, xv, yv] = affine.map(f32x4::splat);
        let [right, bottom] = [source.width, source.height].map(|side| f32x4::splat(side as f32 - 1.0));
        let within = |at: f32x4, last: f32x4| at.fast_max(f32x4::ZERO).fast_min(last);
        let mut sums = [f32x8::ZERO; 3];
        for (k, aside) in ASIDE.iter().enumerate() {
            let four = |first: usize| -> [f32; 4] {
                let [du, dv] = aside.map(|eight| f32x4::new(std::array::from_fn(|lane| eight[first + lane])));
                let (sx, sy) = (x + xv * dv + xu * du, y + yv * dv + yu * du);
                source.between(within(sx, right), within(sy, bottom)).to_array()
            };
            let ([a, b, c, d], [e, f, g, h]) = (four(0), four(4));
            let value = f32x8::new([a, b, c, d, e, f, g, h]);
            let weighted = self.weights[k] * value;
            sums[0] += self.centred[k] * value;
            sums[1] += weighted;
            sums[2] += weighted * value;
        }
        sums.map(total)
    }
}

/// Place of a patch's centre in another view, and the derivatives of places there to the right and downwards in the patch: x, y,
/// ∂x/∂u, ∂y/∂u, ∂x/∂v, ∂y/∂v.
pub(super) type Affine = [f32; 6];

/// Sum of the lanes.
fn total(lanes: f32x8) -> f32 {
    let [a, b, c, d, e, f, g, h] = lanes.to_array();
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[cfg(test)]
mod tests {
    use super::*;
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
