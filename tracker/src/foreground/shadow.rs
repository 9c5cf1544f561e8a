//! Shadows and reflections: pixels that show the background's own surface, darker or brighter.
//!
//! A shadow scales the background's colour by one factor (Horprasert et al. 1999: brightness and chromaticity
//! distortion), and keeps its texture (normalised cross-correlation with the background, Jacques et al. 2005). A person's
//! grey trousers before a grey floor pass the first test and fail the second wherever the floor has any texture.

use image::{GrayImage, RgbImage};

/// How shadows are told.
#[derive(Debug, Clone, PartialEq)]
pub struct ShadowOptions {
    /// Where the background's texture shows through: what is known to be the same surface may be changed a lot.
    pub textured: Shade,
    /// Where the background has no texture, so that colour alone has to tell.
    pub plain: Shade,
    /// The least correlation with the background's texture.
    pub correlation: f32,
}

/// How much light may change on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shade {
    /// The darkest shadow, as a fraction of the background's brightness.
    pub darkest: f32,
    /// The brightest reflection.
    pub brightest: f32,
    /// How far the colour may lie from the scaled background's, as a fraction of its brightness…
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

/// The score of a shadow: more than background, far less than foreground.
pub const SHADOW: u8 = 1;

/// Texture is compared once for every cell of this many pixels squared.
const CELL_PX: usize = 4;
/// The least correlation over four cells with the one in question in a corner: fewer pixels agree by chance.
const CORNER_CORRELATION: f32 = 0.85;
/// Fewer pixels than this tell nothing about texture…
const LEAST_PIXELS: i32 = 12;
/// …nor does one of this many that have changed.
const LEAST_SHARE: i32 = 3;
/// Light scales texture as it scales brightness: by the same factor, up to this.
const SAME_FACTOR: f32 = 2.0;
/// Below this standard deviation of the background's grey levels there is no texture to compare.
const LEAST_TEXTURE: f32 = 4.0;
/// Above this standard deviation of the frame's grey levels a plain background is not what is seen.
const FOREIGN_TEXTURE: f32 = 16.0;

/// Tells shadows; keeps its buffers between frames.
#[derive(Debug, Default)]
pub struct Shadows {
    /// For each cell its sums, and in which frame they were made.
    cells: Vec<(Sums, u32)>,
    columns: usize,
    /// The highest score of each column of pixels within a row of cells.
    highest: Vec<u8>,
    frame: u32,
}

/// What a shadow is sought in.
#[derive(Clone, Copy)]
struct Scene<'a> {
    frame: &'a [u8],
    expected: &'a [u8],
    tolerance: &'a [u8],
    width: usize,
    height: usize,
}

impl Shadows {
    /// Sets the score to [`SHADOW`] where a pixel that would be foreground shows a shadow or a reflection.
    ///
    /// `expected` is the background in the frame's exposure, `tolerance` the pixels' own, `least` the least score that
    /// matters. Scores of other pixels stay.
    pub fn mark(
        &mut self,
        (frame, expected): (&RgbImage, &RgbImage),
        tolerance: &[u8],
        least: u8,
        options: &ShadowOptions,
        score: &mut GrayImage,
    ) {
        let (width, height) = (frame.width() as usize, frame.height() as usize);
        let scene = Scene { frame: frame.as_raw(), expected: expected.as_raw(), tolerance, width, height };
        self.columns = width.div_ceil(CELL_PX);
        self.frame += 1;
        self.cells.resize(self.columns * height.div_ceil(CELL_PX), (Sums::default(), 0));
        for top in (0..height).step_by(CELL_PX) {
            let rows = top..(top + CELL_PX).min(height);
            let mut highest = std::mem::take(&mut self.highest);
            highest.clear();
            highest.resize(width, 0);
            for row in score.as_raw()[rows.start * width..rows.end * width].chunks(width) {
                for (highest, score) in highest.iter_mut().zip(row) {
                    *highest = (*highest).max(*score);
                }
            }
            // Nearly all of the image is background.
            let changed = highest.chunks(CELL_PX).enumerate().filter(|(_, s)| s.iter().any(|s| *s >= least));
            for left in changed.map(|(column, _)| column * CELL_PX) {
                let columns = left..(left + CELL_PX).min(width);
                let shade = match self.texture(
                    &scene,
                    (score.as_raw(), least),
                    (left / CELL_PX, top / CELL_PX),
                    options,
                ) {
                    Texture::Same => &options.textured,
                    Texture::None => &options.plain,
                    Texture::Different => continue,
                };
                for i in rows.clone().flat_map(|y| columns.clone().map(move |x| y * width + x)) {
                    if score.as_raw()[i] >= least && scene.is_explained(i, shade) {
                        score.as_mut()[i] = SHADOW;
                    }
                }
            }
            self.highest = highest;
        }
    }

    /// How the textures compare around a cell: over it and its eight neighbours, or else, beside somebody's leg, in the
    /// one of the four squares of four cells that agrees best.
    fn texture(
        &mut self,
        scene: &Scene<'_>,
        score: (&[u8], u8),
        (column, row): (usize, usize),
        options: &ShadowOptions,
    ) -> Texture {
        let (columns, rows) = (self.columns, self.cells.len() / self.columns);
        let mut around = [[Sums::default(); 3]; 3];
        for (dy, line) in around.iter_mut().enumerate() {
            for (dx, sums) in line.iter_mut().enumerate() {
                let (x, y) = ((column + dx).wrapping_sub(1), (row + dy).wrapping_sub(1));
                if x < columns && y < rows {
                    *sums = self.cell(scene, score, x, y, &options.textured);
                }
            }
        }
        let square = |x: usize, y: usize, side: usize| {
            let cells = around[y..y + side].iter().flat_map(|line| &line[x..x + side]);
            cells.fold(Sums::default(), |sum, cell| sum.plus(cell))
        };
        let whole = square(0, 0, 3).compare(options.correlation);
        if !matches!(whole, Texture::Different) {
            return whole;
        }
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)];
        let same = corners.iter().any(|(x, y)| {
            matches!(square(*x, *y, 2).compare(CORNER_CORRELATION.max(options.correlation)), Texture::Same)
        });
        if same { Texture::Same } else { Texture::Different }
    }

    /// A cell's sums, made at most once a frame.
    fn cell(
        &mut self,
        scene: &Scene<'_>,
        (score, least): (&[u8], u8),
        column: usize,
        row: usize,
        shade: &Shade,
    ) -> Sums {
        let (sums, made) = &mut self.cells[row * self.columns + column];
        if *made != self.frame {
            *made = self.frame;
            *sums = Sums::default();
            let (left, top) = (column * CELL_PX, row * CELL_PX);
            for y in top..(top + CELL_PX).min(scene.height) {
                let row = y * scene.width + left..y * scene.width + (left + CELL_PX).min(scene.width);
                for (i, score) in row.clone().zip(&score[row]) {
                    // Only what has changed, also where that has been marked since: a shadow's rim has two brightnesses.
                    if *score < least && *score != SHADOW {
                        continue;
                    }
                    sums.pixels += 1;
                    if scene.is_explained(i, shade) {
                        sums.add(gray(&scene.frame[3 * i..]), gray(&scene.expected[3 * i..]));
                    }
                }
            }
        }
        *sums
    }
}

impl Scene<'_> {
    /// Whether a pixel shows its background, darker or brighter.
    fn is_explained(&self, i: usize, shade: &Shade) -> bool {
        shade.explains(&self.frame[3 * i..], &self.expected[3 * i..], self.tolerance[i])
    }
}

/// Gives back what was taken for shadow in the middle of somebody: a run of shadow in a column, at most `longest_px`
/// long, right between two foreground pixels (a white stripe of a sweater before a white wall). Shadows lie below
/// people or beside them. `above` is a buffer of any length.
pub fn restore_enclosed(score: &mut GrayImage, foreground: u8, longest_px: u32, above: &mut Vec<u32>) {
    const NOTHING: u32 = u32::MAX;
    const CHUNK_PX: usize = 32;
    let (width, height) = (score.width() as usize, score.height() as usize);
    // For each column the row of the foreground pixel above the present run of shadow.
    above.clear();
    above.resize(width, NOTHING);
    for y in 0..height {
        for (start, above) in above.chunks_mut(CHUNK_PX).enumerate().map(|(i, above)| (i * CHUNK_PX, above)) {
            let from = y * width + start;
            // Nearly all of the image is background.
            if score.as_raw()[from..from + above.len()].iter().fold(0, |all, s| all | s) == 0 {
                above.fill(NOTHING);
                continue;
            }
            for (x, above) in (start..).zip(above) {
                let here = score.as_raw()[y * width + x];
                if here >= foreground {
                    let top = *above;
                    let run = (y as u32).wrapping_sub(top).wrapping_sub(1);
                    if top != NOTHING && (1..=longest_px).contains(&run) {
                        for row in top as usize + 1..y {
                            score.as_mut()[row * width + x] = foreground;
                        }
                    }
                    *above = y as u32;
                } else if here != SHADOW {
                    *above = NOTHING;
                }
            }
        }
    }
}

impl Shade {
    /// Whether `x` is `e`, darker or brighter.
    fn explains(&self, x: &[u8], e: &[u8], tolerance: u8) -> bool {
        let (x, e) = (rgb(x), rgb(e));
        let dot = |a: &[f32; 3], b: &[f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let squared = dot(&e, &e).max(1.0);
        let both = dot(&x, &e);
        if both < self.darkest * squared || both > self.brightest * squared {
            return false;
        }
        // What is left of x beside its part along e, times e's square; no division.
        let off = dot(&x, &x) * squared - both * both;
        let noise = self.noise * tolerance as f32;
        off <= (self.chromaticity * self.chromaticity * squared).max(noise * noise) * squared
    }
}

/// How the frame's texture around a cell compares with the background's.
enum Texture {
    Same,
    Different,
    /// Neither has any.
    None,
}

/// Sums over pixels of the frame's (x) and the background's (e) brightness, where the frame may show the background's
/// surface at all: of somebody's leg beside a shadow nothing is to be learnt about the shadow.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    /// All pixels that have changed, and those of them that count.
    pixels: i32,
    n: i32,
    x: i32,
    e: i32,
    xx: i32,
    ee: i32,
    xe: i32,
}

impl Sums {
    fn add(&mut self, x: i32, e: i32) {
        self.n += 1;
        self.x += x;
        self.e += e;
        self.xx += x * x;
        self.ee += e * e;
        self.xe += x * e;
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            n: self.n + other.n,
            x: self.x + other.x,
            e: self.e + other.e,
            xx: self.xx + other.xx,
            ee: self.ee + other.ee,
            xe: self.xe + other.xe,
        }
    }

    fn compare(&self, correlation: f32) -> Texture {
        if self.n < LEAST_PIXELS || LEAST_SHARE * self.n < self.pixels {
            return Texture::Different;
        }
        let n = self.n as f32;
        let (mx, me) = (self.x as f32 / n, self.e as f32 / n);
        let (vx, ve) = (self.xx as f32 / n - mx * mx, self.ee as f32 / n - me * me);
        if ve < LEAST_TEXTURE * LEAST_TEXTURE {
            // A fold, a pattern or an edge where the background is plain is somebody's; a soft shadow's rim is weaker.
            return if vx > FOREIGN_TEXTURE * FOREIGN_TEXTURE { Texture::Different } else { Texture::None };
        }
        let covariance = self.xe as f32 / n - mx * me;
        let (factor, of_texture) = (mx / me.max(1.0), covariance / ve);
        let same = covariance >= correlation * (vx.max(1.0) * ve).sqrt()
            && (factor / SAME_FACTOR..=factor * SAME_FACTOR).contains(&of_texture);
        if same { Texture::Same } else { Texture::Different }
    }
}

fn rgb(p: &[u8]) -> [f32; 3] {
    [p[0] as f32, p[1] as f32, p[2] as f32]
}

/// Brightness, 0 to 255.
fn gray(p: &[u8]) -> i32 {
    (p[0] as i32 + 2 * p[1] as i32 + p[2] as i32) / 4
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
