//! Visible pixels of one body in one view, packed.

use std::ops::Range;

use super::conic::{Ellipse, ImageOutline, SPANS};
use super::{Ellipsoid, ImageConic, View};

/// Pixels of a body that the static room leaves visible: a rectangle of 64-pixel words. Bit 0 is the leftmost.
///
/// A silhouette is meant to be drawn repeatedly into the same memory ([`Self::draw`]).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Silhouette {
    first_row: usize,
    rows: usize,
    first_word: usize,
    words: usize,
    bits: Vec<u64>,
    /// Number of pixels of the body within the image, hidden or not, without the rows that are wholly below the floor.
    pub area_px: u32,
    /// Number of pixels of the body within the image that the static room does not hide.
    pub visible_px: u32,
}

impl Silhouette {
    /// Silhouette of `body` in `view`.
    pub fn new(view: &View, body: &Ellipsoid) -> Self {
        let mut silhouette = Self::default();
        silhouette.draw(view, body);
        silhouette
    }

    /// Draws `body` as seen in `view`, and replaces the former silhouette.
    pub fn draw(&mut self, view: &View, body: &Ellipsoid) {
        let conic = ImageConic::new(view, body);
        match conic.outline() {
            ImageOutline::Nowhere => self.resize(&(0..0), &(0..0)),
            ImageOutline::Ellipse(ellipse) => {
                let hidden_from = view.first_row_below_floor(body, ellipse.last_row);
                self.draw_ellipse(view, &conic, &ellipse, hidden_from);
            }
            ImageOutline::Open => self.draw_open(view, &conic),
        }
    }

    /// Resizes the rectangle; its bits are then arbitrary.
    fn resize(&mut self, rows: &Range<i32>, columns: &Range<i32>) {
        (self.area_px, self.visible_px) = (0, 0);
        (self.first_row, self.rows) = (rows.start as usize, rows.len());
        self.first_word = columns.start as usize / 64;
        self.words = (columns.end as usize).div_ceil(64) - self.first_word;
        self.bits.resize(self.rows * self.words, 0);
    }

    /// Draws an ellipse of which nothing is visible from row `hidden_from` on.
    fn draw_ellipse(&mut self, view: &View, conic: &ImageConic, ellipse: &Ellipse, hidden_from: i32) {
        let rows = ellipse.rows.start..ellipse.rows.end.min(hidden_from).max(ellipse.rows.start);
        self.resize(&rows, &ellipse.columns);
        let visibility = view.depth.visibility(conic.nearest_z_m, conic.near_side_to_z_m);
        let first_word = self.first_word;
        let (mut area_px, mut visible_px) = (0, 0);
        let mut rows_of_bits = self.bits.chunks_exact_mut(self.words.max(1));
        for first in rows.clone().step_by(SPANS) {
            for ((v, span), bits) in (first..rows.end).zip(&ellipse.spans(first)).zip(&mut rows_of_bits) {
                area_px += (span.end - span.start).max(0) as u32;
                for (word, bits) in (first_word..).zip(bits) {
                    *bits = visibility.of(v, word, span_bits(span, word), conic);
                    visible_px += bits.count_ones();
                }
            }
        }
        (self.area_px, self.visible_px) = (area_px, visible_px);
    }

    /// Draws a body that may be anywhere in the image.
    fn draw_open(&mut self, view: &View, conic: &ImageConic) {
        let [rows, columns] = conic.image();
        self.resize(&rows, &columns);
        // Around the camera, everything is behind the near side.
        let visibility = if conic.holds_camera() {
            view.depth.visibility(f64::NEG_INFINITY, 0.0)
        } else {
            view.depth.visibility(conic.nearest_z_m, conic.near_side_to_z_m)
        };
        for v in rows {
            let spans = conic.spans(&conic.row(v));
            let spans = || spans.iter().flatten();
            self.area_px += spans().map(|span| span.len() as u32).sum::<u32>();
            let start = v as usize * self.words;
            for (word, bits) in self.bits[start..start + self.words].iter_mut().enumerate() {
                let pixels = spans().fold(0, |bits, span| bits | span_bits(span, word));
                *bits = visibility.of(v, word, pixels, conic);
                self.visible_px += bits.count_ones();
            }
        }
    }

    /// Rows of the rectangle.
    pub fn row_range(&self) -> Range<usize> {
        self.first_row..self.first_row + self.rows
    }

    /// Words of a row of the rectangle, as indices of words of the image's row.
    pub fn word_range(&self) -> Range<usize> {
        self.first_word..self.first_word + self.words
    }

    /// Rows of the rectangle: index and bits, one word for each of [`Self::word_range`].
    pub fn rows(&self) -> impl Iterator<Item = (usize, &[u64])> {
        (self.first_row..).zip(self.bits.chunks_exact(self.words.max(1)))
    }

    /// Bits of one row, one word for each of [`Self::word_range`]; empty outside [`Self::row_range`].
    pub fn row_bits(&self, row: usize) -> &[u64] {
        if !self.row_range().contains(&row) {
            return &[];
        }
        let start = (row - self.first_row) * self.words;
        &self.bits[start..start + self.words]
    }

    /// Columns from the first to the last pixel of one row.
    pub fn row_width(&self, row: usize) -> Range<usize> {
        let set = || self.row_bits(row).iter().zip(self.word_range()).filter(|(bits, _)| **bits != 0);
        let first = set().next().map(|(bits, word)| word * 64 + bits.trailing_zeros() as usize);
        let last = set().next_back().map(|(bits, word)| word * 64 + 64 - bits.leading_zeros() as usize);
        first.unwrap_or(0)..last.unwrap_or(0)
    }

    /// Bits of one word of the image; 0 outside.
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
        self.rows().flat_map(move |(row, bits)| {
            bits.iter().zip(self.word_range()).flat_map(move |(bits, word)| {
                (0..64)
                    .filter(move |bit| bits >> bit & 1 == 1)
                    .map(move |bit| ((word * 64) as u32 + bit, row as u32))
            })
        })
    }

    /// Keeps only the pixels for which `keep` returns true, and counts them again.
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

/// Pixels of a span that fall into a word of the image, as bits of the word.
fn span_bits(span: &Range<i32>, word: usize) -> u64 {
    let base = (word * 64) as i32;
    let before = |u: i32| if u < base + 64 { !(u64::MAX << (u - base).max(0)) } else { u64::MAX };
    before(span.end) & !before(span.start)
}
