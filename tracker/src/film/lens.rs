//! Mapping from the pinhole image, in which people are simulated, to the film's panel, which shows the real image.

use image::{Rgb, RgbImage};
use nalgebra::Point2;

use crate::prepared_room::PreparedCamera;

/// Geometry of a panel: that of the camera's image at the panel's size.
#[derive(Debug, Clone)]
pub(super) struct PanelLens {
    /// Panel width, pixels.
    pub(super) width: u32,
    /// Panel height, pixels.
    pub(super) height: u32,
    /// Width of the pinhole image, pixels.
    pub(super) pinhole_width: u32,
    /// Height of the pinhole image, pixels.
    pub(super) pinhole_height: u32,
    /// For each panel pixel the index of the pinhole pixel that it shows. Empty when they are the same.
    pinhole_index: Vec<Option<u32>>,
}

impl PanelLens {
    /// Panel of a camera whose working size is the panel's.
    pub(super) fn new(camera: &PreparedCamera) -> Self {
        let (width, height) = camera.real_size();
        let (pinhole_width, pinhole_height) = (camera.width(), camera.height());
        let index = |x: u32, y: u32| {
            let real = Point2::new(f64::from(x), f64::from(y));
            let ray = camera.real.intrinsics.unproject(&real)?;
            let pinhole = camera.pinhole.intrinsics.project(&ray.into())?;
            let (u, v) = (pinhole.x.round(), pinhole.y.round());
            let inside =
                u >= 0.0 && v >= 0.0 && u < f64::from(pinhole_width) && v < f64::from(pinhole_height);
            inside.then(|| v as u32 * pinhole_width + u as u32)
        };
        let pinhole_index = if camera.undistort.is_identity() {
            Vec::new()
        } else {
            (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| index(x, y)).collect()
        };
        Self { width, height, pinhole_width, pinhole_height, pinhole_index }
    }

    /// Calls `change` for each pixel of a panel with the value of `pinhole` (row by row) there.
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

    /// Converts a picture of pinhole pixels to the panel.
    pub(super) fn picture(&self, pinhole: &[[u8; 3]], blank: [u8; 3]) -> RgbImage {
        let mut panel = RgbImage::from_pixel(self.width, self.height, Rgb(blank));
        self.for_each_pixel(&mut panel, pinhole, |pixel, value| *pixel = Rgb(*value));
        panel
    }
}
