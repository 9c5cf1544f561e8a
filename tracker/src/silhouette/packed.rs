//! The visible pixels of one body in one view, packed.

use super::{Body, ImageConic, View};

/// The pixels of a body that the static room leaves visible: a rectangle of 64-pixel words. Bit 0 is the leftmost.
///
/// A silhouette is made to be drawn again and again into the same memory ([`Self::draw`]).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Silhouette {
    first_row: usize,
    rows: usize,
    first_word: usize,
    words: usize,
    bits: Vec<u64>,
    /// Pixels of the body within the image, hidden or not.
    pub area_px: u32,
    /// Pixels of the body within the image that the static room does not hide.
    pub visible_px: u32,
}

impl Silhouette {
    /// The silhouette of `body` in `view`.
    pub fn new(view: &View, body: &Body) -> Self {
        let mut silhouette = Self::default();
        silhouette.draw(view, body);
        silhouette
    }

    /// Draws `body` as seen in `view`, in place of whatever was here.
    pub fn draw(&mut self, view: &View, body: &Body) {
        let conic = ImageConic::new(view, body);
        (self.area_px, self.visible_px) = (0, 0);
        self.bits.clear();
        let Some([rows, columns]) = conic.bounds() else {
            (self.first_row, self.rows, self.first_word, self.words) = (0, 0, 0, 0);
            return;
        };
        (self.first_row, self.rows) = (rows.start as usize, rows.len());
        self.first_word = columns.start as usize / 64;
        self.words = (columns.end - 1) as usize / 64 + 1 - self.first_word;
        self.bits.resize(self.rows * self.words, 0);
        for v in rows.clone() {
            let row = conic.row(v);
            for span in conic.spans(&row).into_iter().flatten() {
                self.area_px += (span.last - span.first + 1) as u32;
                for word in span.first as usize / 64..=span.last as usize / 64 {
                    let covered = span_bits(span.first, span.last, word);
                    let [static_near, static_far] = view.word_range_m(v, word);
                    // A margin for the rounding of bounds that are met exactly, as where a body touches a wall.
                    let seen = if f64::from(static_near) > span.farthest_z_m * (1.0 + 1e-9) {
                        covered
                    } else if f64::from(static_far) < conic.nearest_z_m * (1.0 - 1e-9) {
                        0
                    } else {
                        let mut seen = 0;
                        let mut rest = covered;
                        while rest != 0 {
                            let bit = rest.trailing_zeros();
                            let u = (word * 64) as i32 + bit as i32;
                            let visible = row.is_in_front_of(u, view.static_z_m(u, v));
                            seen |= u64::from(visible) << bit;
                            rest &= rest - 1;
                        }
                        seen
                    };
                    self.visible_px += seen.count_ones();
                    self.bits[(v - rows.start) as usize * self.words + word - self.first_word] |= seen;
                }
            }
        }
    }

    /// The rows this silhouette has words for.
    pub fn row_range(&self) -> std::ops::Range<usize> {
        self.first_row..self.first_row + self.rows
    }

    /// The words of a row this silhouette has bits for, as numbers of words of the image's row.
    pub fn word_range(&self) -> std::ops::Range<usize> {
        self.first_word..self.first_word + self.words
    }

    /// The bits of one row, one entry for each of [`Self::word_range`]; empty outside [`Self::row_range`].
    pub fn row_bits(&self, row: usize) -> &[u64] {
        if !self.row_range().contains(&row) {
            return &[];
        }
        let start = (row - self.first_row) * self.words;
        &self.bits[start..start + self.words]
    }

    /// The bits of one word of the image; 0 outside.
    pub fn bits_at(&self, row: usize, word: usize) -> u64 {
        if !self.word_range().contains(&word) {
            return 0;
        }
        self.row_bits(row).get(word - self.first_word).copied().unwrap_or(0)
    }

    /// Whether a pixel belongs to the silhouette.
    pub fn contains(&self, u: u32, v: u32) -> bool {
        self.bits_at(v as usize, u as usize / 64) >> (u % 64) & 1 == 1
    }

    /// All its pixels, row by row: column and row.
    pub fn pixels(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        self.row_range().flat_map(move |row| {
            self.row_bits(row).iter().zip(self.word_range()).flat_map(move |(bits, word)| {
                (0..64)
                    .filter(move |bit| bits >> bit & 1 == 1)
                    .map(move |bit| ((word * 64) as u32 + bit, row as u32))
            })
        })
    }

    /// Keeps only the pixels for which `keep` says so, and counts them anew.
    pub fn retain(&mut self, mut keep: impl FnMut(u32, u32) -> bool) {
        self.visible_px = 0;
        for row in self.row_range() {
            for word in self.word_range() {
                let slot = (row - self.first_row) * self.words + word - self.first_word;
                let mut rest = self.bits[slot];
                while rest != 0 {
                    let bit = rest.trailing_zeros();
                    if !keep((word * 64) as u32 + bit, row as u32) {
                        self.bits[slot] &= !(1 << bit);
                    }
                    rest &= rest - 1;
                }
                self.visible_px += self.bits[slot].count_ones();
            }
        }
    }
}

/// The part of columns `first..=last` that falls into a word.
fn span_bits(first: i32, last: i32, word: usize) -> u64 {
    let base = (word * 64) as i32;
    let low = (first - base).max(0);
    let high = (last - base).min(63);
    (u64::MAX << low) & (u64::MAX >> (63 - high))
}
