//! From the pinhole image, where everything is simulated, to the panel of the film, which shows the real one.

use image::{Rgb, RgbImage};
use nalgebra::Point2;

use crate::stage::StageCamera;

/// A panel's geometry.
#[derive(Debug, Clone)]
pub(super) struct Lens {
    /// Panel pixels per real pixel, along each side.
    pub(super) scale: u32,
    /// Panel size.
    pub(super) width: u32,
    /// Panel size.
    pub(super) height: u32,
    /// For each panel pixel the index of the pinhole pixel it shows. Empty when they are the same.
    pinhole_index: Vec<Option<u32>>,
}

impl Lens {
    pub(super) fn new(camera: &StageCamera, scale: u32) -> Self {
        let (real_width, real_height) = (camera.width(), camera.height());
        // Encoders want even sides; an odd one is cut by a pixel.
        let even = |side: u32| (side * scale / 2 * 2).max(2);
        let (width, height) = (even(real_width), even(real_height));
        let is_same = camera.undistort.is_identity() && (width, height) == (real_width, real_height);
        let index = |x: u32, y: u32| {
            let real =
                Point2::new((x as f64 + 0.5) / scale as f64 - 0.5, (y as f64 + 0.5) / scale as f64 - 0.5);
            let pinhole = if camera.undistort.is_identity() {
                real
            } else {
                camera.pinhole.intrinsics.project(&camera.real.intrinsics.unproject(&real)?.into())?
            };
            let (u, v) = (pinhole.x.round(), pinhole.y.round());
            let inside = u >= 0.0 && v >= 0.0 && u < real_width as f64 && v < real_height as f64;
            inside.then(|| v as u32 * real_width + u as u32)
        };
        let pinhole_index = if is_same {
            Vec::new()
        } else {
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| index(x, y)).collect()
        };
        Self { scale, width, height, pinhole_index }
    }

    /// A pixel of the real image → the panel.
    pub(super) fn panel(&self, real: Point2<f64>) -> Point2<f64> {
        let scale = f64::from(self.scale);
        Point2::new((real.x + 0.5) * scale - 0.5, (real.y + 0.5) * scale - 0.5)
    }

    /// A real picture, enlarged to the panel (bilinear).
    pub(super) fn enlarge(&self, real: &RgbImage) -> RgbImage {
        if (self.width, self.height) == real.dimensions() {
            return real.clone();
        }
        let (columns, rows) = (self.taps(self.width, real.width()), self.taps(self.height, real.height()));
        let (pixels, stride) = (real.as_raw(), 3 * real.width() as usize);
        let whole = 2 * self.scale;
        let mut panel = RgbImage::new(self.width, self.height);
        let mut row_mix = vec![0u32; stride];
        for (to, row) in panel.chunks_exact_mut(3 * self.width as usize).zip(&rows) {
            let (upper, lower) =
                (&pixels[row.first * stride..][..stride], &pixels[row.second * stride..][..stride]);
            for ((mix, a), b) in row_mix.iter_mut().zip(upper).zip(lower) {
                *mix = u32::from(*a) * (whole - row.weight) + u32::from(*b) * row.weight;
            }
            for (pixel, column) in to.chunks_exact_mut(3).zip(&columns) {
                let (a, b) = (&row_mix[3 * column.first..][..3], &row_mix[3 * column.second..][..3]);
                for ((to, a), b) in pixel.iter_mut().zip(a).zip(b) {
                    let sum = a * (whole - column.weight) + b * column.weight;
                    *to = ((sum + whole * whole / 2) / (whole * whole)) as u8;
                }
            }
        }
        panel
    }

    /// Which two of `length` pixels each of `count` enlarged ones lies between.
    fn taps(&self, count: u32, length: u32) -> Vec<Tap> {
        let last = length.saturating_sub(1);
        let tap = |i: u32| {
            // The position (i + ½) / scale − ½ in units of 1 / (2 scale), from the first pixel's centre on.
            let position = (2 * i + 1).saturating_sub(self.scale);
            let (first, weight) = (position / (2 * self.scale), position % (2 * self.scale));
            Tap { first: first.min(last) as usize, second: (first + 1).min(last) as usize, weight }
        };
        (0..count).map(tap).collect()
    }

    /// Goes through the pixels of a panel with what `pinhole` (row by row) holds for each.
    pub(super) fn for_each_pixel<T>(
        &self,
        panel: &mut RgbImage,
        pinhole: &[T],
        mut change: impl FnMut(&mut Rgb<u8>, &T),
    ) {
        if self.pinhole_index.is_empty() {
            panel.pixels_mut().zip(pinhole).for_each(|(pixel, value)| change(pixel, value));
            return;
        }
        for (pixel, index) in panel.pixels_mut().zip(&self.pinhole_index) {
            if let Some(value) = index.and_then(|i| pinhole.get(i as usize)) {
                change(pixel, value);
            }
        }
    }

    /// A picture of the panel from the pinhole's pixels.
    pub(super) fn picture(&self, pinhole: &[[u8; 3]], blank: [u8; 3]) -> RgbImage {
        let mut panel = RgbImage::from_pixel(self.width, self.height, Rgb(blank));
        self.for_each_pixel(&mut panel, pinhole, |pixel, value| *pixel = Rgb(*value));
        panel
    }
}

/// Two neighbours and the weight of the second, in units of 1 / (2 scale).
#[derive(Debug, Clone, Copy)]
struct Tap {
    first: usize,
    second: usize,
    weight: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::{Camera, Intrinsics};
    use image::imageops::{FilterType, resize};

    #[test]
    fn enlarging_is_what_the_image_crate_does_slowly() {
        let small =
            RgbImage::from_fn(37, 22, |x, y| Rgb([(x * 6) as u8, (y * 11) as u8, (x * y % 256) as u8]));
        let camera = Camera {
            intrinsics: Intrinsics::from_horizontal_fov(37, 22, 60.0),
            camera_from_world: nalgebra::Isometry3::identity(),
        };
        for scale in 2..=4 {
            let lens = Lens::new(&StageCamera::new("a", &camera), scale);
            let large = lens.enlarge(&small);
            let expected = resize(&small, 37 * scale, 22 * scale, FilterType::Triangle);
            for (x, y, pixel) in large.enumerate_pixels() {
                for i in 0..3 {
                    let off = pixel[i].abs_diff(expected.get_pixel(x, y)[i]);
                    assert!(off <= 1, "pixel {x}, {y} at scale {scale} is off by {off}");
                }
            }
        }
    }
}
