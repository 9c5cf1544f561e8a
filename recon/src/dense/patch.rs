//! A patch of the reference view: samples around a pixel, weighted so that pixels of another colour than the centre (usually
//! another surface) count little, and their sums with the samples of the patch's image in another view.
//!
//! Samples are summed eight at a time, in the same order on every processor; where it has AVX2 ([`super::avx2`]), eight are one
//! vector.

use wide::{f32x4, f32x8};

use super::level::PyramidLevel;

/// Offsets of the patch's samples in both directions: 11 × 11 pixels, every second one.
const OFFSETS: [i32; 6] = [-5, -3, -1, 1, 3, 5];
/// Number of samples of a patch.
const SAMPLES: usize = OFFSETS.len() * OFFSETS.len();
/// Number of vectors of eight samples, the last of which repeats the last sample, with no weight.
pub(super) const EIGHTS: usize = SAMPLES.div_ceil(8);
/// Offsets of the samples of each vector to the right and downwards, row by row.
pub(super) const ASIDE: [[[f32; 8]; 2]; EIGHTS] = by_eights();
/// Patch radius, pixels.
pub(super) const RADIUS: f32 = 5.0;

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

/// Place of a patch's centre in another view, and the derivatives of places there to the right and downwards in the patch: x, y,
/// ∂x/∂u, ∂y/∂u, ∂x/∂v, ∂y/∂v.
pub(super) type Affine = [f32; 6];

/// A patch of the reference view, prepared once and compared with many hypotheses.
pub(super) struct StereoPatch {
    /// Weights, summing to one.
    pub(super) weights: [f32x8; EIGHTS],
    /// Weight × (brightness − mean).
    pub(super) centred: [f32x8; EIGHTS],
    /// Weighted variance of the patch, grey levels squared.
    pub(super) variance: f32,
    /// Centre of the patch, pixels.
    pub(super) u: f32,
    pub(super) v: f32,
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

/// Sum of the lanes.
fn total(lanes: f32x8) -> f32 {
    let [a, b, c, d, e, f, g, h] = lanes.to_array();
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
