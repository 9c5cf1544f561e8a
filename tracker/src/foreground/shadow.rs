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

/// Half the side of the window over which texture is compared.
const WINDOW_PX: usize = 4;
/// Texture is compared once for every cell of this many pixels squared.
const CELL_PX: usize = 4;
/// Below this standard deviation of the background's grey levels there is no texture to compare.
const LEAST_TEXTURE: f32 = 4.0;
/// Above this standard deviation of the frame's grey levels a plain background is not what is seen.
const FOREIGN_TEXTURE: f32 = 16.0;

/// Sets the score to [`SHADOW`] where a pixel that would be foreground shows a shadow or a reflection.
///
/// `expected` is the background in the frame's exposure, `tolerance` the pixels' own, `least` the least score that
/// matters. Scores of other pixels stay.
pub fn mark_shadows(
    frame: &RgbImage,
    expected: &RgbImage,
    tolerance: &[u8],
    least: u8,
    options: &ShadowOptions,
    score: &mut GrayImage,
) {
    let (width, height) = (frame.width() as usize, frame.height() as usize);
    let mut grays = Grays::default();
    for top in (0..height).step_by(CELL_PX) {
        let rows = top..(top + CELL_PX).min(height);
        let matters = |left: usize, score: &GrayImage| {
            let right = (left + CELL_PX).min(width);
            rows.clone().any(|y| {
                let scores = &score.as_raw()[y * width + left..y * width + right];
                // Nearly all of the image is background.
                scores.iter().fold(0, |all, s| all | s) >= least && scores.iter().any(|s| *s >= least)
            })
        };
        let mut left = 0;
        while left < width {
            // A run of cells in which there is something to judge.
            let start = left;
            while left < width && matters(left, score) {
                left += CELL_PX;
            }
            if left > start {
                grays.take(frame, expected, start..left, top);
            }
            for left in (start..left).step_by(CELL_PX) {
                let shade = match grays.texture(left, options.correlation) {
                    Texture::Same => &options.textured,
                    Texture::None => &options.plain,
                    Texture::Different => continue,
                };
                for i in
                    rows.clone().flat_map(|y| (left..(left + CELL_PX).min(width)).map(move |x| y * width + x))
                {
                    if score.as_raw()[i] >= least
                        && shade.explains(&frame.as_raw()[3 * i..], &expected.as_raw()[3 * i..], tolerance[i])
                    {
                        score.as_mut()[i] = SHADOW;
                    }
                }
            }
            left += CELL_PX;
        }
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
        let squared: f32 = e.iter().map(|e| e * e).sum();
        let scale = x.iter().zip(&e).map(|(x, e)| x * e).sum::<f32>() / squared.max(1.0);
        if !(self.darkest..=self.brightest).contains(&scale) {
            return false;
        }
        let off: f32 = x.iter().zip(&e).map(|(x, e)| (x - scale * e) * (x - scale * e)).sum();
        let limit = (self.chromaticity * squared.sqrt()).max(self.noise * tolerance as f32);
        off <= limit * limit
    }
}

/// How the frame's texture around a cell compares with the background's.
enum Texture {
    Same,
    Different,
    /// Neither has any.
    None,
}

fn rgb(p: &[u8]) -> [f32; 3] {
    [p[0] as f32, p[1] as f32, p[2] as f32]
}

/// Brightness of frame and background around a run of cells of one row of cells.
#[derive(Default)]
struct Grays {
    /// Frame, background; row by row.
    pixels: [Vec<i32>; 2],
    columns: std::ops::Range<usize>,
    rows: usize,
}

impl Grays {
    /// Looks at the windows around the cells that start in `cells`; they begin at row `top`.
    fn take(&mut self, frame: &RgbImage, expected: &RgbImage, cells: std::ops::Range<usize>, top: usize) {
        let (width, height) = (frame.width() as usize, frame.height() as usize);
        let rows = window(top, height);
        let last = cells.end - CELL_PX;
        self.columns = window(cells.start, width).start..window(last, width).end;
        self.rows = rows.len();
        for (pixels, image) in self.pixels.iter_mut().zip([frame, expected]) {
            pixels.clear();
            for y in rows.clone() {
                let from = 3 * (y * width + self.columns.start);
                let row = &image.as_raw()[from..from + 3 * self.columns.len()];
                pixels.extend(row.chunks_exact(3).map(gray));
            }
        }
    }

    /// How the textures compare around the cell that starts at column `left`.
    fn texture(&self, left: usize, least: f32) -> Texture {
        let stride = self.columns.len();
        let columns = window(left, self.columns.end);
        let columns = columns.start - self.columns.start..columns.end - self.columns.start;
        let [mut sx, mut se, mut sxx, mut see, mut sxe] = [0_i32; 5];
        for row in 0..self.rows {
            let row = row * stride + columns.start..row * stride + columns.end;
            for (x, e) in self.pixels[0][row.clone()].iter().zip(&self.pixels[1][row]) {
                sx += x;
                se += e;
                sxx += x * x;
                see += e * e;
                sxe += x * e;
            }
        }
        let n = (self.rows * columns.len()) as f32;
        let (mx, me) = (sx as f32 / n, se as f32 / n);
        let (vx, ve) = (sxx as f32 / n - mx * mx, see as f32 / n - me * me);
        if ve < LEAST_TEXTURE * LEAST_TEXTURE {
            // A fold, a pattern or an edge where the background is plain is somebody's; a soft shadow's rim is weaker.
            return if vx > FOREIGN_TEXTURE * FOREIGN_TEXTURE { Texture::Different } else { Texture::None };
        }
        let covariance = sxe as f32 / n - mx * me;
        if covariance < least * (vx.max(1.0) * ve).sqrt() { Texture::Different } else { Texture::Same }
    }
}

/// Rows or columns around a cell over which texture is compared.
fn window(cell: usize, end: usize) -> std::ops::Range<usize> {
    let centre = cell + CELL_PX / 2;
    centre.saturating_sub(WINDOW_PX)..(centre + WINDOW_PX).min(end)
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
        mark_shadows(&frame, &floor, &[14; 64 * 48], 64, &ShadowOptions::default(), &mut score);
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
