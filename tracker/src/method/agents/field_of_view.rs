//! Visible fraction of a person at each place of the floor for each station, from the room's cameras and geometry.

use nalgebra::{Point2, Point3};

use super::{FieldOfView, StationId};
use crate::prepared_room::{Floor, PreparedCamera, PreparedRoom};

/// Side of a cell of the floor, metres.
const CELL_M: f64 = 0.25;
/// Maximum number of cells; the cells of a larger floor are larger.
const MOST_CELLS: f64 = 20_000.0;
/// Heights at which visibility of an average adult is sampled, metres.
const HEIGHTS_M: [f64; 7] = [0.1, 0.4, 0.7, 1.0, 1.3, 1.5, 1.7];
/// Half of the width over which visibility is sampled, metres.
const HALF_WIDTH_M: f64 = 0.15;
/// Distance by which a visible point may lie behind a surface, metres: surfaces are uncertain.
const TOLERANCE_M: f64 = 0.1;
/// Fraction of a person that two stations must both see at one place for their fields of view to overlap.
const OVERLAP: f64 = 0.25;

/// Visible fraction of an average adult in each cell of the floor, for each camera of a room.
#[derive(Debug, Clone)]
pub struct StageView {
    low: Point2<f64>,
    cell_m: f64,
    columns: usize,
    /// One map per camera, row by row, in 255ths; 0 where no person can stand.
    visible: Vec<Vec<u8>>,
    /// Floor with the zones through which people leave; `None` in a room without zones.
    exits: Option<Floor>,
}

impl StageView {
    /// Samples the visibility of every cell of the floor from every camera.
    pub fn new(stage: &PreparedRoom) -> Self {
        let (low, high) = stage.floor.bounds();
        let size = high - low;
        let cell_m = (size.x * size.y / MOST_CELLS).sqrt().max(CELL_M);
        let columns = (size.x / cell_m).ceil().max(1.0) as usize;
        let rows = (size.y / cell_m).ceil().max(1.0) as usize;
        let center = |i: usize| {
            let (column, row) = ((i % columns) as f64 + 0.5, (i / columns) as f64 + 0.5);
            Point2::new(low.x + column * cell_m, low.y + row * cell_m)
        };
        let map = |camera: &PreparedCamera| -> Vec<u8> {
            let cell = |i: usize| {
                let place = center(i);
                let stands = stage.floor.is_standable(place.x, place.y);
                if stands { (255.0 * visible_part(camera, place)).round() as u8 } else { 0 }
            };
            (0..columns * rows).map(cell).collect()
        };
        let exits = (!stage.zones.is_empty()).then(|| stage.floor.clone());
        Self { low, cell_m, columns, visible: stage.cameras.iter().map(map).collect(), exits }
    }

    fn cell(&self, place: Point2<f64>) -> Option<usize> {
        let offset = (place - self.low) / self.cell_m;
        if !(offset.x >= 0.0 && offset.y >= 0.0) || offset.x >= self.columns as f64 {
            return None;
        }
        Some(offset.y as usize * self.columns + offset.x as usize)
    }
}

impl FieldOfView for StageView {
    fn visible(&self, station: StationId, place: Point2<f64>, _height_m: f64) -> f64 {
        let map = self.visible.get(usize::from(station.0));
        let cell = self.cell(place).and_then(|cell| map?.get(cell));
        cell.map_or(0.0, |part| f64::from(*part) / 255.0)
    }

    fn may_leave(&self, place: Point2<f64>) -> bool {
        self.exits.as_ref().is_some_and(|floor| floor.may_disappear(place.x, place.y))
    }

    fn overlap(&self, a: StationId, b: StationId) -> bool {
        let map = |station: StationId| self.visible.get(usize::from(station.0));
        let (Some(a), Some(b)) = (map(a), map(b)) else { return false };
        let sees = |part: u8| f64::from(part) >= 255.0 * OVERLAP;
        a.iter().zip(b).any(|(a, b)| sees(*a) && sees(*b))
    }
}

/// Fraction, 0 to 1, of the sample points on an average adult that a camera sees.
fn visible_part(camera: &PreparedCamera, place: Point2<f64>) -> f64 {
    let center = camera.pinhole.center();
    let away = place - Point2::new(center.x, center.y);
    let side = away
        .try_normalize(1e-9)
        .map_or(nalgebra::Vector2::zeros(), |away| nalgebra::Vector2::new(-away.y, away.x) * HALF_WIDTH_M);
    let (width, height) = (camera.width(), camera.height());
    let is_seen = |point: Point3<f64>| {
        let depth_m = camera.pinhole.camera_from_world.transform_point(&point).z;
        let Some(pixel) = camera.pinhole.project(&point) else { return false };
        let (u, v) = (pixel.x.round(), pixel.y.round());
        if !(u >= 0.0 && v >= 0.0 && u < f64::from(width) && v < f64::from(height)) {
            return false;
        }
        let surface_m = camera.static_z_m[v as usize * width as usize + u as usize];
        depth_m <= f64::from(surface_m) + TOLERANCE_M
    };
    let points = HEIGHTS_M.iter().flat_map(|z| [-1.0, 0.0, 1.0].map(|part| (place + side * part, *z)));
    let seen = points.filter(|(at, z)| is_seen(Point3::new(at.x, at.y, *z))).count();
    seen as f64 / (3 * HEIGHTS_M.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::method::mcmc::test_room::empty_room;
    use crate::silhouette::{Body, Silhouette, View};

    /// A wall before the first camera hides what is behind it from that camera alone.
    #[test]
    fn visible_parts_are_those_of_the_silhouette() {
        let mut stage = empty_room();
        // Everything in the right half of the first image is hidden by something 1 m away.
        let width = stage.cameras[0].width() as usize;
        for (i, z_m) in stage.cameras[0].static_z_m.iter_mut().enumerate() {
            if i % width >= width / 2 {
                *z_m = 1.0;
            }
        }
        let fields = StageView::new(&stage);
        let (mut hidden, mut seen) = (0, 0);
        for (camera, station) in stage.cameras.iter().zip([StationId(0), StationId(1)]) {
            let view = View::new(camera);
            for (x, y) in (1..12).flat_map(|i| (1..10).map(move |j| (0.5 * f64::from(i), 0.5 * f64::from(j))))
            {
                let silhouette = Silhouette::new(&view, &Body { x_m: x, y_m: y, ..Body::ADULT }.ellipsoid());
                let part = fields.visible(station, Point2::new(x, y), 1.72);
                if silhouette.area_px > 0 && silhouette.visible_px == 0 {
                    hidden += 1;
                    assert!(part < 0.35, "{part} of nobody at {x}, {y}");
                }
                // The image shows all of them when no edge of it is touched.
                let rows = silhouette.row_range();
                let is_whole = rows.start > 0 && rows.end < view.height as usize;
                if is_whole && silhouette.visible_px == silhouette.area_px && silhouette.area_px > 0 {
                    let columns = rows.map(|row| silhouette.row_width(row));
                    if columns.clone().all(|c| c.start > 0 && c.end < width) {
                        seen += 1;
                        assert!(part > 0.65, "{part} of somebody at {x}, {y}");
                    }
                }
            }
        }
        assert!(hidden > 10 && seen > 30, "{hidden} hidden, {seen} seen");
        let outside = Point2::new(-3.0, 40.0);
        assert!(fields.visible(StationId(0), outside, 1.72) == 0.0);
        assert!(fields.visible(StationId(9), Point2::new(3.0, 2.0), 1.72) == 0.0);
    }

    #[test]
    fn cameras_of_one_room_overlap_and_those_behind_walls_do_not() {
        let mut stage = empty_room();
        let ids = [StationId(0), StationId(1)];
        assert!(StageView::new(&stage).overlap(ids[0], ids[1]));
        stage.cameras[1].static_z_m.fill(0.5);
        let fields = StageView::new(&stage);
        assert!(!fields.overlap(ids[0], ids[1]) && !fields.overlap(ids[0], StationId(7)));
    }
}
