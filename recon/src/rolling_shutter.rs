//! Rolling shutter: most sensors read row after row, so a turning camera films each row in a direction of its own.
//!
//! What a hand-held camera turns by between its first row and its last shifts pixels by far more than what it moves by, and that
//! part needs no depth to be undone (P.-E. Forssén and E. Ringaby, "Rectifying rolling shutter video from hand-held
//! devices", 2010). Each frame is brought to the instant of its middle row: over the frame, the camera turns as it does on the
//! mean between the frames before and after. Frames are taken to follow each other at equal times.

use calib::Intrinsics;
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point2, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// How the rows of each frame of a capture were read.
#[derive(Debug, Clone, PartialEq)]
pub struct RollingShutter {
    /// The time from the first row to the last, as a share of the time between two frames; negative from below.
    readout: f64,
    rows: f64,
    /// By how much the camera turns from a frame to the next: scaled axis, in the camera's frame.
    rates: Vec<Vector3<f64>>,
}

impl RollingShutter {
    /// From the frames' poses; a frame without a pose, or alone, does not turn.
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

    /// The farthest that turning shifts the first or last row of half of the frames, pixels.
    pub fn shift_px(&self, lens: &Intrinsics) -> f64 {
        let mut turns: Vec<f64> = self.rates.iter().map(Vector3::norm).collect();
        turns.sort_by(f64::total_cmp);
        turns.get(turns.len() / 2).map_or(0.0, |turn| 0.5 * self.readout.abs() * turn * lens.fx)
    }

    /// Where a pixel was filmed that the frame would show there, had it been filmed at once.
    pub fn filmed(&self, lens: &Intrinsics, frame: usize, pixel: &Point2<f64>) -> Option<Point2<f64>> {
        /// The row decides by how much the pixel moves, and its moving little by how much the row changes.
        const ROUNDS: usize = 3;
        let ray = lens.unproject(pixel)?;
        let mut filmed = *pixel;
        for _ in 0..ROUNDS {
            filmed = lens.project(&Point3::from(self.turned(frame, filmed.y) * ray))?;
        }
        Some(filmed)
    }

    /// Where a filmed pixel would be, had the frame been filmed at once.
    pub fn rectified(&self, lens: &Intrinsics, frame: usize, pixel: &Point2<f64>) -> Option<Point2<f64>> {
        let ray = lens.unproject(pixel)?;
        lens.project(&Point3::from(self.turned(frame, pixel.y).inverse() * ray))
    }

    /// The frame as if filmed at once, interpolated bilinearly.
    pub fn frame(&self, lens: &Intrinsics, frame: usize, picture: &RgbImage) -> RgbImage {
        let (width, height) = picture.dimensions();
        let largest = Point2::new(f64::from(width) - 1.0, f64::from(height) - 1.0);
        let mut rectified = RgbImage::new(width, height);
        rectified.par_chunks_exact_mut(3 * width as usize).enumerate().for_each(|(y, row)| {
            for (x, into) in row.chunks_exact_mut(3).enumerate() {
                let pixel = Point2::new(x as f64, y as f64);
                let from = self.filmed(lens, frame, &pixel).unwrap_or(pixel);
                let (u, v) = (from.x.clamp(0.0, largest.x), from.y.clamp(0.0, largest.y));
                let seen = image::imageops::interpolate_bilinear(picture, u as f32, v as f32);
                into.copy_from_slice(&seen.unwrap_or(Rgb([0; 3])).0);
            }
        });
        rectified
    }

    /// From the camera at the middle row to the camera at this one.
    fn turned(&self, frame: usize, row: f64) -> UnitQuaternion<f64> {
        let rate = self.rates.get(frame).copied().unwrap_or_default();
        UnitQuaternion::from_scaled_axis(rate * (self.readout * ((row + 0.5) / self.rows - 0.5)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

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
        // First and last frame turn as their only neighbour says.
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
        // What is at column 80 when filmed at once.
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
