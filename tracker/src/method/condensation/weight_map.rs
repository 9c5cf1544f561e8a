//! Weights over a horizontal plane (figures 4 to 8), for comparing the integrations at one moment.

use image::{Rgb, RgbImage};
use nalgebra::{Point2, Vector3};
use shell::canvas::{Canvas, Color, Stroke, TextStyle};

use super::integration::{CameraWeights, Integration};
use super::weight::WeighingInput;
use crate::prepared_room::PreparedRoom;

/// Side of a cell in the picture, pixels.
const CELL_PX: u32 = 4;
/// Largest number of cells along a side; a wide floor gets larger cells.
const MOST_CELLS: f64 = 240.0;
/// Least side of a cell, metres: half of a head's radius.
const LEAST_CELL_M: f64 = 0.04;

/// Weights on a grid over the floor's bounds, at one height.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightMap {
    /// Integration of the weights.
    pub integration: Integration,
    /// Corner of the grid with the smallest x and y, metres.
    pub low: Point2<f64>,
    /// Side of a cell, metres.
    pub cell_m: f64,
    /// Number of cells along x.
    pub columns: usize,
    /// Weights at the cells' centres, row by row with growing y. A product of few cameras' weights is larger than one
    /// of many, so of [`Integration::Product`] only the cells that the most cameras see are compared, and the others
    /// are 0; the paper's cameras see all of its hall.
    pub weights: Vec<f32>,
}

impl WeightMap {
    /// Map of one integration of a moment's edges, for heads' centres at `height_m` metres.
    pub fn new(
        room: &PreparedRoom,
        input: &WeighingInput<'_>,
        integration: Integration,
        height_m: f64,
    ) -> Self {
        let (low, high) = room.floor.bounds();
        let size = high - low;
        let cell_m = (size.x.max(size.y) / MOST_CELLS).max(LEAST_CELL_M);
        let [columns, rows] = [size.x, size.y].map(|s| (s / cell_m).ceil().max(1.0) as usize);
        let head_weights = input.head_weights.with(integration);
        let mut weights_by_camera = [CameraWeights::default()];
        let mut map = Self { integration, low, cell_m, columns, weights: Vec::with_capacity(columns * rows) };
        let mut lookers = Vec::with_capacity(columns * rows);
        for i in 0..columns * rows {
            let place = map.middle(i);
            let head = Vector3::new(place.x, place.y, height_m);
            head_weights.weigh_in_cameras(&[head], input.cameras, input.edges, &mut weights_by_camera);
            map.weights.push(head_weights.integrate(&weights_by_camera[0]));
            lookers.push(weights_by_camera[0].all().len());
        }
        if integration == Integration::Product {
            darken_less_looked_at(&mut map.weights, &lookers);
        }
        map
    }

    /// Centre of a cell on the floor plan, metres.
    pub fn middle(&self, cell: usize) -> Point2<f64> {
        let (column, row) = (cell % self.columns, cell / self.columns);
        self.low + nalgebra::Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * self.cell_m
    }

    /// Position of the largest weight, with the weight.
    pub fn peak(&self) -> Option<(Point2<f64>, f32)> {
        let (cell, weight) = self.weights.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        Some((self.middle(cell), *weight))
    }

    /// Picture of the map, y upwards: from 0 (dark) to its largest weight (bright), with cameras and zones.
    pub fn picture(&self, room: &PreparedRoom) -> RgbImage {
        let rows = self.weights.len() / self.columns;
        let largest = self.peak().map_or(0.0, |(_, w)| w).max(f32::MIN_POSITIVE);
        let (width, height) = (self.columns as u32 * CELL_PX, rows as u32 * CELL_PX);
        let ground = RgbImage::from_fn(width, height, |x, y| {
            let row = rows - 1 - (y / CELL_PX) as usize;
            heat(self.weights[row * self.columns + (x / CELL_PX) as usize] / largest)
        });
        let mut canvas = Canvas::from_image(&ground);
        let pixel = |p: &Point2<f64>| {
            let cells = (p - self.low) / self.cell_m * f64::from(CELL_PX);
            Point2::new(cells.x, f64::from(height) - cells.y)
        };
        for zone in &room.zones {
            let corners: Vec<Point2<f64>> = zone.polygon.0.iter().map(pixel).collect();
            canvas.stroke_polygon(&corners, &Stroke::dashed(Color::from(Rgb([200, 200, 200])), 1.5));
        }
        for camera in &room.cameras {
            let center = camera.pinhole.center();
            // Cameras outside are drawn on the border.
            let at = pixel(&Point2::new(center.x, center.y));
            let at = Point2::new(within_border(at.x, width), within_border(at.y, height));
            canvas.fill_circle(at, 5.0, Color::from(Rgb([90, 220, 255])));
            canvas.text(at, &camera.name, &TextStyle::new(13.0).on_plate(Color::INK.alpha(0.6)));
        }
        let title = match self.peak() {
            Some((p, weight)) => {
                format!("{}: largest {weight:.1e} at {:.2}, {:.2}", self.integration, p.x, p.y)
            }
            None => self.integration.to_string(),
        };
        canvas.text(Point2::new(8.0, 8.0), &title, &TextStyle::new(17.0).on_plate(Color::INK.alpha(0.7)));
        canvas.into_image()
    }
}

/// The place on a side of the picture, pixels, moved inside of its border: 8 pixels, less in a narrow picture.
fn within_border(at: f64, side_px: u32) -> f64 {
    let border = (0.5 * f64::from(side_px)).min(8.0);
    at.clamp(border, f64::from(side_px) - border)
}

/// Sets the weights of all cells to 0 that fewer than the most cameras see.
fn darken_less_looked_at(weights: &mut [f32], lookers: &[usize]) {
    let most = lookers.iter().copied().max().unwrap_or(0);
    for (weight, _) in weights.iter_mut().zip(lookers).filter(|(_, looking)| **looking < most) {
        *weight = 0.0;
    }
}

/// Colour from black through red and yellow to white.
fn heat(share: f32) -> Rgb<u8> {
    let part = |from: f32| ((share.clamp(0.0, 1.0) - from) * 3.0).clamp(0.0, 1.0);
    Rgb([part(0.0), part(1.0 / 3.0), part(2.0 / 3.0)].map(|v| (255.0 * v).round() as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_cameras_large_weight_is_no_match_for_a_product_of_three() {
        let mut weights = [0.9, 0.5, 0.125, 0.001, 0.0];
        darken_less_looked_at(&mut weights, &[1, 2, 3, 3, 0]);
        assert_eq!(weights.map(f32::to_bits), [0.0, 0.0, 0.125, 0.001, 0.0_f32].map(f32::to_bits));
        darken_less_looked_at(&mut [], &[]);
    }

    #[test]
    fn colours_grow_brighter_with_the_weight() {
        let sums: Vec<u32> =
            (0..=10).map(|i| heat(i as f32 / 10.0).0.iter().map(|c| u32::from(*c)).sum()).collect();
        assert!(sums.windows(2).all(|p| p[0] < p[1]), "{sums:?}");
        assert_eq!((heat(-1.0), heat(f32::NAN).0[1], heat(2.0)), (Rgb([0; 3]), 0, Rgb([255; 3])));
    }
}
