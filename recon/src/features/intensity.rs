//! Brightness as `f32`, slightly smoothed: what patches are cut from and registered in.

use image::RgbImage;

/// Smoothing before patches are compared: enough that bilinear reading between pixels is unbiased, and that
/// gradients rise above the sensor's noise.
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
        let clamp = |i: isize, n: usize| i.clamp(0, n as isize - 1) as usize;
        let across = Self::from_fn(self.width, self.height, |x, y| {
            let row = &self.values[y * self.width..(y + 1) * self.width];
            kernel.iter().zip(-reach..).map(|(k, i)| k * row[clamp(x as isize + i, self.width)]).sum()
        });
        Self::from_fn(self.width, self.height, |x, y| {
            let at = |i: isize| across.values[clamp(y as isize + i, self.height) * self.width + x];
            kernel.iter().zip(-reach..).map(|(k, i)| k * at(i)).sum()
        })
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

    /// Whether a point may be read by [`Self::at`].
    pub(crate) fn holds(&self, x: f64, y: f64) -> bool {
        x >= 0.0 && y >= 0.0 && x < (self.width - 1) as f64 && y < (self.height - 1) as f64
    }

    /// Bilinear reading; the point must be one that [`Self::holds`].
    #[inline]
    pub(crate) fn at(&self, x: f64, y: f64) -> f32 {
        // By way of `i32`, which processors convert at once; every pixel's index fits.
        let (left, top) = (x as i32, y as i32);
        let (fx, fy) = ((x - f64::from(left)) as f32, (y - f64::from(top)) as f32);
        self.between(top as usize * self.width + left as usize, fx, fy)
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
