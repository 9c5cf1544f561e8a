//! Exposure and white balance of a frame relative to the background: a gain and a bias for each channel, fitted
//! robustly to a grid of pixels so that people in the picture have no effect.

use image::RgbImage;

/// Approximate number of pixels in a fit.
const GRID_PIXELS: usize = 3000;
/// Levels that the sensor does not clip; others hold no information about the exposure.
const UNCLIPPED: std::ops::RangeInclusive<u8> = 6..=248;
/// Largest residual of a pixel that takes part, levels, for each round.
const ROUNDS_LEVELS: [f32; 4] = [32.0, 20.0, 12.0, 8.0];
/// Share of explained pixels from which on no other starting point is tried.
const CONVINCING: f64 = 0.7;
/// Width of a bin of the histogram of brightness ratios, as a ratio.
const RATIO_BIN: f32 = 1.03;
/// Weight that keeps the bias at 0 where pixels hardly differ in brightness, as a fraction of the pixels…
const BIAS_PRIOR: f64 = 0.02;
/// …and weight that keeps the gain at 1, squared levels a pixel: noise in both pictures flattens a line through a
/// single level.
const GAIN_PRIOR: f64 = 30.0;
/// Gains that can be compensated; beyond them the picture is dark or overexposed.
const GAIN_RANGE: std::ops::RangeInclusive<f32> = 0.2..=4.0;

/// Exposure of a frame, `frame = gain · background + bias` for each channel, in levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exposure {
    /// Gains of red, green and blue.
    pub gain: [f32; 3],
    /// Biases of red, green and blue, in levels of 0 to 255.
    pub bias: [f32; 3],
}

impl Default for Exposure {
    fn default() -> Self {
        Self { gain: [1.0; 3], bias: [0.0; 3] }
    }
}

impl Exposure {
    /// Fits the exposure of `frame` against `background`, starting from `start` (that of the previous frame). Each
    /// channel is a least-squares line, refitted after removing outliers: people, moved things, clipped pixels. Where
    /// that explains little, the fit is repeated from the identity and from the most frequent brightness ratio, and the
    /// line that explains most is taken. A channel that cannot be fitted keeps its start values.
    pub fn fit(background: &RgbImage, frame: &RgbImage, start: &Self) -> Self {
        Self::fit_samples(&samples(background), &samples(frame), start)
    }

    /// As [`Self::fit`], from the [`samples`] of both pictures.
    pub(super) fn fit_samples(background: &[[u8; 3]], frame: &[[u8; 3]], start: &Self) -> Self {
        let mut fitted = *start;
        let mut pairs = LevelPairs::default();
        for channel in 0..3 {
            pairs.clear();
            for (b, x) in background.iter().zip(frame).map(|(b, x)| (b[channel], x[channel])) {
                if UNCLIPPED.contains(&b) && UNCLIPPED.contains(&x) {
                    pairs.push(b, x);
                }
            }
            if let Some((gain, bias)) = fit_from_anywhere(&pairs, (start.gain[channel], start.bias[channel]))
            {
                fitted.gain[channel] = gain;
                fitted.bias[channel] = bias;
            }
        }
        fitted
    }

    /// Level in the frame's exposure for every background level and channel.
    pub fn table(&self) -> [[u8; 256]; 3] {
        std::array::from_fn(|c| std::array::from_fn(|level| self.apply(c, level as f32).round() as u8))
    }

    /// Level in the background's exposure for every frame level and channel.
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
}

/// Pixels of a picture that take part in a fit.
pub(super) fn samples(image: &RgbImage) -> Vec<[u8; 3]> {
    let stride = (image.len() / 3 / GRID_PIXELS).max(1);
    let pixels = image.as_raw().as_chunks::<3>().0;
    grid(image.width() as usize, image.height() as usize, stride).map(|pixel| pixels[pixel]).collect()
}

/// Indices of pixels spread over the image, row by row, each row shifted so that no column pattern is sampled
/// repeatedly.
fn grid(width: usize, height: usize, stride: usize) -> impl Iterator<Item = usize> {
    let step = (stride as f64).sqrt().round().max(1.0) as usize;
    (0..height)
        .step_by(step)
        .flat_map(move |y| ((y * 7 / step) % step..width).step_by(step).map(move |x| y * width + x))
}

/// Levels of one channel in the background and in the frame, pixel by pixel.
#[derive(Default)]
struct LevelPairs {
    b: Vec<u8>,
    x: Vec<u8>,
}

impl LevelPairs {
    fn clear(&mut self) {
        self.b.clear();
        self.x.clear();
    }

    fn push(&mut self, b: u8, x: u8) {
        self.b.push(b);
        self.x.push(x);
    }

    fn iter(&self) -> impl Iterator<Item = (u8, u8)> {
        self.b.iter().copied().zip(self.x.iter().copied())
    }

    /// Sums over the pairs within `levels` of a line. Integers, so exact in any order.
    fn near(&self, line: (f32, f32), levels: f32) -> LineSums {
        let mut all = LineSums::default();
        for (b, x) in self.iter() {
            // 0 or all bits: without branches the loop is vectorised.
            let near = u32::from(is_near((f32::from(b), f32::from(x)), line, levels)).wrapping_neg();
            let (b, x) = (u32::from(b), u32::from(x));
            all.n += near & 1;
            all.b += near & b;
            all.x += near & x;
            all.bb += near & (b * b);
            all.bx += near & (b * x);
        }
        all
    }
}

/// Sums over pairs; sums of products stay below 2³² up to 66,000 pairs.
#[derive(Default)]
struct LineSums {
    n: u32,
    b: u32,
    x: u32,
    bb: u32,
    bx: u32,
}

/// Line through the pairs that explains most of them.
fn fit_from_anywhere(pairs: &LevelPairs, start: (f32, f32)) -> Option<(f32, f32)> {
    if pairs.b.len() < 32 {
        return None;
    }
    let enough = (CONVINCING * pairs.b.len() as f64) as u32;
    let mut best: Option<(u32, (f32, f32))> = None;
    for attempt in 0..3 {
        let start = match attempt {
            0 => start,
            1 => (1.0, 0.0),
            _ => (commonest_ratio(pairs), 0.0),
        };
        if let Some(line) = fit_line(pairs, start) {
            let explained = pairs.near(line, 8.0).n;
            if best.is_none_or(|(most, _)| explained > most) {
                best = Some((explained, line));
            }
            if explained >= enough {
                break;
            }
        }
    }
    best.map(|(_, line)| line)
}

fn is_near((b, x): (f32, f32), (gain, bias): (f32, f32), levels: f32) -> bool {
    (x - gain * b - bias).abs() <= levels
}

/// Middle of the fullest range of three bins in the histogram of frame by background.
fn commonest_ratio(pairs: &LevelPairs) -> f32 {
    const BINS: usize = 96;
    let mut histogram = [0_u32; BINS];
    for (b, x) in pairs.iter() {
        let bin = (f32::from(x) / f32::from(b)).ln() / RATIO_BIN.ln() + BINS as f32 / 2.0;
        if (0.0..BINS as f32).contains(&bin) {
            histogram[bin as usize] += 1;
        }
    }
    let fullest =
        (1..BINS - 1).max_by_key(|i| histogram[i - 1..=i + 1].iter().sum::<u32>()).unwrap_or(BINS / 2);
    RATIO_BIN.powf(fullest as f32 + 0.5 - BINS as f32 / 2.0)
}

fn fit_line(pairs: &LevelPairs, start: (f32, f32)) -> Option<(f32, f32)> {
    let mut line = start;
    for levels in ROUNDS_LEVELS {
        let sums = pairs.near(line, levels);
        let [n, sb, sx, mut sbb, mut sbx] = [sums.n, sums.b, sums.x, sums.bb, sums.bx].map(f64::from);
        sbb += n * GAIN_PRIOR;
        sbx += n * GAIN_PRIOR;
        let n_bias = n * (1.0 + BIAS_PRIOR);
        let determinant = sbb * n_bias - sb * sb;
        if determinant <= 0.0 {
            return None;
        }
        line =
            (((sbx * n_bias - sb * sx) / determinant) as f32, ((sbb * sx - sb * sbx) / determinant) as f32);
        if !GAIN_RANGE.contains(&line.0) {
            return None;
        }
    }
    Some(line)
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
    fn most_of_the_picture_covered_and_a_bad_start_still_find_it() {
        let background = background();
        // Three fifths are dark coats; the camera's gain rose by half, and the start has a lower one.
        let frame = RgbImage::from_fn(160, 120, |u, v| {
            if u < 96 {
                return Rgb([30 + (u % 23) as u8, 28 + (v % 17) as u8, 35]);
            }
            Rgb(background.get_pixel(u, v).0.map(|b| (1.4 * b as f32).min(255.0) as u8))
        });
        let start = Exposure { gain: [0.5; 3], bias: [50.0; 3] };
        let found = Exposure::fit(&background, &frame, &start);
        for c in 0..3 {
            for level in [50.0, 80.0, 110.0] {
                let f = found.apply(c, level);
                assert!((f - 1.4 * level).abs() < 4.0, "channel {c} level {level}: {f}");
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
        // With one level only, gain and bias are ambiguous, but together they must explain it.
        let flat = |level| RgbImage::from_pixel(64, 48, Rgb([level; 3]));
        let found = Exposure::fit(&flat(100), &flat(110), &Exposure::default());
        assert!((found.apply(0, 100.0) - 110.0).abs() < 1.0, "{found:?}");
    }
}
