//! A calibration board, drawn into pictures of cameras whose pose is known.

use calib::Camera;
use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point2};

/// A board of 10 × 7 squares (9 × 6 inner corners) with a white rim.
#[derive(Debug, Clone, Copy)]
pub struct Board {
    /// Side of a square, metres.
    pub side_m: f64,
}

impl Board {
    /// Brightness at a place in squares: black where both coordinates are odd or both are even.
    fn shade(x: f64, y: f64) -> Option<f64> {
        if !(-1.0..11.0).contains(&x) || !(-1.0..8.0).contains(&y) {
            return None;
        }
        let inside = (0.0..10.0).contains(&x) && (0.0..7.0).contains(&y);
        let black = inside && (x.floor() + y.floor()) as i64 % 2 == 0;
        Some(if black { 25.0 } else { 225.0 })
    }

    /// Draws the board into a picture, four rays a pixel each way. The board lies in the plane z = 0 of its own frame, its
    /// first corner at the origin.
    pub fn draw(&self, picture: &mut RgbImage, camera: &Camera, world_from_board: &Isometry3<f64>) {
        const RAYS: u32 = 4;
        let to_board = world_from_board.inverse();
        let centre = to_board * camera.center();
        let seen = |u: f64, v: f64| {
            let ray = camera.intrinsics.unproject(&Point2::new(u, v))?;
            let ray = to_board * (camera.camera_from_world.rotation.inverse() * ray);
            let along = -centre.z / ray.z;
            let hit = centre + ray * along;
            (along > 0.0).then(|| Self::shade(hit.x / self.side_m, hit.y / self.side_m)).flatten()
        };
        for (u, v, pixel) in picture.enumerate_pixels_mut() {
            let mut sum = [0.0; 3];
            for k in 0..RAYS * RAYS {
                let within = |i: u32| (f64::from(i) + 0.5) / f64::from(RAYS) - 0.5;
                let drawn = seen(f64::from(u) + within(k % RAYS), f64::from(v) + within(k / RAYS));
                for (sum, behind) in sum.iter_mut().zip(pixel.0) {
                    *sum += drawn.unwrap_or_else(|| f64::from(behind));
                }
            }
            *pixel = Rgb(sum.map(|s| (s / f64::from(RAYS * RAYS)).round() as u8));
        }
    }
}
