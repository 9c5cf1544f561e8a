//! Shadows and reflections: pixels that show the background's own surface, darker or brighter.
//!
//! A shadow scales the background's colour by one factor (Horprasert et al. 1999: brightness and chromaticity
//! distortion), and keeps its texture (normalised cross-correlation with the background, Jacques et al. 2005). A person's
//! grey trousers before a grey floor pass the first test and fail the second wherever the floor has any texture.

use image::{GrayImage, RgbImage};

/// How shadows are told.
#[derive(Debug, Clone, PartialEq)]
pub struct ShadowOptions {
    /// The darkest shadow, as a fraction of the background's brightness.
    pub darkest: f32,
    /// The brightest reflection.
    pub brightest: f32,
    /// How far the colour may lie from the scaled background's, as a fraction of its brightness…
    pub chromaticity: f32,
    /// …or, where that is more, as a fraction of the pixel's tolerance.
    pub noise: f32,
    /// The least correlation with the background's texture.
    pub correlation: f32,
}

impl Default for ShadowOptions {
    fn default() -> Self {
        Self { darkest: 0.5, brightest: 1.25, chromaticity: 0.06, noise: 0.7, correlation: 0.6 }
    }
}

/// Half the side of the window over which texture is compared.
const WINDOW_PX: usize = 4;
/// Texture is compared once for every cell of this many pixels squared.
const CELL_PX: usize = 4;
/// Below this standard deviation of the background's grey levels there is no texture to compare.
const LEAST_TEXTURE: f32 = 3.5;

/// Sets the score to 0 where a pixel that would be foreground shows a shadow or a reflection.
///
/// `expected` is the background in the frame's exposure, `tolerance` the pixels' own, `least` the least score that
/// matters. Scores of other pixels stay.
pub fn remove_shadows(
    frame: &RgbImage,
    expected: &RgbImage,
    tolerance: &[u8],
    least: u8,
    options: &ShadowOptions,
    score: &mut GrayImage,
) {
    let (width, height) = (frame.width() as usize, frame.height() as usize);
    let mut shaded = [[false; CELL_PX]; CELL_PX];
    for top in (0..height).step_by(CELL_PX) {
        let bottom = (top + CELL_PX).min(height);
        for left in (0..width).step_by(CELL_PX) {
            let right = (left + CELL_PX).min(width);
            let mut any = false;
            for y in top..bottom {
                for x in left..right {
                    let i = y * width + x;
                    let dark = score.as_raw()[i] >= least
                        && is_scaled(
                            &frame.as_raw()[3 * i..],
                            &expected.as_raw()[3 * i..],
                            tolerance[i],
                            options,
                        );
                    shaded[y - top][x - left] = dark;
                    any |= dark;
                }
            }
            if !any || differs_in_texture(frame, expected, left, top, options.correlation) {
                continue;
            }
            for y in top..bottom {
                for x in left..right {
                    if shaded[y - top][x - left] {
                        score.as_mut()[y * width + x] = 0;
                    }
                }
            }
        }
    }
}

/// Whether `x` is `e`, darker or brighter.
fn is_scaled(x: &[u8], e: &[u8], tolerance: u8, options: &ShadowOptions) -> bool {
    let (x, e) = (rgb(x), rgb(e));
    let squared: f32 = e.iter().map(|e| e * e).sum();
    let scale = x.iter().zip(&e).map(|(x, e)| x * e).sum::<f32>() / squared.max(1.0);
    if !(options.darkest..=options.brightest).contains(&scale) {
        return false;
    }
    let off: f32 = x.iter().zip(&e).map(|(x, e)| (x - scale * e) * (x - scale * e)).sum();
    let limit = (options.chromaticity * squared.sqrt()).max(options.noise * tolerance as f32);
    off <= limit * limit
}

fn rgb(p: &[u8]) -> [f32; 3] {
    [p[0] as f32, p[1] as f32, p[2] as f32]
}

/// Whether the frame's texture around a cell is another one than the background's. `false` where there is none.
fn differs_in_texture(frame: &RgbImage, expected: &RgbImage, left: usize, top: usize, least: f32) -> bool {
    let (width, height) = (frame.width() as usize, frame.height() as usize);
    let span = |from: usize, end: usize| {
        let centre = from + CELL_PX / 2;
        centre.saturating_sub(WINDOW_PX)..(centre + WINDOW_PX).min(end)
    };
    let [mut n, mut sx, mut se, mut sxx, mut see, mut sxe] = [0_i32; 6];
    for y in span(top, height) {
        for i in span(left, width).map(|x| 3 * (y * width + x)) {
            let (x, e) = (gray(&frame.as_raw()[i..i + 3]), gray(&expected.as_raw()[i..i + 3]));
            n += 1;
            sx += x;
            se += e;
            sxx += x * x;
            see += e * e;
            sxe += x * e;
        }
    }
    let n = n as f32;
    let (mx, me) = (sx as f32 / n, se as f32 / n);
    let (vx, ve) = (sxx as f32 / n - mx * mx, see as f32 / n - me * me);
    if ve < LEAST_TEXTURE * LEAST_TEXTURE {
        return false;
    }
    let covariance = sxe as f32 / n - mx * me;
    covariance < least * (vx.max(1.0) * ve).sqrt()
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
        remove_shadows(&frame, &floor, &[14; 64 * 48], 64, &ShadowOptions::default(), &mut score);
        score.iter().filter(|s| **s > 0).count()
    }

    #[test]
    fn a_shadow_goes_and_a_reflection_goes() {
        for scale in [0.6, 0.75, 0.9, 1.1] {
            let left = left_after(|_, _, p| Rgb(p.0.map(|v| (v as f32 * scale) as u8)));
            assert!(left < 64 * 48 / 50, "{left} pixels left of a shadow of {scale}");
        }
    }

    #[test]
    fn clothes_stay_whether_their_colour_or_their_texture_differs() {
        let blue = left_after(|_, _, _| Rgb([40, 50, 110]));
        let black = left_after(|_, _, _| Rgb([20, 18, 15]));
        // The floor's own mean colour at three quarters, but without the planks.
        let plain = left_after(|_, _, _| Rgb([131, 92, 58]));
        assert!(blue == 64 * 48 && black == 64 * 48, "{blue}, {black}");
        assert!(plain > 64 * 48 * 9 / 10, "{plain}");
    }
}
