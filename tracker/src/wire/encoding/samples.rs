//! Coding of the colours of a foreground, each predicted from its neighbours.
//!
//! The prediction is that of LOCO-I (M. Weinberger, G. Seroussi and G. Sapiro, "The LOCO-I lossless image compression
//! algorithm", IEEE Trans. Image Processing 9(8), 2000): the median of the cell to the left, the one above, and their
//! sum less the one between them; with one neighbour only, that neighbour. The residual, modulo the channel's levels,
//! goes through the adaptive range coder: green first, then red and blue in the context of green's.

use super::bytes::Decoded;
use super::range_coder::{Coder, Symbol};
use crate::observation::Mask;

/// Red, green and blue of a sample.
type Levels = [i32; 3];

/// Probability of each residual, by context.
#[derive(Default)]
pub(super) struct SampleModel {
    green: [Symbol<64>; 3],
    /// Models of red and blue, by the class of green's residual.
    others: [[Symbol<32>; GREEN_CLASSES]; 2],
}

/// Number of classes of green's residual, by its sign and size.
const GREEN_CLASSES: usize = 7;

impl SampleModel {
    /// Codes one sample for each set cell, row by row: an encoder is given them and returns equal ones, a decoder is
    /// given none.
    pub(super) fn code(&mut self, coder: &mut impl Coder, cells: &Mask, given: &[u16]) -> Decoded<Vec<u16>> {
        let mut coded = Vec::new();
        let width = cells.width() as usize;
        let (mut above, mut row) = (vec![None; width], vec![None; width]);
        let mut latest = [16, 32, 16];
        for y in 0..cells.height() {
            row.fill(None);
            for x in cells.runs(y).flat_map(|(start, end)| start as usize..end as usize) {
                let before = x.checked_sub(1);
                let (left, corner) = (before.and_then(|i| row[i]), before.and_then(|i| above[i]));
                let (expected, neighbours) = predict(left, above[x], corner, latest);
                let sample = levels(given.get(coded.len()).copied().unwrap_or(0));
                latest = self.code_rest(coder, expected, neighbours, sample)?;
                row[x] = Some(latest);
                coded.push(packed(latest));
            }
            std::mem::swap(&mut above, &mut row);
        }
        Ok(coded)
    }

    fn code_rest(
        &mut self,
        coder: &mut impl Coder,
        expected: Levels,
        neighbours: usize,
        sample: Levels,
    ) -> Decoded<Levels> {
        let green = (sample[1] - expected[1]) & 63;
        let green = self.green[neighbours].code(coder, green as usize)? as i32;
        let class = class_of(green);
        // Brightness changes all three channels; red and blue have half of green's levels.
        let shift = signed(green) / 2;
        let mut rest_of = |model: usize, channel: usize| -> Decoded<i32> {
            let rest = (sample[channel] - expected[channel] - shift) & 31;
            let rest = self.others[model][class].code(coder, rest as usize)? as i32;
            Ok((expected[channel] + shift + rest) & 31)
        };
        Ok([rest_of(0, 0)?, (expected[1] + green) & 63, rest_of(1, 2)?])
    }
}

/// Predicted levels of a cell, and the number of neighbours (0, 1, or 2 for more) that they come from.
fn predict(
    left: Option<Levels>,
    above: Option<Levels>,
    corner: Option<Levels>,
    latest: Levels,
) -> (Levels, usize) {
    match (left, above) {
        (Some(a), Some(b)) => {
            let between = |i: usize| match corner {
                Some(c) => (a[i] + b[i] - c[i]).clamp(a[i].min(b[i]), a[i].max(b[i])),
                None => i32::midpoint(a[i], b[i]),
            };
            ([between(0), between(1), between(2)], 2)
        }
        (Some(one), None) | (None, Some(one)) => (one, 1),
        (None, None) => (latest, 0),
    }
}

/// Signed value of 6 bits, −32 to 31.
fn signed(green: i32) -> i32 {
    if green < 32 { green } else { green - 64 }
}

fn class_of(green: i32) -> usize {
    match signed(green) {
        ..=-6 => 0,
        -5..=-3 => 1,
        -2..=-1 => 2,
        0 => 3,
        1..=2 => 4,
        3..=5 => 5,
        6.. => 6,
    }
}

fn levels(sample: u16) -> Levels {
    [sample >> 11, sample >> 5 & 63, sample & 31].map(i32::from)
}

fn packed(levels: Levels) -> u16 {
    (levels[0] << 11 | levels[1] << 5 | levels[2]) as u16
}
