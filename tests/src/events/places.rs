//! Regions and lines at random places of a room.

use nalgebra::{Point2, Rotation2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use scenes::polygon::Polygon;
use scenes::room::{Line, Region, Room};

/// Number of regions and of lines.
const REGIONS: usize = 3;
const LINES: usize = 3;

/// The room with three regions and three lines, of which one has a bend, around places where people walk.
///
/// Regions are rectangles and L shapes of 1.2 to 3 m, lines are 1.5 to 4 m long, all at any angle.
pub fn marked(room: &Room, walked: &[Point2<f64>], seed: u64) -> Room {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut room = room.clone();
    let somewhere = |rng: &mut Pcg64Mcg| walked[rng.random_range(0..walked.len())];
    for i in 0..REGIONS {
        let (center, angle) = (somewhere(&mut rng), rng.random_range(0.0..std::f64::consts::TAU));
        let half = Vector2::new(rng.random_range(0.6..1.5), rng.random_range(0.6..1.5));
        let corners: &[(f64, f64)] = if i == 1 {
            &[(-1.0, -1.0), (1.0, -1.0), (1.0, 0.0), (0.0, 0.0), (0.0, 1.0), (-1.0, 1.0)]
        } else {
            &[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        };
        let turn = Rotation2::new(angle);
        let corner = |(x, y): &(f64, f64)| center + turn * Vector2::new(x * half.x, y * half.y);
        let polygon = Polygon(corners.iter().map(corner).collect());
        room.regions.push(Region { name: format!("region {}", i + 1), polygon, dwell_s: Some(5.0) });
    }
    for i in 0..LINES {
        let (center, angle) = (somewhere(&mut rng), rng.random_range(0.0..std::f64::consts::TAU));
        let along = Rotation2::new(angle) * Vector2::new(rng.random_range(0.75..2.0), 0.0);
        let mut points = vec![center - along, center + along];
        if i == 1 {
            points.push(center + along + Rotation2::new(angle + 0.8) * Vector2::new(0.8, 0.0));
        }
        room.lines.push(Line { name: format!("line {}", i + 1), points });
    }
    room
}
