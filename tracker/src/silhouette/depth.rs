//! Static depth of a view, laid out so that the visible part of a body is found for 64 pixels at a time.
//!
//! Beside each pixel's depth there is a bit a pixel for each of many depth levels: whether the pixel is at that level
//! or beyond. A pixel of a body is certainly visible if it is beyond the level of the farthest point that the camera
//! sees, and certainly hidden if it is before the level of the nearest; only pixels between are computed one by one.

use super::ImageConic;

/// Number of pixels of a row whose depths are compared together; a divisor of a word's 64.
const STRETCH: usize = 8;
/// Mask of a stretch's pixels.
const STRETCH_BITS: u64 = (1 << STRETCH) - 1;
/// Number of last bits of a depth that the finest level ignores: 32 levels from one power of two to the next, at 5 m an
/// eighth of a metre apart.
const FINEST_LEVEL_BITS: u32 = 18;
/// Number of last bits at which all positive numbers are of one level.
const COARSEST_LEVEL_BITS: u32 = 31;
/// Largest number of words of all planes (1 MiB), which have to stay in the cache: levels are made coarser until they
/// fit, if they can.
const MOST_WORDS: usize = 1 << 17;

/// Depth along z of the static room for each pixel, metres; infinite where nothing is hit, 0 where everything is
/// hidden.
#[derive(Debug, Clone)]
pub(super) struct StaticDepth {
    /// Rows are padded to whole stretches.
    z_m: Vec<[f32; STRETCH]>,
    stretches_per_row: usize,
    words_per_row: usize,
    level_bits: u32,
    /// Nearest level at which anything is.
    first_level: u32,
    /// For each level from the first to one that only infinity reaches: the pixels at it or beyond, packed row by row.
    planes: Vec<Vec<u64>>,
}

impl StaticDepth {
    /// The depths `z_m(u, v)` of an image of this size.
    pub(super) fn new(width: u32, height: u32, z_m: impl Fn(u32, u32) -> f32) -> Self {
        let stretches_per_row = (width as usize).div_ceil(STRETCH);
        let words_per_row = (width as usize).div_ceil(64);
        // Right of the image everything is hidden.
        let depth = |u: u32, v: u32| if u < width { z_m(u, v) } else { 0.0 };
        let z_m: Vec<[f32; STRETCH]> = (0..height)
            .flat_map(|v| (0..stretches_per_row as u32).map(move |stretch| (stretch * STRETCH as u32, v)))
            .map(|(first, v)| std::array::from_fn(|i| depth(first + i as u32, v)))
            .collect();
        let finite = || z_m.iter().flatten().filter(|z| **z > 0.0 && z.is_finite());
        let nearest = finite().copied().reduce(f32::min).unwrap_or(1.0);
        let farthest = finite().copied().reduce(f32::max).unwrap_or(1.0);
        let plane_words = words_per_row * height as usize;
        let planes = |bits: u32| (level(farthest, bits) - level(nearest, bits)) as usize + 2;
        let level_bits = (FINEST_LEVEL_BITS..COARSEST_LEVEL_BITS)
            .find(|bits| planes(*bits) * plane_words <= MOST_WORDS)
            .unwrap_or(COARSEST_LEVEL_BITS);
        let mut depth = Self {
            planes: vec![vec![0; plane_words]; planes(level_bits)],
            first_level: level(nearest, level_bits),
            level_bits,
            z_m,
            stretches_per_row,
            words_per_row,
        };
        depth.fill_planes();
        depth
    }

    fn fill_planes(&mut self) {
        for (i, stretch) in self.z_m.iter().enumerate() {
            let (v, u) = (i / self.stretches_per_row, i % self.stretches_per_row * STRETCH);
            for (u, z_m) in (u..).zip(stretch).filter(|(_, z_m)| **z_m > 0.0) {
                let plane = self.plane_of(level(*z_m, self.level_bits));
                self.planes[plane][v * self.words_per_row + u / 64] |= 1 << (u % 64);
            }
        }
        for nearer in (1..self.planes.len()).rev() {
            let (before, beyond) = self.planes.split_at_mut(nearer);
            for (bits, beyond) in before[nearer - 1].iter_mut().zip(&beyond[0]) {
                *bits |= beyond;
            }
        }
    }

    /// Index of the plane of the pixels at a level or beyond.
    fn plane_of(&self, level: u32) -> usize {
        (level.saturating_sub(self.first_level) as usize).min(self.planes.len() - 1)
    }

    /// Visibility of a body whose visible points are no nearer than `from_m` and no farther than `to_m`.
    pub(super) fn visibility(&self, from_m: f64, to_m: f64) -> Visibility<'_> {
        // Rounded outwards, so that exact contact, as of a body with a wall, is decided pixel by pixel.
        let [from_m, to_m] = [(from_m as f32).next_down(), (to_m as f32).next_up()];
        Visibility {
            depth: self,
            reached: &self.planes[self.plane_of(level(from_m, self.level_bits))],
            beyond: &self.planes[self.plane_of(level(to_m, self.level_bits) + 1)],
        }
    }

    /// Depth at a pixel, metres.
    pub(super) fn z_m(&self, u: u32, v: u32) -> f32 {
        self.z_m[v as usize * self.stretches_per_row + u as usize / STRETCH][u as usize % STRETCH]
    }
}

/// Level of a depth: the bits of positive floats are ordered like their values.
fn level(z_m: f32, level_bits: u32) -> u32 {
    if z_m > 0.0 { z_m.to_bits() >> level_bits } else { 0 }
}

/// Visibility of one body before the static room.
#[derive(Debug, Clone, Copy)]
pub(super) struct Visibility<'a> {
    depth: &'a StaticDepth,
    /// Pixels at which the body may be visible.
    reached: &'a [u64],
    /// Pixels at which the body is visible, whichever side of it the pixel shows.
    beyond: &'a [u64],
}

impl Visibility<'_> {
    /// Visible pixels among a word's `pixels` in row `v`, all of which lie on the body of this image.
    #[inline]
    pub(super) fn of(&self, v: i32, word: usize, pixels: u64, conic: &ImageConic) -> u64 {
        let at = v as usize * self.depth.words_per_row + word;
        let beyond = self.beyond[at];
        let doubtful = pixels & self.reached[at] & !beyond;
        let seen = pixels & beyond;
        if doubtful == 0 { seen } else { seen | self.in_front(v, word, doubtful, conic) }
    }

    /// Pixels at which the body is in front, computed one by one.
    #[inline(never)]
    fn in_front(&self, v: i32, word: usize, pixels: u64, conic: &ImageConic) -> u64 {
        let stretches = v as usize * self.depth.stretches_per_row;
        let row = conic.row(v);
        let (mut seen, mut rest) = (0, pixels);
        while rest != 0 {
            let part = rest.trailing_zeros() as usize / STRETCH * STRETCH;
            let u = word * 64 + part;
            let in_front = row.is_in_front_of(u as i32, &self.depth.z_m[stretches + u / STRETCH]);
            seen |= u64::from(in_front) << part;
            rest &= !(STRETCH_BITS << part);
        }
        seen & pixels
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Depths of which some are 0, some infinite and some NaN.
    fn irregular(rng: &mut Pcg64Mcg) -> f32 {
        match rng.random_range(0..10) {
            0 => 0.0,
            1 => f32::INFINITY,
            2 => f32::NAN,
            _ => rng.random_range(0.05..30.0),
        }
    }

    /// From an image so small that its levels are the finest, to one for which not even two planes fit.
    #[test]
    fn certain_pixels_agree_with_single_comparisons_at_any_image_size() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let mut bits_of_levels = Vec::new();
        for (width, height) in [(1, 1), (70, 40), (640, 480), (1920, 1080), (3840, 2304)] {
            let z_m: Vec<f32> = (0..width * height).map(|_| irregular(&mut rng)).collect();
            let at = |u: u32, v: u32| z_m[(v * width + u) as usize];
            let depth = StaticDepth::new(width, height, at);
            bits_of_levels.push(depth.level_bits);
            for _ in 0..5 {
                let from_m = rng.random_range(-1.0..20.0);
                // Some depths are met exactly.
                let to_m =
                    if rng.random() { f64::from(at(0, 0)) } else { from_m + rng.random_range(0.0..2.0) };
                let to_m = if to_m.is_nan() { from_m } else { to_m };
                let visibility = depth.visibility(from_m, to_m);
                for _ in 0..2000 {
                    let (u, v) = (rng.random_range(0..width), rng.random_range(0..height));
                    let word = v as usize * depth.words_per_row + u as usize / 64;
                    let has = |plane: &[u64]| plane[word] >> (u % 64) & 1 == 1;
                    let z_m = at(u, v);
                    assert!(!has(visibility.beyond) || f64::from(z_m) > to_m, "{z_m} is not beyond {to_m}");
                    let is_before = !(z_m > 0.0 && f64::from(z_m) >= from_m);
                    assert!(has(visibility.reached) || is_before, "{z_m} is not before {from_m}");
                }
            }
        }
        assert_eq!(bits_of_levels[..2], [FINEST_LEVEL_BITS; 2]);
        assert!(bits_of_levels.is_sorted() && bits_of_levels[2] > FINEST_LEVEL_BITS);
    }

    #[test]
    fn a_body_is_told_from_what_is_a_hands_breadth_before_or_behind_it() {
        let depth = StaticDepth::new(64, 1, |u, _| 3.0 + 0.05 * u as f32);
        let visibility = depth.visibility(4.0, 4.5);
        let first = |plane: &[u64]| 3.0 + 0.05 * f64::from(plane[0].trailing_zeros());
        assert!((3.8..=4.0).contains(&first(visibility.reached)), "{}", first(visibility.reached));
        assert!((4.5..4.7).contains(&first(visibility.beyond)), "{}", first(visibility.beyond));
    }
}
