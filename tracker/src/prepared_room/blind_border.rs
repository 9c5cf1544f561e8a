//! Borders of a picture that the sensor does not fill: digitised analogue cameras have black columns at the left and right.
//!
//! Such a border shows nothing at all, so it says nothing about people: a person who would stand there is not missed. It is left
//! out of the simulation, like the pixels of the pinhole twin that lie outside the lens.

use image::{GrayImage, Luma, RgbImage};

use super::{PreparedCamera, PreparedRoom};
use crate::source::CameraSource;

/// Brightness up to which the outermost columns and rows are black, levels: the mean of the column or row.
const BLACK: f64 = 16.0;
/// Brightness from which on a column or row is filled, levels. Those between are half filled, and left out, too.
const FILLED: f64 = 48.0;
/// Widest border, as a share of the picture's width or height. What is wider is a dark thing in the room.
const WIDEST: f64 = 0.04;

/// Number of pixels on each side that show nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BlindBorder {
    /// Columns at the left.
    pub left: u32,
    /// Columns at the right.
    pub right: u32,
    /// Rows at the top.
    pub top: u32,
    /// Rows at the bottom.
    pub bottom: u32,
}

impl BlindBorder {
    /// Border of a camera, from one of its pictures; none where the picture is dark all over.
    pub fn of(picture: &RgbImage) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let (mut columns, mut rows) = (vec![0.0; width], vec![0.0; height]);
        for (x, y, pixel) in picture.enumerate_pixels() {
            let level = pixel.0.iter().map(|level| f64::from(*level)).sum::<f64>() / 3.0;
            columns[x as usize] += level / height as f64;
            rows[y as usize] += level / width as f64;
        }
        let side = |levels: &mut dyn Iterator<Item = f64>, length: usize| {
            let widest = (WIDEST * length as f64) as usize;
            let mut levels = levels.take(widest + 1).peekable();
            let is_black = levels.peek().is_some_and(|outermost| *outermost <= BLACK);
            levels.position(|level| level >= FILLED).filter(|_| is_black).unwrap_or(0) as u32
        };
        Self {
            left: side(&mut columns.iter().copied(), width),
            right: side(&mut columns.iter().rev().copied(), width),
            top: side(&mut rows.iter().copied(), height),
            bottom: side(&mut rows.iter().rev().copied(), height),
        }
    }
}

impl PreparedRoom {
    /// Leaves the blind borders of recordings out of the simulation. Streams show theirs too late.
    pub fn leave_out_borders(&mut self, sources: &[CameraSource]) {
        for source in sources {
            if let Some(camera) = self.cameras.iter_mut().find(|camera| camera.name == source.name)
                && let Some(picture) = source.first_picture()
            {
                camera.leave_out(&BlindBorder::of(&picture), picture.dimensions());
            }
        }
    }
}

impl PreparedCamera {
    /// Leaves a border, in pixels of pictures of this size, out of the simulation.
    fn leave_out(&mut self, border: &BlindBorder, (width, height): (u32, u32)) {
        if *border == BlindBorder::default() {
            return;
        }
        let k = &self.real.intrinsics;
        let scaled =
            |i: u32, size: u32, own: u32| (2 * u64::from(i) + 1) * u64::from(size) / (2 * u64::from(own));
        let is_filled = |i: u64, first: u32, last: u32, size: u32| {
            (u64::from(first)..u64::from(size.saturating_sub(last))).contains(&i)
        };
        let filled = GrayImage::from_fn(k.width, k.height, |x, y| {
            let (u, v) = (scaled(x, width, k.width), scaled(y, height, k.height));
            let is_shown = is_filled(u, border.left, border.right, width)
                && is_filled(v, border.top, border.bottom, height);
            Luma([if is_shown { 255 } else { 0 }])
        });
        let mut shown = GrayImage::new(self.width(), self.height());
        self.undistort.mask(&filled, &mut shown);
        for (z_m, shown) in self.static_z_m.iter_mut().zip(shown.iter()) {
            if *shown == 0 {
                *z_m = 0.0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::{Camera, Intrinsics};
    use image::Rgb;
    use nalgebra::{Isometry3, Point2, Point3};

    /// A mottled picture with black columns at both sides, of which the innermost is half filled.
    fn picture(left: u32, right: u32) -> RgbImage {
        RgbImage::from_fn(200, 100, |u, v| {
            let level = 90 + (u * 7 + v * 13) % 80;
            let lit = |share: u32| Rgb([(level * share / 4) as u8; 3]);
            if u < left || u >= 200 - right {
                Rgb([2; 3])
            } else if left > 0 && u == left {
                lit(1)
            } else {
                lit(4)
            }
        })
    }

    #[test]
    fn black_columns_beside_a_picture_are_its_blind_border() {
        assert_eq!(
            BlindBorder::of(&picture(4, 3)),
            BlindBorder { left: 5, right: 3, ..BlindBorder::default() }
        );
        assert_eq!(BlindBorder::of(&picture(0, 0)), BlindBorder::default());
        // A dark thing in the room; a dark room; no picture.
        assert_eq!(BlindBorder::of(&picture(30, 0)), BlindBorder::default());
        assert_eq!(BlindBorder::of(&RgbImage::new(200, 100)), BlindBorder::default());
        assert_eq!(BlindBorder::of(&RgbImage::new(0, 0)), BlindBorder::default());
    }

    #[test]
    fn nothing_is_simulated_in_a_blind_border() {
        let mut k = Intrinsics::from_horizontal_fov(200, 100, 70.0);
        for bend in [0.0, -0.2] {
            k.distortion = [bend, 0.0, 0.0, 0.0, 0.0].into();
            let filmed = Camera { intrinsics: k.clone(), camera_from_world: Isometry3::identity() };
            let whole = PreparedCamera::new("cam", &filmed);
            let mut camera = whole.clone();
            // The border of a picture of twice the size: 5 and 3 pixels of the camera's own.
            camera.leave_out(&BlindBorder { left: 10, right: 6, ..BlindBorder::default() }, (400, 200));
            let (mut outside, mut inside) = (0, 0);
            for (i, (z_m, before)) in camera.static_z_m.iter().zip(&whole.static_z_m).enumerate() {
                let (x, y) = (i as u32 % camera.width(), i as u32 / camera.width());
                let ray =
                    camera.pinhole.intrinsics.unproject(&Point2::new(f64::from(x), f64::from(y))).unwrap();
                let u =
                    camera.real.intrinsics.project(&Point3::from(ray)).map_or(f64::NAN, |filmed| filmed.x);
                // A pixel within one of the border's edge may be left out or not.
                if (0.0..3.5).contains(&u) || (197.5..199.0).contains(&u) {
                    assert!(*z_m <= 0.0, "{x}, {y}: filmed at {u}");
                    outside += 1;
                } else if (5.5..195.5).contains(&u) {
                    assert!(z_m.total_cmp(before).is_eq(), "{x}, {y}: filmed at {u}");
                    inside += 1;
                }
            }
            assert!(outside >= 500 && inside > 18_000, "{outside}, {inside}");
        }
    }
}
