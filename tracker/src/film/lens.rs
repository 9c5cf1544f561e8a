//! From the pinhole image, where everything is simulated, to the panel of the film, which shows the real one.

use image::{Rgb, RgbImage, imageops};
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

    /// A real picture, enlarged to the panel.
    pub(super) fn enlarge(&self, real: &RgbImage) -> RgbImage {
        if (self.width, self.height) == real.dimensions() {
            return real.clone();
        }
        if self.scale == 1 {
            return imageops::crop_imm(real, 0, 0, self.width, self.height).to_image();
        }
        imageops::resize(real, self.width, self.height, imageops::FilterType::Triangle)
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
