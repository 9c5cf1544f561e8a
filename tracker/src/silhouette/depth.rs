//! The static depth of a view, laid out so that what it leaves of a body is found 64 pixels at a time.
//!
//! Beside each pixel's depth there is a bit a pixel for each of many levels of depth: whether the pixel is at that level or
//! beyond. Of a body, a pixel is surely visible that is beyond the level of the farthest point the camera sees, surely
//! hidden one that is before the level of the nearest; only what lies between is worked out, pixel by pixel.

use super::ImageConic;

/// Pixels of a row whose depths are compared together; a divisor of a word.
const STRETCH: usize = 8;
/// The pixels of a stretch, as bits.
const STRETCH_BITS: u64 = (1 << STRETCH) - 1;
/// A level is what depths have in common when this many of their last bits are taken off: 32 levels from one power of two
/// to the next, at 5 m an eighth of a metre apart.
const FINEST_LEVEL_BITS: u32 = 18;
/// All positive numbers are of one level.
const COARSEST_LEVEL_BITS: u32 = 31;
/// Levels are made coarser until their bits take no more words than this (1 MiB), if they can: they have to stay in the cache.
const MOST_WORDS: usize = 1 << 17;

/// Per pixel, the depth along z at which the static room is; infinite where nothing is, 0 where everything is hidden.
#[derive(Debug, Clone)]
pub(super) struct StaticDepth {
    /// A row is filled up to whole stretches.
    z_m: Vec<[f32; STRETCH]>,
    stretches_per_row: usize,
    words_per_row: usize,
    level_bits: u32,
    /// The nearest level at which anything is.
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

    /// The plane of the pixels at a level or beyond.
    fn plane_of(&self, level: u32) -> usize {
        (level.saturating_sub(self.first_level) as usize).min(self.planes.len() - 1)
    }

    /// Made ready for a body of which the camera sees nothing nearer than `from_m` or farther than `to_m`.
    pub(super) fn sight(&self, from_m: f64, to_m: f64) -> Sight<'_> {
        // Rounded to where they are sure, also where they are met exactly, as when a body touches a wall.
        let [from_m, to_m] = [(from_m as f32).next_down(), (to_m as f32).next_up()];
        Sight {
            depth: self,
            reached: &self.planes[self.plane_of(level(from_m, self.level_bits))],
            beyond: &self.planes[self.plane_of(level(to_m, self.level_bits) + 1)],
        }
    }

    /// The depth at a pixel.
    pub(super) fn z_m(&self, u: u32, v: u32) -> f32 {
        self.z_m[v as usize * self.stretches_per_row + u as usize / STRETCH][u as usize % STRETCH]
    }
}

/// The number of a depth's level: the bits of positive numbers are ordered as the numbers are.
fn level(z_m: f32, level_bits: u32) -> u32 {
    if z_m > 0.0 { z_m.to_bits() >> level_bits } else { 0 }
}

/// What the static room leaves of one body.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight<'a> {
    depth: &'a StaticDepth,
    /// Where the body may be visible.
    reached: &'a [u64],
    /// Where it is, whichever side of the body a pixel looks at.
    beyond: &'a [u64],
}

impl Sight<'_> {
    /// Which of a word's pixels in row `v`, all of them on the body of this image, are visible.
    #[inline]
    pub(super) fn of(&self, v: i32, word: usize, pixels: u64, conic: &ImageConic) -> u64 {
        let at = v as usize * self.depth.words_per_row + word;
        let beyond = self.beyond[at];
        let doubtful = pixels & self.reached[at] & !beyond;
        let seen = pixels & beyond;
        if doubtful == 0 { seen } else { seen | self.in_front(v, word, doubtful, conic) }
    }

    /// The pixels at which the body is in front, one by one.
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

    /// Depths of which some are nothing, some infinite and some no number.
    fn irregular(rng: &mut Pcg64Mcg) -> f32 {
        match rng.random_range(0..10) {
            0 => 0.0,
            1 => f32::INFINITY,
            2 => f32::NAN,
            _ => rng.random_range(0.05..30.0),
        }
    }

    /// From an image so small that its levels are the finest to one of which not even two planes are small enough.
    #[test]
    fn what_is_sure_is_so_whatever_the_size_of_the_image() {
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let mut bits_of_levels = Vec::new();
        for (width, height) in [(1, 1), (70, 40), (640, 480), (1920, 1080), (3840, 2304)] {
            let z_m: Vec<f32> = (0..width * height).map(|_| irregular(&mut rng)).collect();
            let at = |u: u32, v: u32| z_m[(v * width + u) as usize];
            let depth = StaticDepth::new(width, height, at);
            bits_of_levels.push(depth.level_bits);
            for _ in 0..5 {
                let from_m = rng.random_range(-1.0..20.0);
                // Now and then met exactly.
                let to_m =
                    if rng.random() { f64::from(at(0, 0)) } else { from_m + rng.random_range(0.0..2.0) };
                let to_m = if to_m.is_nan() { from_m } else { to_m };
                let sight = depth.sight(from_m, to_m);
                for _ in 0..2000 {
                    let (u, v) = (rng.random_range(0..width), rng.random_range(0..height));
                    let word = v as usize * depth.words_per_row + u as usize / 64;
                    let has = |plane: &[u64]| plane[word] >> (u % 64) & 1 == 1;
                    let z_m = at(u, v);
                    assert!(!has(sight.beyond) || f64::from(z_m) > to_m, "{z_m} is not beyond {to_m}");
                    let is_before = !(z_m > 0.0 && f64::from(z_m) >= from_m);
                    assert!(has(sight.reached) || is_before, "{z_m} is not before {from_m}");
                }
            }
        }
        assert_eq!(bits_of_levels[..2], [FINEST_LEVEL_BITS; 2]);
        assert!(bits_of_levels.is_sorted() && bits_of_levels[2] > FINEST_LEVEL_BITS);
    }

    #[test]
    fn a_body_is_told_from_what_is_a_hands_breadth_before_or_behind_it() {
        let depth = StaticDepth::new(64, 1, |u, _| 3.0 + 0.05 * u as f32);
        let sight = depth.sight(4.0, 4.5);
        let first = |plane: &[u64]| 3.0 + 0.05 * f64::from(plane[0].trailing_zeros());
        assert!((3.8..=4.0).contains(&first(sight.reached)), "{}", first(sight.reached));
        assert!((4.5..4.7).contains(&first(sight.beyond)), "{}", first(sight.beyond));
    }
}
