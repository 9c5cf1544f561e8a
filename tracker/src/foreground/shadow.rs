//! Shadows and reflections: pixels that show the background's own surface, darker or brighter.
//!
//! A shadow scales the background's colour by one factor (T. Horprasert, D. Harwood and L. S. Davis, "A statistical
//! approach for real-time robust background subtraction and shadow detection", ICCV FRAME-RATE Workshop 1999:
//! brightness and chromaticity distortion), and keeps its texture (normalised cross-correlation with the background; J.
//! C. S. Jacques Jr., C. R. Jung and S. R. Musse, "Background subtraction and shadow detection in grayscale video
//! sequences", SIBGRAPI 2005). A person's grey trousers before a grey floor pass the first test and fail the second
//! wherever the floor has any texture.

mod texture;

use image::{GrayImage, RgbImage};
use wide::{f32x4, i32x4, u8x16};

use texture::{Texture, TextureSums};

/// Options of the shadow detection.
#[derive(Debug, Clone, PartialEq)]
pub struct ShadowOptions {
    /// Limits where the background's texture shows through: the surface is certainly the same, so its light may differ
    /// a lot.
    pub textured: Shade,
    /// Limits where the background has no texture, so that colour alone decides.
    pub plain: Shade,
    /// Least correlation with the background's texture.
    pub correlation: f32,
}

/// Limits of the change of light on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade {
    /// Darkest shadow, as a fraction of the background's brightness.
    pub darkest: f32,
    /// Brightest reflection, as a fraction of the background's brightness.
    pub brightest: f32,
    /// Largest distance of the colour from the scaled background's, as a fraction of its brightness…
    pub chromaticity: f32,
    /// …or, where that is more, as a fraction of the pixel's tolerance.
    pub noise: f32,
}

impl Default for ShadowOptions {
    fn default() -> Self {
        Self {
            textured: Shade { darkest: 0.3, brightest: 1.5, chromaticity: 0.1, noise: 1.0 },
            plain: Shade { darkest: 0.6, brightest: 1.1, chromaticity: 0.05, noise: 0.7 },
            correlation: 0.6,
        }
    }
}

/// Score of a shadow: more than background, far less than foreground.
pub const SHADOW: u8 = 1;

/// Side of a cell over which texture is compared, pixels.
const CELL_PX: usize = 4;
/// Least correlation over four cells with the tested one in a corner: fewer pixels agree more often by chance.
const CORNER_CORRELATION: f32 = 0.85;

/// Shadow detector; it keeps its buffers between frames.
#[derive(Debug, Default)]
pub struct Shadows {
    /// Cells of the image, row by row, with an empty border.
    cells: Vec<ShadowCell>,
    /// Indices of the cells with changed pixels.
    changed: Vec<usize>,
    /// Highest score of each pixel column within a row of cells.
    highest: Vec<u8>,
}

impl Shadows {
    /// Sets the score to [`SHADOW`] where a foreground pixel shows a shadow or a reflection.
    ///
    /// `expected` is the background in the frame's exposure, `tolerance` that of each pixel, `least` the least score of
    /// a changed pixel. Scores of other pixels stay.
    pub fn mark(
        &mut self,
        (frame, expected): (&RgbImage, &RgbImage),
        tolerance: &[u8],
        least: u8,
        options: &ShadowOptions,
        score: &mut GrayImage,
    ) {
        let (width, height) = (frame.width() as usize, frame.height() as usize);
        let scene = ShadowScene { frame: frame.as_raw(), expected: expected.as_raw(), tolerance, width };
        // With a border of one cell on each side.
        let stride = width.div_ceil(CELL_PX) + 2;
        for cell in self.changed.drain(..) {
            self.cells[cell] = ShadowCell::default();
        }
        self.cells.resize(stride * (height.div_ceil(CELL_PX) + 2), ShadowCell::default());
        for (row, lines) in score.chunks((CELL_PX * width).max(1)).enumerate() {
            self.highest.clear();
            self.highest.resize(width.next_multiple_of(CELL_PX), 0);
            for line in lines.chunks(width) {
                for (highest, score) in self.highest.iter_mut().zip(line) {
                    *highest = (*highest).max(*score);
                }
            }
            // Nearly all of the image is background.
            let columns = self.highest.as_chunks::<CELL_PX>().0.iter().enumerate();
            for (column, _) in columns.filter(|(_, scores)| scores.iter().any(|score| *score >= least)) {
                let cell = (row + 1) * stride + column + 1;
                self.changed.push(cell);
                self.cells[cell] = scene.cell((score.as_raw(), least), (column, row), options);
            }
        }
        for cell in &self.changed {
            let explained = match self.texture(*cell, stride, options.correlation) {
                Texture::Same => self.cells[*cell].textured,
                Texture::None => self.cells[*cell].plain,
                Texture::Different => continue,
            };
            let (left, top) = ((cell % stride - 1) * CELL_PX, (cell / stride - 1) * CELL_PX);
            for bit in (0..CELL_PX * CELL_PX).filter(|bit| explained >> bit & 1 == 1) {
                score.as_mut()[(top + bit / CELL_PX) * width + left + bit % CELL_PX] = SHADOW;
            }
        }
    }

    /// Comparison of the textures around a cell: over it and its eight neighbours or, if those differ, as beside a leg,
    /// over the best of the four squares of four cells that hold it.
    fn texture(&self, cell: usize, stride: usize, correlation: f32) -> Texture {
        let first = cell - stride - 1;
        let square = |x: usize, y: usize, side: usize| {
            let lines = (y..y + side).map(|y| &self.cells[first + y * stride + x..][..side]);
            lines.flatten().fold(TextureSums::default(), |sum, cell| sum.plus(&cell.sums))
        };
        let whole = square(0, 0, 3).compare(correlation);
        if !matches!(whole, Texture::Different) {
            return whole;
        }
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)];
        let same = corners.iter().any(|(x, y)| {
            matches!(square(*x, *y, 2).compare(CORNER_CORRELATION.max(correlation)), Texture::Same)
        });
        if same { Texture::Same } else { Texture::Different }
    }
}

/// A square of the image's pixels.
#[derive(Debug, Clone, Copy, Default)]
struct ShadowCell {
    /// Sums over the changed pixels.
    sums: TextureSums,
    /// Changed pixels that show their background in other light by the limits for textured surfaces; row by row from
    /// the lowest bit on.
    textured: u16,
    /// The same by the limits for plain surfaces.
    plain: u16,
}

/// Pictures in which shadows are detected.
#[derive(Clone, Copy)]
struct ShadowScene<'a> {
    frame: &'a [u8],
    expected: &'a [u8],
    tolerance: &'a [u8],
    width: usize,
}

impl ShadowScene<'_> {
    fn cell(
        &self,
        (score, least): (&[u8], u8),
        (column, row): (usize, usize),
        options: &ShadowOptions,
    ) -> ShadowCell {
        let mut cell = ShadowCell::default();
        let mut sums = [i32x4::ZERO; 6];
        let left = column * CELL_PX;
        let count = CELL_PX.min(self.width - left);
        let rows = (row * CELL_PX..).take_while(|y| y * self.width < score.len()).take(CELL_PX);
        for (nth, y) in rows.enumerate() {
            let start = y * self.width + left;
            let scores = first(&score[start..start + count]);
            let changed: [i32; CELL_PX] = scores.map(|score| -i32::from(score >= least));
            if changed == [0; CELL_PX] {
                continue;
            }
            let changed = i32x4::new(changed);
            let (x, e) = (Four::load(self.frame, start), Four::load(self.expected, start));
            let tolerance = f32x4::new(first(&self.tolerance[start..start + count]).map(f32::from));
            let light = Light::of(&x, &e);
            let of = |shade: &Shade| changed & light.is_within(shade, tolerance);
            let (textured, plain) = (of(&options.textured), of(&options.plain));
            cell.textured |= (textured.to_bitmask() << (nth * CELL_PX)) as u16;
            cell.plain |= (plain.to_bitmask() << (nth * CELL_PX)) as u16;
            cell.sums.pixels += changed.to_bitmask().count_ones() as i32;
            // Only pixels that may show the background's surface.
            let (x, e) = (x.gray() & textured, e.gray() & textured);
            let all = [textured & i32x4::ONE, x, e, x * x, e * e, x * e];
            sums.iter_mut().zip(all).for_each(|(sum, one)| *sum += one);
        }
        let [n, x, e, xx, ee, xe] = sums.map(i32x4::reduce_add);
        cell.sums = TextureSums { n, x, e, xx, ee, xe, ..cell.sums };
        cell
    }
}

/// First values of a slice, padded with zeros.
fn first<const N: usize>(values: &[u8]) -> [u8; N] {
    values.first_chunk().copied().unwrap_or_else(|| {
        let mut first = [0; N];
        first[..values.len()].copy_from_slice(values);
        first
    })
}

/// Red, green and blue of four adjacent pixels.
struct Four([i32x4; 3]);

impl Four {
    /// Loads four pixels; black beyond the image's last.
    fn load(image: &[u8], pixel: usize) -> Self {
        /// For each channel, the indices of its values among the bytes, each as the lowest byte of an integer.
        const PLACES: [[u8; 16]; 3] = {
            let mut places = [[0x80; 16]; 3];
            let mut byte = 0;
            while byte < 3 * CELL_PX {
                places[byte % 3][byte / 3 * 4] = byte as u8;
                byte += 1;
            }
            places
        };
        let rest = &image[3 * pixel..];
        let bytes = u8x16::new(first(&rest[..rest.len().min(16)]));
        Self(PLACES.map(|places| {
            let spread = bytes.shuffle(u8x16::new(places)).to_array();
            let [a, b, c, d] = *spread.as_chunks::<4>().0.first_chunk().unwrap_or(&[[0; 4]; 4]);
            i32x4::new([a, b, c, d].map(i32::from_le_bytes))
        }))
    }

    /// Brightness, 0 to 255.
    fn gray(&self) -> i32x4 {
        (self.0[0] + (self.0[1] << 1) + self.0[2]) >> 2
    }

    fn dot(&self, other: &Self) -> f32x4 {
        let product = |c: usize| self.0[c].round_float() * other.0[c].round_float();
        product(0) + product(1) + product(2)
    }
}

/// Dot products of the colours of four pixels (x) with those of their background (e).
struct Light {
    ee: f32x4,
    xe: f32x4,
    xx: f32x4,
}

impl Light {
    fn of(x: &Four, e: &Four) -> Self {
        Self { ee: e.dot(e).max(f32x4::ONE), xe: x.dot(e), xx: x.dot(x) }
    }

    /// All bits are set where x is e, darker or brighter.
    fn is_within(&self, shade: &Shade, tolerance: f32x4) -> i32x4 {
        let Self { ee, xe, xx } = *self;
        // Squared residual of x beside its part along e, times the square of e; no division.
        let off = xx * ee - xe * xe;
        let noise = tolerance * f32x4::splat(shade.noise);
        let most = (ee * f32x4::splat(shade.chromaticity * shade.chromaticity)).max(noise * noise) * ee;
        let within = xe.simd_ge(ee * f32x4::splat(shade.darkest))
            & xe.simd_le(ee * f32x4::splat(shade.brightest))
            & off.simd_le(most);
        i32x4::new(within.to_array().map(|lane| lane.to_bits() as i32))
    }
}

/// Restores foreground that was taken for shadow inside a person: a run of shadow in a column, at most `longest_px`
/// long, directly between two foreground pixels (a white stripe of a sweater before a white wall). Real shadows lie
/// below people or beside them. `above` is a buffer of any length.
pub fn restore_enclosed(score: &mut GrayImage, foreground: u8, longest_px: u32, above: &mut Vec<u32>) {
    /// Farther above than the length of any run.
    const NOTHING: u32 = 1 << 31;
    const CHUNK_PX: usize = 32;
    let (width, height) = (score.width() as usize, score.height() as usize);
    // For each column the row of the foreground pixel above the present run of shadow.
    above.clear();
    above.resize(width, NOTHING);
    for y in 0..height {
        for (start, above) in above.chunks_mut(CHUNK_PX).enumerate().map(|(i, above)| (i * CHUNK_PX, above)) {
            let from = y * width + start;
            let here = &score.as_raw()[from..from + above.len()];
            // Nearly all of the image is background.
            if here.iter().fold(0, |all, s| all | s) == 0 {
                above.fill(NOTHING);
                continue;
            }
            let row = y as u32;
            let run = |top: u32| row.wrapping_sub(top).wrapping_sub(1);
            let is_enclosed =
                |here: u8, top: u32| (here >= foreground) & (run(top).wrapping_sub(1) < longest_px);
            let any = here.iter().zip(&*above).fold(false, |any, (here, top)| any | is_enclosed(*here, *top));
            if any {
                for (x, above) in (start..).zip(&*above) {
                    if is_enclosed(score.as_raw()[y * width + x], *above) {
                        for row in *above as usize + 1..y {
                            score.as_mut()[row * width + x] = foreground;
                        }
                    }
                }
            }
            for (above, here) in above.iter_mut().zip(&score.as_raw()[from..]) {
                let kept = if *here == SHADOW { *above } else { NOTHING };
                *above = if *here >= foreground { row } else { kept };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Luma, Rgb};

    /// A wooden floor: planks of different brightness.
    fn floor() -> RgbImage {
        RgbImage::from_fn(64, 48, |u, v| {
            let plank = ((u / 5 + 3 * (v / 7)) * 37 % 50) as u8;
            Rgb([150 + plank, 110 + plank / 2, 70 + plank / 3])
        })
    }

    fn left_after(change: impl Fn(u32, u32, Rgb<u8>) -> Rgb<u8>) -> usize {
        let floor = floor();
        let frame = RgbImage::from_fn(64, 48, |u, v| change(u, v, *floor.get_pixel(u, v)));
        let mut score = GrayImage::from_pixel(64, 48, Luma([200]));
        let options = ShadowOptions::default();
        Shadows::default().mark((&frame, &floor), &[14; 64 * 48], 64, &options, &mut score);
        score.iter().filter(|s| **s > SHADOW).count()
    }

    #[test]
    fn a_shadow_goes_and_a_reflection_goes() {
        for scale in [0.65, 0.75, 0.9, 1.08] {
            let left = left_after(|_, _, p| Rgb(p.0.map(|v| (v as f32 * scale) as u8)));
            assert!(left < 64 * 48 / 50, "{left} pixels left of a shadow of {scale}");
        }
    }

    #[test]
    fn a_stripe_in_a_body_comes_back_and_a_shadow_below_it_does_not() {
        let column = [0, 200, 1, 1, 200, 200, 1, 1, 1, 1, 200, 1, 1, 0, 200, 1];
        let mut score = GrayImage::from_fn(3, 16, |_, v| Luma([column[v as usize]]));
        restore_enclosed(&mut score, 64, 3, &mut Vec::new());
        let found: Vec<u8> = (0..16).map(|v| score.get_pixel(1, v)[0]).collect();
        assert_eq!(found, [0, 200, 64, 64, 200, 200, 1, 1, 1, 1, 200, 1, 1, 0, 200, 1]);
    }

    #[test]
    fn clothes_stay_whether_their_colour_or_their_texture_differs() {
        let blue = left_after(|_, _, _| Rgb([40, 50, 110]));
        let black = left_after(|_, _, _| Rgb([15, 12, 20]));
        // The floor's own mean colour at three quarters, but without the planks.
        let plain = left_after(|_, _, _| Rgb([131, 92, 58]));
        assert!(blue == 64 * 48 && black == 64 * 48, "{blue}, {black}");
        assert!(plain > 64 * 48 * 9 / 10, "{plain}");
    }
}
