//! Coding of a mask by the columns where its rows change, relative to the row above.
//!
//! The method is that of fax machines (ITU-T Recommendation T.6, 1988, "group 4"): `b1` is the first change of the row
//! above to the right of the latest change `a0` of this row that has the same direction as the next change `a1`, and
//! `b2` the one after it. A change is coded as one of
//!
//! * `a1 − b1`, where that is at most 6 columns;
//! * *pass*: the row above changes and changes back (`b1`, `b2`) before this row changes;
//! * *alone*: `a1 − a0 − 1`, as an integer.
//!
//! A row without further changes has its next change at its width. The modes go through the adaptive range coder
//! instead of T.6's fixed codes; their context is the latest mode and the position of `b1` (inside the row or at its
//! end).

use super::bytes::{Decoded, Malformed};
use super::range_coder::{Coder, Length, Symbol};
use crate::observation::Mask;

/// Largest distance in columns from the change `b1` at which a change is coded by that distance.
const NEAR: i32 = 6;
/// Modes 0 to 12 are distances from −6 to 6.
const PASS: usize = 13;
const ALONE: usize = 14;

/// Probability of each mode, by context.
#[derive(Default)]
pub(super) struct OutlineModel {
    modes: [Symbol<16>; CONTEXTS],
    alone: [Length; 2],
}

/// Number of contexts: inside or outside a run, `b1` before the row's end or not, and five classes of the latest
/// mode.
const CONTEXTS: usize = 2 * 2 * 5;

/// One row's changes; even ones begin a run, odd ones end it.
type Changes = Vec<u32>;

impl OutlineModel {
    /// Codes a mask: an encoder is given one and returns an equal one, a decoder is given an empty one of the right
    /// size.
    pub(super) fn code(&mut self, coder: &mut impl Coder, mask: &Mask) -> Decoded<Mask> {
        let (width, height) = mask.dimensions();
        let mut coded = Mask::new(width, height);
        let (mut above, mut row) = (Changes::new(), Changes::new());
        for y in 0..height {
            let given: Changes = mask.runs(y).flat_map(|(start, end)| [start, end]).collect();
            row.clear();
            self.code_row(coder, width, &above, &given, &mut row)?;
            for run in row.chunks(2) {
                coded.set_run(y, run[0], run.get(1).copied().unwrap_or(width));
            }
            std::mem::swap(&mut above, &mut row);
        }
        Ok(coded)
    }

    fn code_row(
        &mut self,
        coder: &mut impl Coder,
        width: u32,
        above: &[u32],
        given: &[u32],
        row: &mut Changes,
    ) -> Decoded<()> {
        let width = width as i32;
        let change = |changes: &[u32], i: usize| changes.get(i).map_or(width, |c| *c as i32);
        let (mut a0, mut latest, mut next_above) = (-1, 0, 0);
        loop {
            while change(above, next_above) <= a0 && next_above < above.len() {
                next_above += 1;
            }
            let inside = row.len() % 2;
            let same_way = next_above + (next_above + inside) % 2;
            let (b1, b2) = (change(above, same_way), change(above, same_way + 1));
            let a1 = change(given, row.len());
            let given_mode = if b2 < a1 {
                PASS
            } else if (a1 - b1).abs() <= NEAR {
                (a1 - b1 + NEAR) as usize
            } else {
                ALONE
            };
            let context = (inside * 2 + usize::from(b1 < width)) * 5 + latest;
            let mode = self.modes[context].code(coder, given_mode)?;
            let a1 = match mode {
                PASS if b2 < width => {
                    (a0, latest) = (b2, 3);
                    continue;
                }
                // An encoder's change lies right of `a0`; a decoder's value is not used.
                ALONE => a0 + 1 + self.alone[inside].code(coder, (a1 - a0 - 1).max(0) as u32)? as i32,
                mode if mode < PASS => b1 + mode as i32 - NEAR,
                _ => return Err(Malformed("the mask's outline has a mode that does not exist")),
            };
            if a1 <= a0 || a1 > width {
                return Err(Malformed("the mask's outline leaves the picture"));
            }
            if a1 == width {
                return Ok(());
            }
            row.push(a1 as u32);
            a0 = a1;
            latest = match mode {
                ALONE => 4,
                mode => (mode as i32 - NEAR).signum().rem_euclid(3) as usize,
            };
        }
    }
}
