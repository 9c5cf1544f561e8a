//! Number of bodies that cover each pixel, computed for 64 pixels at a time.
//!
//! The counts are bit-sliced: five words hold the binary digits of the counts of 64 pixels, so a body is added or
//! removed with a few word operations, whatever the number of bodies. A change of one body then depends on two
//! properties of a pixel: whether *any* body covers it, and whether *several* do.
//!
//! ```text
//! uncovered when `old` goes  = old & !several          (old is one of those that cover it)
//! covered when `new` comes   = new & !(any but old)    = new & (!any | uncovered)
//! ```

use crate::silhouette::Silhouette;

/// Binary digits of a count: up to 31 bodies over one pixel.
const DIGITS: usize = 5;
/// Largest number of bodies that can cover a pixel without overflow.
pub(super) const MAX_BODIES: usize = (1 << DIGITS) - 1;

/// 64 pixels: one cache line.
#[derive(Debug, Clone, Copy, Default)]
struct Word {
    foreground: u64,
    any: u64,
    several: u64,
    digits: [u64; DIGITS],
}

/// Cover counts and foreground of one camera.
#[derive(Debug, Clone)]
pub(super) struct Cover {
    words_per_row: usize,
    words: Vec<Word>,
}

/// Changes of the counts by a change of one body.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Change {
    /// Change of the number of pixels that some body covers.
    pub(super) simulated: i64,
    /// Change of the number of those that are foreground.
    pub(super) both: i64,
}

impl Cover {
    pub(super) fn new(words_per_row: usize, height: usize) -> Self {
        Self { words_per_row, words: vec![Word::default(); words_per_row * height] }
    }

    /// Sets a new foreground (packed as [`super::pack`] does) and removes all bodies.
    pub(super) fn restart(&mut self, foreground: &[u64]) {
        for (word, foreground) in self.words.iter_mut().zip(foreground) {
            *word = Word { foreground: *foreground, ..Word::default() };
        }
    }

    /// Change when `old`, one of the bodies, is removed.
    pub(super) fn removal(&self, old: &Silhouette) -> Change {
        let mut change = Change::default();
        self.visit(old, |word, bits| {
            let uncovered = bits & !word.several;
            change.simulated -= i64::from(uncovered.count_ones());
            change.both -= i64::from((uncovered & word.foreground).count_ones());
        });
        change
    }

    /// Change when `new` is added after `old`, one of the bodies, was removed.
    pub(super) fn addition(&self, new: &Silhouette, old: Option<&Silhouette>) -> Change {
        let mut change = Change::default();
        let columns = new.word_range();
        // Offset of the words of `old` from the words of `new`.
        let shift = old.map_or(0, |old| columns.start.wrapping_sub(old.word_range().start));
        for (row, bits) in new.rows() {
            let start = row * self.words_per_row + columns.start;
            let old = old.map_or(&[][..], |old| old.row_bits(row));
            for (i, (word, bits)) in self.words[start..start + bits.len()].iter().zip(bits).enumerate() {
                let gone = old.get(i.wrapping_add(shift)).map_or(0, |old| old & !word.several);
                let covered = bits & (gone | !word.any);
                change.simulated += i64::from(covered.count_ones());
                change.both += i64::from((covered & word.foreground).count_ones());
            }
        }
        change
    }

    /// Foreground that no body covers, word by word.
    pub(super) fn unexplained(&self) -> impl Iterator<Item = u64> + '_ {
        self.words.iter().map(|word| word.foreground & !word.any)
    }

    pub(super) fn foreground_under(&self, silhouette: &Silhouette) -> u32 {
        let mut found = 0;
        self.visit(silhouette, |word, bits| found += (bits & word.foreground).count_ones());
        found
    }

    /// Calls `each` with every word under the silhouette, and the silhouette's bits in it.
    fn visit(&self, silhouette: &Silhouette, mut each: impl FnMut(&Word, u64)) {
        for (row, bits) in silhouette.rows() {
            let start = row * self.words_per_row + silhouette.word_range().start;
            for (word, bits) in self.words[start..start + bits.len()].iter().zip(bits) {
                each(word, *bits);
            }
        }
    }

    fn visit_mut(&mut self, silhouette: &Silhouette, mut each: impl FnMut(&mut Word, u64)) {
        for (row, bits) in silhouette.rows() {
            let start = row * self.words_per_row + silhouette.word_range().start;
            for (word, bits) in self.words[start..start + bits.len()].iter_mut().zip(bits) {
                each(word, *bits);
            }
        }
    }

    /// Adds a body: binary addition with carry, 64 pixels at once.
    pub(super) fn add(&mut self, silhouette: &Silhouette) {
        self.visit_mut(silhouette, |word, bits| {
            let mut carry = bits;
            for digit in &mut word.digits {
                (*digit, carry) = (*digit ^ carry, *digit & carry);
            }
            word.summarise();
        });
    }

    /// Removes a body that was added: binary subtraction with borrow.
    pub(super) fn remove(&mut self, silhouette: &Silhouette) {
        self.visit_mut(silhouette, |word, bits| {
            let mut borrow = bits;
            for digit in &mut word.digits {
                (*digit, borrow) = (*digit ^ borrow, !*digit & borrow);
            }
            word.summarise();
        });
    }
}

impl Word {
    fn summarise(&mut self) {
        self.several = self.digits[1..].iter().fold(0, |all, digit| all | digit);
        self.any = self.several | self.digits[0];
    }
}
