//! Colours of a foreground on a coarse grid: the part of a picture that appearance needs, at a small fraction of its
//! size.

use image::{Rgb, RgbImage};

use super::Mask;

/// Colour of the middle pixel of every grid cell whose middle pixel is foreground, with 5, 6 and 5 bits a channel.
///
/// Cells are `step` pixels of the mask wide and high; the middle of cell `(c, r)` is the pixel `(c · step + step / 2, r
/// · step + step / 2)`, or the image's last where that lies outside.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Colours {
    step: u8,
    /// Cells with a sample.
    cells: Mask,
    /// One sample for each of those cells, row by row.
    samples: Vec<u16>,
    /// Number of samples before each row.
    row_starts: Vec<u32>,
}

impl Colours {
    /// Samples a picture by `color_at(x, y)`, with x and y in pixels of the mask.
    pub fn sample(mask: &Mask, step: u8, mut color_at: impl FnMut(u32, u32) -> Rgb<u8>) -> Self {
        let mut colours = Self::empty(mask, step);
        for row in 0..colours.cells.height() {
            for (start, end) in colours.cells.runs(row) {
                let samples = (start..end).map(|column| {
                    let (x, y) = middle(mask, step, column, row);
                    packed(color_at(x, y))
                });
                colours.samples.extend(samples);
            }
        }
        colours
    }

    /// Samples a picture of the mask's size.
    pub fn of_picture(mask: &Mask, step: u8, picture: &RgbImage) -> Self {
        Self::sample(mask, step, |x, y| *picture.get_pixel(x, y))
    }

    /// Restores colours from the [`Self::samples`] of this mask and step; `None` when the number of samples is another.
    pub fn from_samples(mask: &Mask, step: u8, samples: Vec<u16>) -> Option<Self> {
        let colours = Self::empty(mask, step.max(1));
        let expected = colours.cells.count();
        (step > 0 && samples.len() as u64 == expected).then_some(Self { samples, ..colours })
    }

    /// Cells with a sample: those whose middle pixel is foreground.
    pub(crate) fn sampled_cells(mask: &Mask, step: u8) -> Mask {
        let side = u32::from(step.max(1));
        Mask::from_fn(mask.width().div_ceil(side), mask.height().div_ceil(side), |column, row| {
            let (x, y) = middle(mask, step.max(1), column, row);
            mask.is_set(x, y)
        })
    }

    fn empty(mask: &Mask, step: u8) -> Self {
        let step = step.max(1);
        let cells = Self::sampled_cells(mask, step);
        let mut before = 0;
        let row_starts = (0..cells.height())
            .map(|row| {
                let start = before;
                before += cells.row(row).iter().map(|word| word.count_ones()).sum::<u32>();
                start
            })
            .collect();
        Self { step, cells, samples: Vec::new(), row_starts }
    }

    /// Side of a cell, pixels of the mask.
    pub fn step(&self) -> u8 {
        self.step
    }

    /// All samples, row by row: red in the upper 5 bits, green in the middle 6, blue in the lower 5.
    pub fn samples(&self) -> &[u16] {
        &self.samples
    }

    /// Colour of the cell of a pixel of the mask; `None` where the cell has no sample.
    pub fn at(&self, x: u32, y: u32) -> Option<Rgb<u8>> {
        let side = u32::from(self.step);
        let (column, row) = (x / side, y / side);
        if !self.cells.is_set(column, row) {
            return None;
        }
        let words = self.cells.row(row);
        let (word, bit) = (column as usize / 64, column % 64);
        let before = words[..word].iter().map(|w| w.count_ones()).sum::<u32>()
            + (words[word] & !(u64::MAX << bit)).count_ones();
        let sample = self.samples.get((self.row_starts[row as usize] + before) as usize)?;
        Some(unpacked(*sample))
    }
}

/// Middle pixel of a cell.
fn middle(mask: &Mask, step: u8, column: u32, row: u32) -> (u32, u32) {
    let side = u32::from(step);
    let at = |i: u32, size: u32| (i * side + side / 2).min(size.saturating_sub(1));
    (at(column, mask.width()), at(row, mask.height()))
}

fn packed(color: Rgb<u8>) -> u16 {
    let [r, g, b] = color.0.map(u16::from);
    (r >> 3) << 11 | (g >> 2) << 5 | b >> 3
}

/// Colour in the middle of the interval that a packed colour stands for.
fn unpacked(sample: u16) -> Rgb<u8> {
    let level = |bits: u16, lost: u32| (bits << lost | (1 << (lost - 1))) as u8;
    Rgb([level(sample >> 11, 3), level(sample >> 5 & 63, 2), level(sample & 31, 3)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_has_the_colour_of_its_middle_where_that_is_foreground() {
        let picture = RgbImage::from_fn(131, 37, |x, y| Rgb([(x * 2) as u8, (y * 7) as u8, (x + y) as u8]));
        let mask = Mask::from_fn(131, 37, |x, y| (x / 9 + y / 5) % 3 != 0);
        for step in [1, 2, 3, 8, 64] {
            let colours = Colours::of_picture(&mask, step, &picture);
            for (x, y) in (0..37).flat_map(|y| (0..131).map(move |x| (x, y))) {
                let side = u32::from(step);
                let at = |i: u32, size: u32| (i / side * side + side / 2).min(size - 1);
                let (u, v) = (at(x, 131), at(y, 37));
                let found = colours.at(x, y);
                assert_eq!(found.is_some(), mask.is_set(u, v), "{x}, {y}, step {step}");
                if let Some(found) = found {
                    let truth = picture.get_pixel(u, v);
                    assert!((0..3).all(|c| found[c].abs_diff(truth[c]) <= 4), "{found:?} for {truth:?}");
                }
            }
            let again = Colours::from_samples(&mask, step, colours.samples().to_vec());
            assert_eq!(again.as_ref(), Some(&colours));
            let mut short = colours.samples().to_vec();
            short.pop();
            assert_eq!(Colours::from_samples(&mask, step, short), None);
        }
        assert_eq!(Colours::from_samples(&mask, 0, Vec::new()), None);
        assert_eq!(Colours::of_picture(&mask, 4, &picture).at(500, 0), None);
    }
}
