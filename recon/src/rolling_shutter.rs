//! Rolling shutter: most sensors read row after row, so a turning camera films each row in a direction of its own.
//!
//! The rotation of a hand-held camera between its first row and its last shifts pixels far more than its translation
//! does, and that part can be corrected without depth (P.-E. Forssén and E. Ringaby, "Rectifying rolling shutter video
//! from hand-held devices", CVPR 2010). Each frame is brought to the instant of its middle row: during the frame, the
//! camera turns at the mean rate between the frames before and after. Frames are assumed to follow each other at equal
//! times.

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Rolling-shutter model of a capture: readout time and rotation rate of each frame.
#[derive(Debug, Clone, PartialEq)]
pub struct RollingShutter {
    /// Time from the first row to the last, as a share of the time between two frames; negative for readout from below.
    readout: f64,
    rows: f64,
    /// Rotation of the camera from one frame to the next: scaled axis, in the camera's frame.
    rates: Vec<Vector3<f64>>,
}

impl RollingShutter {
    /// Builds the model from the frames' poses; a frame without a pose, or without a neighbour, does not turn.
    pub fn new(readout: f64, camera_from_world: &[Option<Isometry3<f64>>], height_px: u32) -> Self {
        let turn = |from: usize, to: usize| {
            let (from, to) = (camera_from_world.get(from)?.as_ref()?, camera_from_world.get(to)?.as_ref()?);
            Some((to.rotation * from.rotation.inverse()).scaled_axis())
        };
        let rates = (0..camera_from_world.len())
            .map(|frame| {
                let before = frame.checked_sub(1).and_then(|before| turn(before, frame));
                match (before, turn(frame, frame + 1)) {
                    (Some(before), Some(after)) => 0.5 * (before + after),
                    (Some(one), None) | (None, Some(one)) => one,
                    (None, None) => Vector3::zeros(),
                }
            })
            .collect();
        Self { readout, rows: f64::from(height_px), rates }
    }

    /// Median over the frames of the largest shift of the first or last row by rotation, pixels.
    pub fn shift_px(&self, lens: &Intrinsics) -> f64 {
        let mut turns: Vec<f64> = self.rates.iter().map(Vector3::norm).collect();
        turns.sort_by(f64::total_cmp);
        turns.get(turns.len() / 2).map_or(0.0, |turn| 0.5 * self.readout.abs() * turn * lens.fx)
    }

    /// Filmed position of a pixel of the rectified frame.
    pub fn filmed(&self, lens: &Intrinsics, frame: usize, pixel: &Point2<f64>) -> Option<Point2<f64>> {
        /// Rounds of the fixed-point iteration: the row decides the shift, and the small shift changes the row little.
        const ROUNDS: usize = 3;
        let ray = lens.unproject(pixel)?;
        let mut filmed = *pixel;
        for _ in 0..ROUNDS {
            filmed = lens.project(&Point3::from(self.turned(frame, filmed.y) * ray))?;
        }
        Some(filmed)
    }

    /// Rectified position of a filmed pixel.
    pub fn rectified(&self, lens: &Intrinsics, frame: usize, pixel: &Point2<f64>) -> Option<Point2<f64>> {
        let ray = lens.unproject(pixel)?;
        lens.project(&Point3::from(self.turned(frame, pixel.y).inverse() * ray))
    }

    /// Rectifies a frame, interpolating bilinearly.
    pub fn frame(&self, lens: &Intrinsics, frame: usize, picture: &RgbImage) -> RgbImage {
        let (width, height) = picture.dimensions();
        let largest = [width, height].map(|side| f64::from(side) - 1.0);
        let field = self.field(lens, frame, (width, height));
        let mut rectified = RgbImage::new(width, height);
        rectified.par_chunks_exact_mut(3 * width as usize).enumerate().for_each(|(y, row)| {
            let along = field.row(y);
            for (x, into) in row.chunks_exact_mut(3).enumerate() {
                let from = between(&along, x);
                into.copy_from_slice(&color(
                    picture,
                    from.x.clamp(0.0, largest[0]),
                    from.y.clamp(0.0, largest[1]),
                ));
            }
        });
        rectified
    }

    /// Filmed positions of a grid of rectified pixels.
    fn field(&self, lens: &Intrinsics, frame: usize, (width, height): (u32, u32)) -> FilmedGrid {
        let columns = (width as usize).div_ceil(CELL_PX) + 1;
        let rows = (height as usize).div_ceil(CELL_PX) + 1;
        let filmed = |index: usize| {
            let [x, y] = [index % columns, index / columns].map(|i| (i * CELL_PX) as f64);
            let pixel = Point2::new(x, y);
            self.filmed(lens, frame, &pixel).unwrap_or(pixel)
        };
        FilmedGrid { columns, filmed: (0..columns * rows).into_par_iter().map(filmed).collect() }
    }

    /// Rotation from the camera at the middle row to the camera at this one.
    fn turned(&self, frame: usize, row: f64) -> UnitQuaternion<f64> {
        let rate = self.rates.get(frame).copied().unwrap_or_default();
        UnitQuaternion::from_scaled_axis(rate * (self.readout * ((row + 0.5) / self.rows - 0.5)))
    }
}

/// Cell size of the grid of filmed positions, pixels: between its corners the positions are nearly linear.
const CELL_PX: usize = 4;

/// Filmed positions of the corners of a grid's cells.
struct FilmedGrid {
    columns: usize,
    /// Positions, row by row.
    filmed: Vec<Point2<f64>>,
}

impl FilmedGrid {
    /// Filmed position of every [`CELL_PX`]th pixel of a row.
    fn row(&self, y: usize) -> Vec<Point2<f64>> {
        let share = (y % CELL_PX) as f64 / CELL_PX as f64;
        let above = &self.filmed[y / CELL_PX * self.columns..][..2 * self.columns];
        let (above, below) = above.split_at(self.columns);
        above.iter().zip(below).map(|(a, b)| a + share * (b - a)).collect()
    }
}

/// Filmed position of a pixel of a row.
fn between(along: &[Point2<f64>], x: usize) -> Point2<f64> {
    let (left, right) = (along[x / CELL_PX], along[x / CELL_PX + 1]);
    left + (x % CELL_PX) as f64 / CELL_PX as f64 * (right - left)
}

/// Colour of a picture between pixels, bilinear; the place must lie in it.
fn color(picture: &RgbImage, x: f64, y: f64) -> [u8; 3] {
    let (left, top) = (x as u32, y as u32);
    let (right, below) = ((left + 1).min(picture.width() - 1), (top + 1).min(picture.height() - 1));
    let (fx, fy) = ((x - f64::from(left)) as f32, (y - f64::from(top)) as f32);
    let at = |x: u32, y: u32| picture.get_pixel(x, y).0.map(f32::from);
    let [a, b, c, d] = [at(left, top), at(right, top), at(left, below), at(right, below)];
    std::array::from_fn(|k| {
        let (upper, lower) = (a[k] + fx * (b[k] - a[k]), c[k] + fx * (d[k] - c[k]));
        (upper + fy * (lower - upper) + 0.5) as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use image::Rgb;

    /// A camera that turns by 3° a frame, to the right and about its axis.
    fn turning(readout: f64) -> (Intrinsics, RollingShutter) {
        let lens = Intrinsics::from_horizontal_fov(160, 120, 60.0);
        let poses: Vec<Option<Isometry3<f64>>> = (0..5)
            .map(|i| Some(Isometry3::rotation(Vector3::new(0.0, -0.05, 0.01) * f64::from(i))))
            .collect();
        (lens.clone(), RollingShutter::new(readout, &poses, lens.height))
    }

    #[test]
    fn the_middle_row_stays_and_the_last_moves_as_far_as_the_camera_turned_until_then() {
        let (lens, shutter) = turning(0.4);
        let at = |y: f64| Point2::new(lens.cx, y);
        let middle = shutter.rectified(&lens, 2, &at(59.5)).unwrap();
        assert_relative_eq!(middle, at(59.5), epsilon = 1e-9);
        // In closed form: the last row was read 0.2 of a frame's time after the middle.
        let last = at(119.5);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, -0.05, 0.01) * 0.2);
        let ray = turn.inverse() * lens.unproject(&last).unwrap();
        let wanted = lens.project(&ray.into()).unwrap();
        assert_relative_eq!(shutter.rectified(&lens, 2, &last).unwrap(), wanted, epsilon = 1e-9);
        assert!((wanted.x - last.x).abs() > 1.0, "{wanted}");
        // First and last frame turn at the rate of their only neighbour.
        for frame in [0, 4] {
            assert_relative_eq!(shutter.rectified(&lens, frame, &last).unwrap(), wanted, epsilon = 1e-9);
        }
    }

    #[test]
    fn filming_and_rectifying_undo_each_other() {
        let (lens, shutter) = turning(-0.7);
        for pixel in [(3.0, 2.0), (80.0, 119.0), (150.5, 33.3), (12.0, 100.0)] {
            let pixel = Point2::new(pixel.0, pixel.1);
            let filmed = shutter.filmed(&lens, 1, &pixel).unwrap();
            assert_relative_eq!(shutter.rectified(&lens, 1, &filmed).unwrap(), pixel, epsilon = 0.01);
        }
    }

    #[test]
    fn a_leaning_line_is_filmed_upright_again() {
        let (lens, shutter) = turning(0.4);
        // Column 80 of the rectified frame.
        let filmed = RgbImage::from_fn(160, 120, |x, y| {
            let at_once = shutter.rectified(&lens, 2, &Point2::new(f64::from(x), f64::from(y))).unwrap();
            Rgb([if at_once.x < 80.0 { 255 } else { 0 }; 3])
        });
        let edge = |picture: &RgbImage, y: u32| (0..160).find(|x| picture.get_pixel(*x, y)[0] < 128).unwrap();
        assert!(edge(&filmed, 2).abs_diff(edge(&filmed, 117)) >= 3);
        let upright = shutter.frame(&lens, 2, &filmed);
        assert!((2..118).all(|y| edge(&upright, y).abs_diff(80) <= 1));
    }

    #[test]
    fn a_grid_tells_where_all_pixels_were_filmed() {
        let (mut lens, shutter) = turning(0.6);
        lens.distortion = [-0.15, 0.03, 0.001, 0.0, 0.0].into();
        // Sizes that are multiples of the cell size, and others.
        for size in [(160, 120), (157, 113), (1, 1)] {
            let field = shutter.field(&lens, 2, size);
            for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
                let filmed = shutter.filmed(&lens, 2, &Point2::new(f64::from(x), f64::from(y))).unwrap();
                let off = (between(&field.row(y as usize), x as usize) - filmed).norm();
                assert!(off < 0.002, "{off} px at {x}, {y}");
            }
        }
    }

    #[test]
    fn colours_between_pixels_are_weighted_by_nearness() {
        let picture = RgbImage::from_fn(3, 2, |x, y| Rgb([(40 * x + 100 * y) as u8, 7, (20 * x) as u8]));
        assert_eq!(color(&picture, 0.25, 0.5), [60, 7, 5]);
        assert_eq!(color(&picture, 2.0, 1.0), [180, 7, 40]);
        assert_eq!(color(&picture, 1.9, 0.0), [76, 7, 38]);
    }

    #[test]
    fn frames_without_a_pose_do_not_turn() {
        let lens = Intrinsics::from_horizontal_fov(160, 120, 60.0);
        let shutter = RollingShutter::new(0.5, &[None, Some(Isometry3::identity()), None], lens.height);
        let pixel = Point2::new(7.0, 110.0);
        assert!(
            (0..4).all(|frame| shutter
                .rectified(&lens, frame, &pixel)
                .is_some_and(|p| (p - pixel).norm() < 1e-9))
        );
        assert!(shutter.shift_px(&lens).abs() < 1e-12);
        assert!(RollingShutter::new(0.5, &[], 120).shift_px(&lens).abs() < 1e-12);
    }
}
