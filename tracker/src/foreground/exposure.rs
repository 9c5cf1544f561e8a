//! How a frame's exposure and white balance differ from the background's: a gain and a bias for each channel, fitted to
//! a grid of pixels so that people in the picture do not matter.

use image::RgbImage;

/// About this many pixels take part in a fit.
const GRID_PIXELS: usize = 4096;
/// Values outside are clipped by the sensor and say nothing about the exposure.
const UNCLIPPED: std::ops::RangeInclusive<u8> = 6..=248;
/// Rounds of fitting and leaving out; the inliers settle in two or three.
const ROUNDS: usize = 4;
/// A pixel always counts as an inlier within this many levels: sensor noise.
const NOISE_LEVELS: f32 = 4.0;
/// Holds the bias at nothing where the pixels hardly differ in brightness, as a fraction of the pixels…
const BIAS_PRIOR: f64 = 0.02;
/// …and the gain at 1, in squared levels a pixel: noise in both pictures flattens a line through a single level.
const GAIN_PRIOR: f64 = 30.0;
/// Beyond these gains the picture is dark or burnt out, and no compensation brings it back.
const GAIN_RANGE: std::ops::RangeInclusive<f32> = 0.2..=4.0;

/// `frame = gain · background + bias`, channel by channel, in levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Red, green, blue.
    pub gain: [f32; 3],
    /// Red, green, blue, in levels of 0 to 255.
    pub bias: [f32; 3],
}

impl Default for Exposure {
    fn default() -> Self {
        Self { gain: [1.0; 3], bias: [0.0; 3] }
    }
}

impl Exposure {
    /// Fits the exposure of `frame` against `background`, starting from a near one (the frame before's). Each channel
    /// is a least-squares line, refitted after leaving out what lies off it: people, moved things, clipped pixels. A
    /// channel that cannot be fitted keeps the start's values.
    pub fn fit(background: &RgbImage, frame: &RgbImage, start: &Self) -> Self {
        let stride = (background.len() / 3 / GRID_PIXELS).max(1);
        let mut fitted = *start;
        let mut pairs: Vec<(f32, f32)> = Vec::with_capacity(GRID_PIXELS + 1);
        for channel in 0..3 {
            pairs.clear();
            let values = |image: &RgbImage, pixel: usize| image.as_raw()[3 * pixel + channel];
            for pixel in grid(background.width() as usize, background.height() as usize, stride) {
                let (b, x) = (values(background, pixel), values(frame, pixel));
                if UNCLIPPED.contains(&b) && UNCLIPPED.contains(&x) {
                    pairs.push((b as f32, x as f32));
                }
            }
            if let Some((gain, bias)) = fit_line(&pairs, start.gain[channel], start.bias[channel]) {
                fitted.gain[channel] = gain;
                fitted.bias[channel] = bias;
            }
        }
        fitted
    }

    /// What a background level looks like in the frame, for every level and channel.
    pub fn table(&self) -> [[u8; 256]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|level| self.apply(c, level as f32).round() as u8))
    }

    /// What a level of the frame would be in the background's exposure, for every level and channel.
    pub fn inverse_table(&self) -> [[u8; 256]; 3] {
        std::array::from_fn(|c| {
            std::array::from_fn(|level| {
                ((level as f32 - self.bias[c]) / self.gain[c]).clamp(0.0, 255.0).round() as u8
            })
        })
    }

    fn apply(&self, channel: usize, level: f32) -> f32 {
        (self.gain[channel] * level + self.bias[channel]).clamp(0.0, 255.0)
    }

    /// The mean gain of the three channels.
    pub fn mean_gain(&self) -> f32 {
        self.gain.iter().sum::<f32>() / 3.0
    }
}

/// Pixels spread over the image, row by row, each row shifted so that no column pattern is hit again and again.
fn grid(width: usize, height: usize, stride: usize) -> impl Iterator<Item = usize> {
    let step = (stride as f64).sqrt().round().max(1.0) as usize;
    (0..height)
        .step_by(step)
        .flat_map(move |y| ((y * 7 / step) % step..width).step_by(step).map(move |x| y * width + x))
}

fn fit_line(pairs: &[(f32, f32)], mut gain: f32, mut bias: f32) -> Option<(f32, f32)> {
    if pairs.len() < 32 {
        return None;
    }
    let mut residuals: Vec<f32> = Vec::with_capacity(pairs.len());
    for _ in 0..ROUNDS {
        residuals.clear();
        residuals.extend(pairs.iter().map(|(b, x)| (x - gain * b - bias).abs()));
        let middle = residuals.len() / 2;
        let (_, median, _) = residuals.select_nth_unstable_by(middle, f32::total_cmp);
        let limit = (2.5 * 1.4826 * *median).max(NOISE_LEVELS);
        let [mut n, mut sb, mut sx, mut sbb, mut sbx] = [0.0_f64; 5];
        for &(b, x) in pairs {
            if (x - gain * b - bias).abs() <= limit {
                let (b, x) = (b as f64, x as f64);
                n += 1.0;
                sb += b;
                sx += x;
                sbb += b * b;
                sbx += b * x;
            }
        }
        sbb += n * GAIN_PRIOR;
        sbx += n * GAIN_PRIOR;
        let n_bias = n * (1.0 + BIAS_PRIOR);
        let determinant = sbb * n_bias - sb * sb;
        if determinant <= 0.0 {
            return None;
        }
        gain = ((sbx * n_bias - sb * sx) / determinant) as f32;
        bias = ((sbb * sx - sb * sbx) / determinant) as f32;
        if !GAIN_RANGE.contains(&gain) {
            return None;
        }
    }
    Some((gain, bias))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    fn background() -> RgbImage {
        RgbImage::from_fn(160, 120, |u, v| {
            Rgb([40 + (u % 97) as u8, 60 + (v % 83) as u8, 30 + ((u + v) % 130) as u8])
        })
    }

    #[test]
    fn a_gain_and_bias_are_found_although_a_third_of_the_picture_is_covered() {
        let background = background();
        let truth = Exposure { gain: [1.12, 1.05, 0.9], bias: [-6.0, 3.0, 10.0] };
        let frame = RgbImage::from_fn(160, 120, |u, v| {
            if u < 53 {
                return Rgb([20, 30, 90]);
            }
            let noise = ((u * 31 + v * 17) % 5) as f32 - 2.0;
            let b = background.get_pixel(u, v);
            Rgb(std::array::from_fn(|c| (truth.apply(c, b[c] as f32) + noise).round() as u8))
        });
        let found = Exposure::fit(&background, &frame, &Exposure::default());
        for c in 0..3 {
            for level in [40.0, 80.0, 120.0] {
                let (f, t) = (found.apply(c, level), truth.apply(c, level));
                assert!((f - t).abs() < 1.5, "channel {c} level {level}: {f} against {t}");
            }
        }
    }

    #[test]
    fn the_tables_undo_each_other() {
        let exposure = Exposure { gain: [1.2, 0.9, 1.0], bias: [4.0, -3.0, 0.0] };
        let (there, back) = (exposure.table(), exposure.inverse_table());
        for c in 0..3 {
            for level in 10..200_u8 {
                assert!(back[c][there[c][level as usize] as usize].abs_diff(level) <= 1);
            }
        }
    }

    #[test]
    fn a_flat_or_empty_picture_leaves_the_start() {
        let start = Exposure { gain: [1.1; 3], bias: [2.0; 3] };
        let empty = RgbImage::new(0, 0);
        assert_eq!(Exposure::fit(&empty, &empty, &start), start);
        let black = RgbImage::new(64, 48);
        assert_eq!(Exposure::fit(&black, &black, &start), start);
        // One level only: gain and bias cannot be told apart, but together they must explain it.
        let flat = |level| RgbImage::from_pixel(64, 48, Rgb([level; 3]));
        let found = Exposure::fit(&flat(100), &flat(110), &Exposure::default());
        assert!((found.apply(0, 100.0) - 110.0).abs() < 1.0, "{found:?}");
    }
}
