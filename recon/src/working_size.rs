//! Size at which pictures are worked on: larger ones are decoded at a smaller size, since time and memory grow with the pixels
//! while stereo gains little beyond [`LONGEST_PX`]. Features gain: they are registered once more in the filmed pictures.
//!
//! Projects, rooms and tables of picks have the pixels that were filmed; everything between has those that are worked on.

use calib::Intrinsics;
use nalgebra::{Point2, Vector2};

/// Longest side of a picture that is worked on as it was filmed, and of larger ones' working size, pixels.
pub const LONGEST_PX: u32 = 1600;

/// Sizes of a capture's pictures, filmed and worked on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WorkingSize {
    /// Width and height as filmed, pixels.
    pub filmed: (u32, u32),
    /// Width and height that are worked on, pixels.
    pub worked: (u32, u32),
}

impl WorkingSize {
    /// Sizes of pictures with this filmed width and height.
    pub fn of(filmed: (u32, u32)) -> Self {
        Self::up_to(filmed, LONGEST_PX)
    }

    /// Sizes of pictures with this filmed width and height, of which larger ones are worked on with this longest side.
    pub fn up_to(filmed: (u32, u32), longest_px: u32) -> Self {
        let longest = filmed.0.max(filmed.1);
        if longest <= longest_px {
            return Self { filmed, worked: filmed };
        }
        let ratio = f64::from(longest_px) / f64::from(longest);
        let side = |filmed: u32| ((ratio * f64::from(filmed)).round() as u32).max(1);
        Self { filmed, worked: (side(filmed.0), side(filmed.1)) }
    }

    /// Whether pictures are worked on as they were filmed.
    pub fn is_same(&self) -> bool {
        self.filmed == self.worked
    }

    /// Number of pixels of a picture that is worked on.
    pub fn worked_pixels(&self) -> u64 {
        u64::from(self.worked.0) * u64::from(self.worked.1)
    }

    /// Filmed pixels in the length of one that is worked on, along each axis.
    fn ratio(&self) -> Vector2<f64> {
        let ratio = |filmed: u32, worked: u32| f64::from(filmed) / f64::from(worked);
        Vector2::new(ratio(self.filmed.0, self.worked.0), ratio(self.filmed.1, self.worked.1))
    }

    /// Filmed pixels in the length of one that is worked on.
    pub fn enlargement(&self) -> f64 {
        self.ratio().x
    }

    /// Pixel of the working size at the place of a filmed one.
    pub fn worked_pixel(&self, filmed: &Point2<f64>) -> Point2<f64> {
        if self.is_same() {
            return *filmed;
        }
        // Pixel (0, 0) is the centre of the first one.
        Point2::from((filmed.coords.add_scalar(0.5)).component_div(&self.ratio()).add_scalar(-0.5))
    }

    /// Filmed pixel at the place of one of the working size.
    pub fn filmed_pixel(&self, worked: &Point2<f64>) -> Point2<f64> {
        if self.is_same() {
            return *worked;
        }
        Point2::from((worked.coords.add_scalar(0.5)).component_mul(&self.ratio()).add_scalar(-0.5))
    }

    /// Lens of the working size.
    pub fn worked_lens(&self, filmed: &Intrinsics) -> Intrinsics {
        if self.is_same() { filmed.clone() } else { filmed.resized(self.worked.0, self.worked.1) }
    }

    /// Lens of the filmed pictures.
    pub fn filmed_lens(&self, worked: &Intrinsics) -> Intrinsics {
        if self.is_same() { worked.clone() } else { worked.resized(self.filmed.0, self.filmed.1) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn large_pictures_are_worked_on_in_their_shape_and_small_ones_as_they_are() {
        let small = WorkingSize::of((1600, 900));
        assert!(small.is_same() && small.worked == (1600, 900));
        let portrait = WorkingSize::of((2160, 3840));
        assert_eq!((portrait.worked, portrait.is_same()), ((900, 1600), false));
        assert_eq!(WorkingSize::of((100_000, 1)).worked, (1600, 1));
    }

    #[test]
    fn a_point_has_the_same_place_at_both_sizes() {
        let size = WorkingSize::of((4000, 3001));
        let mut filmed = Intrinsics::from_horizontal_fov(4000, 3001, 70.0);
        filmed.distortion = [-0.2, 0.05, 0.001, 0.0, 0.0].into();
        let worked = size.worked_lens(&filmed);
        assert_eq!((worked.width, worked.height), (1600, 1200));
        for (x, y) in [(0.3, -0.2), (-0.5, 0.4), (0.0, 0.0)] {
            let point = Point3::new(x, y, 1.0);
            let (large, small) = (filmed.project(&point).unwrap(), worked.project(&point).unwrap());
            assert!((size.worked_pixel(&large) - small).norm() < 1e-9, "{large} {small}");
            assert!((size.filmed_pixel(&small) - large).norm() < 1e-9, "{large} {small}");
        }
        let back = size.filmed_lens(&worked);
        assert!((back.fx - filmed.fx).abs() < 1e-9 && (back.cy - filmed.cy).abs() < 1e-9);
    }
}
