//! Registration of features in pictures of the filmed size, where these are larger than those in which the features were
//! followed. Only a window around each feature becomes brightness.

use image::RgbImage;
use image::imageops::crop_imm;
use nalgebra::{Matrix2, Point2, Vector2};

use super::intensity::Intensity;
use super::register::{Patch, Warp};

/// Least correlation with the first appearance: less than for following, since the feature is known already, and the sensor's
/// noise is not averaged by a smaller picture.
const MIN_CORRELATION: f64 = 0.6;
/// Distance beyond a patch at its start that its window has: for its way, and for the smoothing at the window's rim.
const MARGIN_PX: f64 = 8.0;

/// Window of a picture, and the place of its first pixel in the picture.
struct Window {
    intensity: Intensity,
    corner: Vector2<f64>,
}

impl Window {
    /// Window around a square patch seen through a warp; `None` where it lies outside the picture.
    fn around(picture: &RgbImage, warp: &Warp, radius: i32) -> Option<Self> {
        let reach = |row: usize| f64::from(radius + 1) * warp.affine.row(row).abs().sum() + MARGIN_PX;
        let side = |at: f64, reach: f64, length: u32| {
            let (first, last) =
                ((at - reach).floor().max(0.0), (at + reach).ceil().min(f64::from(length) - 1.0));
            (last > first).then_some((first as u32, (last - first) as u32 + 1))
        };
        let (left, width) = side(warp.center.x, reach(0), picture.width())?;
        let (top, height) = side(warp.center.y, reach(1), picture.height())?;
        let intensity = Intensity::new(&crop_imm(picture, left, top, width, height).to_image());
        Some(Self { intensity, corner: Vector2::new(f64::from(left), f64::from(top)) })
    }
}

/// Appearance of a feature in a picture of the filmed size.
#[derive(Debug, Clone)]
pub(crate) struct FilmedPatch {
    patch: Patch,
    radius: i32,
}

impl FilmedPatch {
    /// Cuts a patch of `2 radius + 1` pixels a side. `None` at the picture's border or without contrast.
    pub(crate) fn cut(picture: &RgbImage, center: &Point2<f64>, radius: i32) -> Option<Self> {
        let warp = Warp { center: *center, affine: Matrix2::identity() };
        let Window { intensity, corner } = Window::around(picture, &warp, radius)?;
        let patch = Patch::cut(&intensity, &Warp { center: center - corner, ..warp }, radius)?;
        Some(Self { patch, radius })
    }

    /// Place of the feature in another picture, at most `reach_px` from its start; `None` where it is not found there.
    pub(crate) fn place(&self, picture: &RgbImage, start: &Warp, reach_px: f64) -> Option<Point2<f64>> {
        let Window { intensity, corner } = Window::around(picture, start, self.radius)?;
        let from = Warp { center: start.center - corner, ..*start };
        let found = self.patch.register(&intensity, &from)?;
        let is_near = (found.warp.center - from.center).norm() <= reach_px;
        (is_near && found.correlation >= MIN_CORRELATION).then(|| found.warp.center + corner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// An irregular texture, moved.
    fn picture(dx: f64, dy: f64) -> RgbImage {
        RgbImage::from_fn(300, 200, |x, y| {
            let (x, y) = (f64::from(x) - dx, f64::from(y) - dy);
            let wave = 30.0 * (0.29 * x + 0.003 * y * y).sin() + 25.0 * (0.37 * y - 0.002 * x * x).cos();
            Rgb([(120.0 + wave + 20.0 * (0.011 * x * y).sin()).round() as u8; 3])
        })
    }

    #[test]
    fn a_feature_is_registered_in_a_window_as_in_the_whole_picture() {
        let (first, second) = (picture(0.0, 0.0), picture(7.3, -4.6));
        let home = Point2::new(150.2, 100.7);
        let patch = FilmedPatch::cut(&first, &home, 9).unwrap();
        let start = Warp { center: home + Vector2::new(6.0, -4.0), affine: Matrix2::identity() };
        let found = patch.place(&second, &start, 3.0).unwrap();
        assert!((found - home - Vector2::new(7.3, -4.6)).norm() < 0.03, "{found}");
        let whole = patch.patch.register(&Intensity::new(&second), &start).unwrap();
        assert!((found - whole.warp.center).norm() < 1e-3, "{found} {:?}", whole.warp);
        assert!(patch.place(&second, &start, 1.0).is_none());
    }

    #[test]
    fn windows_beyond_the_picture_are_none() {
        let picture = picture(0.0, 0.0);
        let inside = FilmedPatch::cut(&picture, &Point2::new(150.0, 100.0), 9).unwrap();
        for (x, y) in [(-500.0, 100.0), (150.0, 900.0), (4.0, 100.0), (150.0, 196.0)] {
            let center = Point2::new(x, y);
            assert!(FilmedPatch::cut(&picture, &center, 9).is_none());
            let start = Warp { center, affine: Matrix2::identity() };
            assert!(inside.place(&picture, &start, 3.0).is_none());
        }
    }
}
