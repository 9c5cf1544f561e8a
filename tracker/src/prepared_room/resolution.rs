//! Resolution at which a camera's masks are compared, chosen by the size of people in its image.

use nalgebra::{Point2, Point3, center};

use super::{Floor, PreparedCamera};
use crate::silhouette::Body;

/// Number of block rows over the height of a small person.
const ROWS: f64 = 16.0;
/// Sampled places along each side of the floor.
const LOOKS: usize = 20;

/// Side, in pixels, of the blocks that are simulated as one: a typical person is about [`ROWS`] blocks tall, whatever
/// the camera's resolution. More rows would repeat the same evidence.
pub fn block(camera: &PreparedCamera, average: &Body, floor: &Floor) -> u8 {
    let (low, high) = floor.bounds();
    let at = |i: usize, from: f64, to: f64| from + (to - from) * (i as f64 + 0.5) / LOOKS as f64;
    let mut tall_px: Vec<f64> = (0..LOOKS * LOOKS)
        .map(|i| Point2::new(at(i % LOOKS, low.x, high.x), at(i / LOOKS, low.y, high.y)))
        .filter(|p| floor.is_standable(p.x, p.y))
        .filter_map(|p| {
            let pixel = |z: f64| camera.pinhole.project(&Point3::new(p.x, p.y, z));
            let (feet, head) = (pixel(0.0)?, pixel(average.height_m)?);
            let middle = center(&feet, &head);
            camera.pinhole.intrinsics.contains(&middle).then_some((feet - head).norm())
        })
        .collect();
    tall_px.sort_by(f64::total_cmp);
    let typical = tall_px.get(tall_px.len() / 4).copied().unwrap_or(0.0);
    // The cast saturates; no camera sees people that large.
    ((typical / ROWS) as u8).max(1)
}
