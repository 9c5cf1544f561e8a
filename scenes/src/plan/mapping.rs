//! Mapping between metres on the floor and pixels of a plan.

use nalgebra::{Point2, Vector2};

/// Mapping of the floor to the pixels of a plan. North (+Y) is up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mapping {
    /// Corner of the shown floor with the smallest coordinates, metres.
    pub low: Point2<f64>,
    /// Corner of the shown floor with the largest coordinates, metres.
    pub high: Point2<f64>,
    /// Scale.
    pub px_per_m: f64,
    /// Pixel of the top left corner of the shown floor, (`low.x`, `high.y`).
    pub corner_px: Vector2<f64>,
}

impl Mapping {
    /// Pixel of a place on the floor.
    pub fn pixel(&self, floor: &Point2<f64>) -> Point2<f64> {
        let offset = Vector2::new(floor.x - self.low.x, self.high.y - floor.y);
        Point2::from(self.corner_px + offset * self.px_per_m)
    }

    /// Place on the floor that a pixel shows.
    pub fn floor(&self, pixel: &Point2<f64>) -> Point2<f64> {
        let offset = (pixel.coords - self.corner_px) / self.px_per_m;
        Point2::new(self.low.x + offset.x, self.high.y - offset.y)
    }

    /// Left, top, right, bottom of the shown floor in pixels.
    pub fn frame(&self) -> [f64; 4] {
        let (a, b) = (self.pixel(&self.low), self.pixel(&self.high));
        [a.x, b.y, b.x, a.y]
    }
}
