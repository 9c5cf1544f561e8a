//! A patch's sums on processors with AVX2: eight samples a vector. The same bits as [`StereoPatch::sums`] computes: products and
//! sums in the same order, none of them fused.
#![allow(clippy::inline_always)] // code that is not inlined does not get the processor's features

use std::arch::x86_64::{__m128, __m256};

use pulp::x86::V3;

use super::level::PyramidLevel;
use super::patch::{ASIDE, Affine, StereoPatch};

/// [`StereoPatch::sums`] of a patch whose image lies inside the source.
#[inline(never)]
pub(super) fn sums(cpu: V3, patch: &StereoPatch, affine: &Affine, source: &PyramidLevel) -> [f32; 3] {
    cpu.vectorize(PatchSums { cpu, patch, affine, source })
}

struct PatchSums<'a> {
    cpu: V3,
    patch: &'a StereoPatch,
    affine: &'a Affine,
    source: &'a PyramidLevel,
}

impl pulp::NullaryFnOnce for PatchSums<'_> {
    type Output = [f32; 3];

    #[inline(always)]
    fn call(self) -> [f32; 3] {
        let Self { cpu, patch, affine, source } = self;
        let avx = cpu.avx;
        let vector = |values: [f32; 8]| -> __m256 { pulp::cast(values) };
        let plus = |a: __m256, b: __m256| avx._mm256_add_ps(a, b);
        let times = |a: __m256, b: __m256| avx._mm256_mul_ps(a, b);
        let [x, y, xu, yu, xv, yv] = affine.map(|value| avx._mm256_set1_ps(value));
        let mut sums = [avx._mm256_setzero_ps(); 3];
        for (k, aside) in ASIDE.iter().enumerate() {
            let [du, dv] = aside.map(vector);
            let sx = plus(plus(x, times(xv, dv)), times(xu, du));
            let sy = plus(plus(y, times(yv, dv)), times(yu, du));
            let value = between(cpu, source, sx, sy);
            let weighted = times(pulp::cast(patch.weights[k]), value);
            sums[0] = plus(sums[0], times(pulp::cast(patch.centred[k]), value));
            sums[1] = plus(sums[1], weighted);
            sums[2] = plus(sums[2], times(weighted, value));
        }
        sums.map(|lanes| total(cpu, lanes))
    }
}

/// Sum of the lanes.
#[inline(always)]
fn total(cpu: V3, lanes: __m256) -> f32 {
    let V3 { sse, avx, .. } = cpu;
    let four = sse._mm_add_ps(avx._mm256_castps256_ps128(lanes), avx._mm256_extractf128_ps::<1>(lanes));
    let two: [f32; 4] = pulp::cast(sse._mm_add_ps(four, sse._mm_movehl_ps(four, four)));
    two[0] + two[1]
}

/// [`PyramidLevel::between`] at eight places.
#[inline(always)]
fn between(cpu: V3, level: &PyramidLevel, x: __m256, y: __m256) -> __m256 {
    let V3 { avx, avx2, .. } = cpu;
    let mixed = |a: __m256, b: __m256, share: __m256| {
        avx._mm256_add_ps(a, avx._mm256_mul_ps(share, avx._mm256_sub_ps(b, a)))
    };
    let one = avx._mm256_set1_ps(1.0);
    let (x, y) = (avx._mm256_add_ps(x, one), avx._mm256_add_ps(y, one));
    let (left, top) = (avx._mm256_cvttps_epi32(x), avx._mm256_cvttps_epi32(y));
    let fx = avx._mm256_sub_ps(x, avx._mm256_cvtepi32_ps(left));
    let fy = avx._mm256_sub_ps(y, avx._mm256_cvtepi32_ps(top));
    let stride = avx._mm256_set1_epi32(level.stride as i32);
    let index: [u32; 8] = pulp::cast(avx2._mm256_add_epi32(avx2._mm256_mullo_epi32(top, stride), left));
    let around = |lane: usize| -> __m128 {
        let index = index[lane] as usize;
        match level.padded.get(index..index + 2) {
            Some(&[[a, b], [c, d]]) => pulp::cast([a, b, c, d]),
            _ => pulp::cast([0.0_f32; 4]),
        }
    };
    // Four lanes in the lower half of a vector, the other four in the upper: a 4 × 4 transpose in each half.
    let both = |lane: usize| {
        avx._mm256_insertf128_ps::<1>(avx._mm256_castps128_ps256(around(lane)), around(lane + 4))
    };
    let (first, second, third, fourth) = (both(0), both(1), both(2), both(3));
    let (lefts, rights) = (avx._mm256_unpacklo_ps(first, second), avx._mm256_unpackhi_ps(first, second));
    let (more_lefts, more_rights) =
        (avx._mm256_unpacklo_ps(third, fourth), avx._mm256_unpackhi_ps(third, fourth));
    let tops = |a: __m256, b: __m256| avx._mm256_shuffle_ps::<0b01_00_01_00>(a, b);
    let bottoms = |a: __m256, b: __m256| avx._mm256_shuffle_ps::<0b11_10_11_10>(a, b);
    mixed(
        mixed(tops(lefts, more_lefts), tops(rights, more_rights), fx),
        mixed(bottoms(lefts, more_lefts), bottoms(rights, more_rights), fx),
        fy,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;
    use image::{Rgb, RgbImage};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use crate::dense::patch::Weights;

    #[test]
    fn the_sums_are_the_same_bits_as_those_of_other_processors() {
        let Some(cpu) = V3::try_new() else {
            eprintln!("skipped: this processor has no AVX2");
            return;
        };
        let mut random = Pcg64Mcg::seed_from_u64(1);
        let (width, height) = (61, 47);
        let picture = RgbImage::from_fn(width, height, |_, _| Rgb(random.random()));
        let filmed: Vec<bool> = (0..width * height).map(|i| i % 997 != 3).collect();
        let level =
            PyramidLevel::new(&picture, &filmed, &Intrinsics::from_horizontal_fov(width, height, 60.0));
        let weights = Weights::new(24.0);
        for _ in 0..1000 {
            let (x, y) = (random.random_range(0..width as usize), random.random_range(0..height as usize));
            let patch = StereoPatch::new(&level, x, y, &weights);
            let mut within = |least: f32, most: f32| random.random_range(least..=most);
            let [xu, yu, xv, yv] = std::array::from_fn(|_| within(-1.4, 1.4));
            // 14 pixels away from the border, where a patch of 5 by these slopes reaches none.
            let affine = [within(14.0, 46.0), within(14.0, 32.0), xu, yu, xv, yv];
            // A sum with a pixel that was not filmed is NaN, of which there are many.
            let bits = |sums: [f32; 3]| sums.map(|sum| (!sum.is_nan()).then_some(sum.to_bits()));
            assert_eq!(
                bits(sums(cpu, &patch, &affine, &level)),
                bits(patch.sums(&affine, &level)),
                "{affine:?}"
            );
        }
    }
}
