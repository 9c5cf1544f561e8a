//! Brightness as `f32`, slightly smoothed, for cutting and registering patches.

use image::RgbImage;
use wide::{f32x4, i32x4};

/// Standard deviation of the smoothing before patches are compared: enough that bilinear interpolation is unbiased, and
/// that gradients rise above the sensor's noise.
const SMOOTHING_PX: f32 = 0.8;

/// A brightness image; values 0–255.
#[derive(Debug, Clone)]
pub(crate) struct Intensity {
    pub(crate) width: usize,
    pub(crate) height: usize,
    values: Vec<f32>,
}

impl Intensity {
    pub(crate) fn from_fn(width: usize, height: usize, value: impl Fn(usize, usize) -> f32) -> Self {
        let values = (0..width * height).map(|i| value(i % width, i / width)).collect();
        Self { width, height, values }
    }

    /// Luma (ITU-R BT.601, unrounded) of a colour image, smoothed.
    pub(crate) fn new(image: &RgbImage) -> Self {
        let values = image
            .pixels()
            .map(|p| 0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2]))
            .collect();
        Self { width: image.width() as usize, height: image.height() as usize, values }.smoothed(SMOOTHING_PX)
    }

    /// Convolved with a Gaussian; the border repeats.
    pub(crate) fn smoothed(&self, sigma_px: f32) -> Self {
        let reach = (3.0 * sigma_px).ceil() as isize;
        let mut kernel: Vec<f32> =
            (-reach..=reach).map(|i| (-0.5 * (i as f32 / sigma_px).powi(2)).exp()).collect();
        let total: f32 = kernel.iter().sum();
        for k in &mut kernel {
            *k /= total;
        }
        let (width, height, reach) = (self.width, self.height, reach as usize);
        let mut across = vec![0.0; width * height];
        let mut wider = vec![0.0; width + 2 * reach];
        for (row, into) in self.values.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
            wider[..reach].fill(row[0]);
            wider[reach..reach + width].copy_from_slice(row);
            wider[reach + width..].fill(row[width - 1]);
            for (k, from) in kernel.iter().zip(wider.windows(width)) {
                add_times(into, *k, from);
            }
        }
        let mut values = vec![0.0; width * height];
        for (y, into) in values.chunks_exact_mut(width).enumerate() {
            for (i, k) in kernel.iter().enumerate() {
                let from = (y + i).saturating_sub(reach).min(height - 1);
                add_times(into, *k, &across[from * width..][..width]);
            }
        }
        Self { width, height, values }
    }

    /// Half the size, each pixel the mean of four.
    pub(crate) fn halved(&self) -> Self {
        Self::from_fn((self.width / 2).max(1), (self.height / 2).max(1), |x, y| {
            let (right, below) = ((2 * x + 1).min(self.width - 1), (2 * y + 1).min(self.height - 1));
            let sum = self.pixel(2 * x, 2 * y)
                + self.pixel(right, 2 * y)
                + self.pixel(2 * x, below)
                + self.pixel(right, below);
            0.25 * sum
        })
    }

    pub(crate) fn pixel(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// Tells whether a point may be read by [`Self::at`].
    pub(crate) fn holds(&self, x: f64, y: f64) -> bool {
        x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64
    }

    /// Bilinear reading; the point must be one that [`Self::holds`].
    #[inline]
    pub(crate) fn at(&self, x: f64, y: f64) -> f32 {
        // The conversion goes through `i32`, which processors do at once; every pixel's index fits.
        let (left, top) = (x as i32, y as i32);
        let (fx, fy) = ((x - f64::from(left)) as f32, (y - f64::from(top)) as f32);
        self.between(top as usize * self.width + left as usize, fx, fy)
    }

    /// [`Self::at`] for four places. A place outside the image reads as some pixel in it, or 0.
    #[inline]
    pub(crate) fn at_four(&self, x: f32x4, y: f32x4) -> f32x4 {
        let (left, top) = (x.fast_trunc_int(), y.fast_trunc_int());
        let (fx, fy) = (x - left.round_float(), y - top.round_float());
        let index = (top * i32x4::splat(self.width as i32) + left).to_array();
        let row = |down: usize| {
            let pair = |lane: usize| {
                let index = index[lane] as u32 as usize + down;
                match self.values.get(index..index + 2) {
                    Some(&[a, b]) => [a, b],
                    _ => [0.0, 0.0],
                }
            };
            let [a, b, c, d] = [pair(0), pair(1), pair(2), pair(3)];
            let (left, right) = (f32x4::new([a[0], b[0], c[0], d[0]]), f32x4::new([a[1], b[1], c[1], d[1]]));
            left + fx * (right - left)
        };
        let (above, below) = (row(0), row(self.width));
        above + fy * (below - above)
    }

    /// Brightness of `count` pixels in row order from an index on; `None` beyond the image.
    #[inline]
    pub(crate) fn from(&self, index: usize, count: usize) -> Option<&[f32]> {
        self.values.get(index..index + count)
    }

    /// Bilinear reading right of and below the pixel with an index, by fractions of a pixel.
    #[inline]
    pub(crate) fn between(&self, index: usize, fx: f32, fy: f32) -> f32 {
        let upper = &self.values[index..index + 2];
        let lower = &self.values[index + self.width..index + self.width + 2];
        let above = upper[0] + fx * (upper[1] - upper[0]);
        let below = lower[0] + fx * (lower[1] - lower[0]);
        above + fy * (below - above)
    }
}

/// `into += factor · from`.
fn add_times(into: &mut [f32], factor: f32, from: &[f32]) {
    for (sum, value) in into.iter_mut().zip(from) {
        *sum += factor * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn uneven(width: usize, height: usize) -> Intensity {
        Intensity::from_fn(width, height, |x, y| ((x * x * 7 + y * 31 + x * y * 3) % 200) as f32)
    }

    #[test]
    fn smoothing_is_a_weighted_mean_with_the_border_repeated() {
        let image = uneven(23, 9);
        let smooth = image.smoothed(0.8);
        let clamped =
            |x: i32, y: i32| f64::from(image.pixel(x.clamp(0, 22) as usize, y.clamp(0, 8) as usize));
        for (x, y) in (0..9).flat_map(|y| (0..23).map(move |x| (x, y))) {
            let (mut sum, mut total) = (0.0, 0.0);
            for (dx, dy) in (-3..=3).flat_map(|dy: i32| (-3..=3).map(move |dx: i32| (dx, dy))) {
                let weight = (-0.5 * f64::from(dx * dx + dy * dy) / 0.64).exp();
                sum += weight * clamped(x + dx, y + dy);
                total += weight;
            }
            let found = f64::from(smooth.pixel(x as usize, y as usize));
            assert!((found - sum / total).abs() < 1e-3, "{found} at {x}, {y}, not {}", sum / total);
        }
    }

    #[test]
    fn four_places_read_as_each_does() {
        let image = uneven(30, 20);
        let places = [(0.0, 0.0), (3.25, 7.5), (28.9, 18.9), (11.0, 0.125), (0.5, 18.0), (17.75, 3.0)];
        for first in 0..places.len() {
            let four: [(f64, f64); 4] = std::array::from_fn(|lane| places[(first + lane) % places.len()]);
            let read = image.at_four(four.map(|p| p.0 as f32).into(), four.map(|p| p.1 as f32).into());
            for (value, (x, y)) in read.to_array().into_iter().zip(four) {
                assert!((value - image.at(x, y)).abs() < 1e-2, "{value} at {x}, {y}");
            }
        }
    }
}
