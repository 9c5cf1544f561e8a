//! The visible pixels of one body in one view, packed.

use std::ops::Range;

use super::conic::{Ellipse, Outline, Row, Span};
use super::view::{STRETCH, TILE_ROWS};
use super::{Ellipsoid, ImageConic, View};

/// A margin for the rounding of bounds that are met exactly, as where a body touches a wall.
const ROUNDING: f64 = 1e-9;

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
    pub fn new(view: &View, body: &Ellipsoid) -> Self {
        let mut silhouette = Self::default();
        silhouette.draw(view, body);
        silhouette
    }

    /// Draws `body` as seen in `view`, in place of whatever was here.
    pub fn draw(&mut self, view: &View, body: &Ellipsoid) {
        let conic = ImageConic::new(view, body);
        match conic.outline() {
            Outline::Nowhere => self.clear(0..0, 0..0),
            Outline::Ellipse(ellipse) => self.draw_ellipse(view, &conic, &ellipse),
            Outline::Open => self.draw_open(view, &conic),
        }
    }

    /// Makes room for a rectangle of pixels, and empties it.
    fn clear(&mut self, rows: Range<i32>, columns: Range<i32>) {
        (self.area_px, self.visible_px) = (0, 0);
        (self.first_row, self.rows) = (rows.start as usize, rows.len());
        self.first_word = columns.start as usize / 64;
        self.words = (columns.end as usize).div_ceil(64) - self.first_word;
        self.bits.clear();
        self.bits.resize(self.rows * self.words, 0);
    }

    fn draw_ellipse(&mut self, view: &View, conic: &ImageConic, ellipse: &Ellipse) {
        let near_side_to_m = conic.near_side_to_z_m * (1.0 + ROUNDING);
        let nearest_m = conic.nearest_z_m * (1.0 - ROUNDING);
        self.clear(ellipse.rows.clone(), ellipse.columns.clone());
        let mut v = ellipse.rows.start;
        while v < ellipse.rows.end {
            // Rows of one tile together: most of a person is far in front of everything, or far behind something.
            let end = ((v / TILE_ROWS + 1) * TILE_ROWS).min(ellipse.rows.end);
            let [static_near, static_far] = view.tiles_range_m(v, &ellipse.columns).map(f64::from);
            for v in v..end {
                let Some(span) = ellipse.span(v) else { continue };
                self.area_px += span.width();
                if static_near > near_side_to_m {
                    self.visible_px += span.width();
                    self.fill(v, &span);
                } else if static_far >= nearest_m {
                    self.fill_visible(view, v, &conic.row(v), &span, nearest_m, near_side_to_m);
                }
            }
            v = end;
        }
    }

    fn draw_open(&mut self, view: &View, conic: &ImageConic) {
        let [rows, columns] = conic.image();
        self.clear(rows.clone(), columns);
        for v in rows {
            let row = conic.row(v);
            for span in conic.spans(&row).into_iter().flatten() {
                self.area_px += span.width();
                // Around the camera, everything is behind the near side.
                let (nearest_m, near_side_to_m) = if conic.holds_camera() {
                    (f64::NEG_INFINITY, 0.0)
                } else {
                    (conic.nearest_z_m, conic.near_side_to_z_m * (1.0 + ROUNDING))
                };
                self.fill_visible(view, v, &row, &span, nearest_m, near_side_to_m);
            }
        }
    }

    /// Sets all pixels of a span.
    fn fill(&mut self, v: i32, span: &Span) {
        let start = (v as usize - self.first_row) * self.words;
        let (first, last) = (span.first as usize, span.last as usize);
        let (from, to) = (first / 64 - self.first_word, last / 64 - self.first_word);
        let (head, tail) = (u64::MAX << (first % 64), u64::MAX >> (63 - last % 64));
        let row = &mut self.bits[start + from..=start + to];
        if let [word] = row {
            *word |= head & tail;
        } else if let [first, middle @ .., last] = row {
            *first |= head;
            middle.fill(u64::MAX);
            *last |= tail;
        }
    }

    /// Sets the pixels of a span in which the body is in front of what is static, whose near side reaches from
    /// `nearest_m` to `near_side_to_m`.
    fn fill_visible(
        &mut self,
        view: &View,
        v: i32,
        row: &Row,
        span: &Span,
        nearest_m: f64,
        near_side_to_m: f64,
    ) {
        let start = (v as usize - self.first_row) * self.words;
        let mut row_to_m = None;
        for stretch in span.first as usize / STRETCH..=span.last as usize / STRETCH {
            let word = stretch * STRETCH / 64;
            let covered = span_bits(span, stretch);
            let [static_near, static_far] = view.stretch_range_m(v, stretch).map(f64::from);
            let seen = if static_near > near_side_to_m {
                covered
            } else if static_far < nearest_m {
                0
            } else if static_near > *row_to_m.get_or_insert_with(|| row.farthest_z_m(span) * (1.0 + ROUNDING))
            {
                covered
            } else {
                in_front(row, view, v, word, covered)
            };
            self.visible_px += seen.count_ones();
            self.bits[start + word - self.first_word] |= seen;
        }
    }

    /// The rows this silhouette has words for.
    pub fn row_range(&self) -> Range<usize> {
        self.first_row..self.first_row + self.rows
    }

    /// The words of a row this silhouette has bits for, as numbers of words of the image's row.
    pub fn word_range(&self) -> Range<usize> {
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

    /// The columns between the first and the last pixel of one row.
    pub fn row_width(&self, row: usize) -> Range<usize> {
        let set = || self.row_bits(row).iter().zip(self.word_range()).filter(|(bits, _)| **bits != 0);
        let first = set().next().map(|(bits, word)| word * 64 + bits.trailing_zeros() as usize);
        let last = set().next_back().map(|(bits, word)| word * 64 + 64 - bits.leading_zeros() as usize);
        first.unwrap_or(0)..last.unwrap_or(0)
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

/// The pixels of a span that fall into a stretch, as bits of the stretch's word.
fn span_bits(span: &Span, stretch: usize) -> u64 {
    let base = (stretch * STRETCH) as i32;
    let low = (span.first - base).max(0);
    let high = (span.last - base).min(STRETCH as i32 - 1);
    let bits = (u64::MAX << low) & (u64::MAX >> (63 - high));
    bits << (base % 64)
}

/// Of the pixels of a word, those where the body is in front of what is static: one by one.
fn in_front(row: &Row, view: &View, v: i32, word: usize, pixels: u64) -> u64 {
    let (mut seen, mut rest) = (0, pixels);
    while rest != 0 {
        let bit = rest.trailing_zeros();
        let u = (word * 64) as i32 + bit as i32;
        seen |= u64::from(row.is_in_front_of(u, view.static_z_m(u, v))) << bit;
        rest &= rest - 1;
    }
    seen
}
