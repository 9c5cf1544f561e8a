//! The visible pixels of one body in one view, packed.

use std::ops::Range;

use wide::f32x8;

use super::conic::{Ellipse, Outline, Row};
use super::view::{STRETCH, TILE_ROWS};
use super::{Ellipsoid, ImageConic, View};

/// The pixels of a stretch.
const STRETCH_BITS: u64 = (1 << STRETCH) - 1;

/// How far along z the side of a body reaches that faces the camera.
struct NearSide {
    from_m: f64,
    to_m: f64,
}

/// How much of a part of the image leaves a body visible.
enum Sight {
    /// All of it.
    Clear,
    /// Some of it, perhaps.
    Partial,
    /// Nothing.
    Hidden,
}

impl NearSide {
    /// The depths beyond which the static room leaves all of the body visible, and none of it: rounded to where they are
    /// sure, also where they are met exactly, as when a body touches a wall.
    fn rounded(&self) -> [f32; 2] {
        [(self.to_m as f32).next_up(), (self.from_m as f32).next_down()]
    }

    /// What static depths from `near` to `far` leave of the body.
    fn behind(&self, [near, far]: [f32; 2]) -> Sight {
        let [beyond, reached] = self.rounded();
        if near > beyond {
            Sight::Clear
        } else if far > reached {
            Sight::Partial
        } else {
            Sight::Hidden
        }
    }
}

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
            Outline::Ellipse(ellipse) => {
                self.draw_ellipse(view, &conic, &ellipse, view.first_row_below_floor(body));
            }
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

    /// Draws an ellipse of which nothing is visible from row `hidden_from` on.
    fn draw_ellipse(&mut self, view: &View, conic: &ImageConic, ellipse: &Ellipse, hidden_from: i32) {
        let rows = &ellipse.rows;
        let visible = rows.start..rows.end.min(hidden_from).max(rows.start);
        self.clear(visible.clone(), ellipse.columns.clone());
        let side = NearSide { from_m: conic.nearest_z_m, to_m: conic.near_side_to_z_m };
        // Rows of one tile together: most of a person is far in front of everything, or far behind something.
        for tile in rows.start / TILE_ROWS..=(rows.end - 1) / TILE_ROWS {
            let spans: [Range<i32>; TILE_ROWS as usize] = ellipse.spans(tile * TILE_ROWS);
            let within = |rows: &Range<i32>| {
                [rows.start, rows.end].map(|v| (v - tile * TILE_ROWS).clamp(0, TILE_ROWS) as usize)
            };
            let [from, to] = within(rows);
            self.area_px +=
                spans[from..to].iter().map(|span| (span.end - span.start).max(0)).sum::<i32>() as u32;
            let [from, to] = within(&visible);
            if from == to {
                continue;
            }
            let sight = side.behind(view.tiles_range_m(tile, &ellipse.columns));
            for (v, span) in (tile * TILE_ROWS + from as i32..).zip(&spans[from..to]) {
                match sight {
                    Sight::Clear => self.fill(v, span, |_, pixels| pixels),
                    Sight::Partial => self.fill_visible(view, v, &conic.row(v), span, &side),
                    Sight::Hidden => {}
                }
            }
        }
    }

    fn draw_open(&mut self, view: &View, conic: &ImageConic) {
        let [rows, columns] = conic.image();
        self.clear(rows.clone(), columns);
        // Around the camera, everything is behind the near side.
        let side = if conic.holds_camera() {
            NearSide { from_m: f64::NEG_INFINITY, to_m: 0.0 }
        } else {
            NearSide { from_m: conic.nearest_z_m, to_m: conic.near_side_to_z_m }
        };
        for v in rows {
            let row = conic.row(v);
            for span in conic.spans(&row).into_iter().flatten() {
                self.area_px += span.len() as u32;
                self.fill_visible(view, v, &row, &span, &side);
            }
        }
    }

    /// Sets the pixels of a span that are `seen`, which is given the number of each word and the span's pixels in it.
    fn fill(&mut self, v: i32, span: &Range<i32>, mut seen: impl FnMut(usize, u64) -> u64) {
        let start = (v as usize - self.first_row) * self.words;
        for (word, bits) in (self.first_word..).zip(&mut self.bits[start..start + self.words]) {
            let seen = seen(word, span_bits(span, word));
            self.visible_px += seen.count_ones();
            *bits |= seen;
        }
    }

    /// Sets the pixels of a span in which the body is in front of what is static.
    fn fill_visible(&mut self, view: &View, v: i32, row: &Row, span: &Range<i32>, side: &NearSide) {
        let [to_m, from_m] = side.rounded();
        self.fill(v, span, |word, pixels| {
            let (mut seen, mut rest) = (0, pixels);
            while rest != 0 {
                let part = rest.trailing_zeros() as usize / STRETCH * STRETCH;
                let here = rest & (STRETCH_BITS << part);
                let static_z_m = view.stretch_z_m(word * 64 + part, v);
                let beyond = farther(static_z_m, to_m) << part;
                seen |= here & beyond;
                let doubtful = here & !beyond & farther(static_z_m, from_m) << part;
                if doubtful != 0 {
                    let in_front = row.is_in_front_of((word * 64 + part) as i32, static_z_m);
                    seen |= doubtful & u64::from(in_front) << part;
                }
                rest ^= here;
            }
            seen
        });
    }

    /// The rows this silhouette has words for.
    pub fn row_range(&self) -> Range<usize> {
        self.first_row..self.first_row + self.rows
    }

    /// The words of a row this silhouette has bits for, as numbers of words of the image's row.
    pub fn word_range(&self) -> Range<usize> {
        self.first_word..self.first_word + self.words
    }

    /// Every row this silhouette has words for: its number and its bits, one entry for each of [`Self::word_range`].
    pub fn rows(&self) -> impl Iterator<Item = (usize, &[u64])> {
        (self.first_row..).zip(self.bits.chunks_exact(self.words.max(1)))
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
        self.rows().flat_map(move |(row, bits)| {
            bits.iter().zip(self.word_range()).flat_map(move |(bits, word)| {
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

/// The pixels of a span that fall into a word of the image, as bits of the word.
fn span_bits(span: &Range<i32>, word: usize) -> u64 {
    let base = (word * 64) as i32;
    let before = |u: i32| if u < base + 64 { !(u64::MAX << (u - base).max(0)) } else { u64::MAX };
    before(span.end) & !before(span.start)
}

/// The pixels of a stretch whose depth is more than `bound_m`.
fn farther(static_z_m: &[f32; STRETCH], bound_m: f32) -> u64 {
    u64::from(f32x8::new(*static_z_m).simd_gt(f32x8::splat(bound_m)).to_bitmask())
}
