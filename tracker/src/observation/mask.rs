//! Foreground mask, one bit a pixel.

use image::{GrayImage, Luma};
use wide::u8x16;

/// A binary image in packed rows. Bit 0 of a row's first word is its leftmost pixel; bits beyond the width are 0.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Mask {
    width: u32,
    height: u32,
    words: Vec<u64>,
}

impl Mask {
    /// Mask of this size without foreground.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, words: vec![0; words_per_row(width) * height as usize] }
    }

    /// Mask whose foreground is the set of pixels with `is_set(x, y)`.
    pub fn from_fn(width: u32, height: u32, is_set: impl Fn(u32, u32) -> bool) -> Self {
        let mut mask = Self::new(width, height);
        for (y, row) in (0..height).zip(mask.words.chunks_exact_mut(words_per_row(width).max(1))) {
            for x in (0..width).filter(|x| is_set(*x, y)) {
                row[x as usize / 64] |= 1 << (x % 64);
            }
        }
        mask
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Width and height in pixels.
    pub fn dimensions(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Whether a pixel is foreground; pixels outside the image are not.
    pub fn is_set(&self, x: u32, y: u32) -> bool {
        x < self.width && y < self.height && self.row(y)[x as usize / 64] >> (x % 64) & 1 == 1
    }

    /// Words of one row, `⌈width / 64⌉` of them.
    ///
    /// # Panics
    /// A row outside the mask.
    pub fn row(&self, y: u32) -> &[u64] {
        let words = words_per_row(self.width);
        &self.words[y as usize * words..][..words]
    }

    /// Mutable words of one row. Bits beyond the width must stay 0.
    pub(crate) fn row_mut(&mut self, y: u32) -> &mut [u64] {
        let words = words_per_row(self.width);
        &mut self.words[y as usize * words..][..words]
    }

    /// All words, row by row.
    pub fn words(&self) -> &[u64] {
        &self.words
    }

    /// Number of foreground pixels.
    pub fn count(&self) -> u64 {
        self.words.iter().map(|word| u64::from(word.count_ones())).sum()
    }

    /// Picture of the mask: 255 for foreground, otherwise 0.
    pub fn to_image(&self) -> GrayImage {
        GrayImage::from_fn(self.width, self.height, |x, y| Luma([if self.is_set(x, y) { 255 } else { 0 }]))
    }

    /// Runs of foreground in one row, from left to right: the first column, and the one after the last.
    pub fn runs(&self, y: u32) -> impl Iterator<Item = (u32, u32)> + '_ {
        let row = self.row(y);
        let mut from = 0;
        std::iter::from_fn(move || {
            let start = next(row, from, |word| word)?;
            let end = next(row, start, |word| !word).unwrap_or(self.width).min(self.width);
            from = end;
            Some((start, end))
        })
    }

    /// Sets the pixels from column `start` to before `end` of one row.
    ///
    /// # Panics
    /// Columns that are not within the mask.
    pub fn set_run(&mut self, y: u32, start: u32, end: u32) {
        assert!(start <= end && end <= self.width, "columns {start}..{end} of {}", self.width);
        let row = self.row_mut(y);
        let (first, last) = (start as usize / 64, end as usize / 64);
        let (head, tail) = (u64::MAX << (start % 64), !(u64::MAX << (end % 64)));
        if first == last {
            if start < end {
                row[first] |= head & tail;
            }
            return;
        }
        row[first] |= head;
        row[first + 1..last].fill(u64::MAX);
        if tail != 0 {
            row[last] |= tail;
        }
    }
}

/// Mask of a picture: every value but 0 is foreground.
impl From<&GrayImage> for Mask {
    fn from(image: &GrayImage) -> Self {
        let (width, height) = image.dimensions();
        let mut mask = Self::new(width, height);
        if width == 0 {
            return mask;
        }
        let rows = image.as_raw().chunks_exact(width as usize);
        for (row, words) in rows.zip(mask.words.chunks_exact_mut(words_per_row(width))) {
            for (pixels, word) in row.chunks(64).zip(words) {
                let (groups, rest) = pixels.as_chunks::<16>();
                let zeros = groups.iter().map(|group| u8x16::new(*group).simd_eq(u8x16::ZERO).to_bitmask());
                let last = rest.iter().rev().fold(0, |bits, pixel| bits << 1 | u64::from(*pixel != 0));
                let all = zeros.map(|zeros| u64::from(zeros as u16 ^ u16::MAX)).chain([last]);
                *word = all
                    .zip((0..).step_by(16))
                    .fold(0, |word, (bits, shift)| word | bits.unbounded_shl(shift));
            }
        }
        mask
    }
}

/// Number of 64-pixel words in a row of this width.
fn words_per_row(width: u32) -> usize {
    (width as usize).div_ceil(64)
}

/// First column from `from` on whose bit is set in the row's words after `view`.
fn next(row: &[u64], from: u32, view: impl Fn(u64) -> u64) -> Option<u32> {
    let first = from as usize / 64;
    let mut ahead = row.get(first..)?.iter().enumerate().map(|(i, word)| {
        let seen = view(*word);
        (first + i, if i == 0 { seen & (u64::MAX << (from % 64)) } else { seen })
    });
    let (word, bits) = ahead.find(|(_, bits)| *bits != 0)?;
    Some(word as u32 * 64 + bits.trailing_zeros())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn packing_and_runs_agree_with_the_picture(width in 1_u32..200, rows in 1_u32..4, seed in any::<u64>()) {
            let mut state = seed | 1;
            let image = GrayImage::from_fn(width, rows, |_, _| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                Luma([if state >> 61 < 3 { 0 } else { (state >> 40) as u8 | 1 }])
            });
            let mask = Mask::from(&image);
            let mut again = Mask::new(width, rows);
            for (x, y, pixel) in image.enumerate_pixels() {
                prop_assert_eq!(mask.is_set(x, y), pixel[0] != 0);
                prop_assert_eq!(mask.to_image().get_pixel(x, y)[0] == 255, pixel[0] != 0);
            }
            for y in 0..rows {
                let mut end_before = None;
                for (start, end) in mask.runs(y) {
                    prop_assert!(start < end && end <= width && end_before.is_none_or(|before| start > before));
                    end_before = Some(end);
                    again.set_run(y, start, end);
                }
            }
            prop_assert_eq!(&again, &mask);
            prop_assert_eq!(mask.count(), image.iter().filter(|p| **p != 0).count() as u64);
            prop_assert_eq!(&Mask::from_fn(width, rows, |x, y| mask.is_set(x, y)), &mask);
        }
    }

    #[test]
    fn pixels_outside_are_background() {
        let mask = Mask::from_fn(70, 2, |_, _| true);
        assert!(mask.is_set(69, 1) && !mask.is_set(70, 1) && !mask.is_set(0, 2));
        assert_eq!(mask.count(), 140);
        assert_eq!(Mask::new(0, 0).count(), 0);
    }
}
