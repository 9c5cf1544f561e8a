//! The accumulator: votes over directions and distances, and its peaks.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{FloorOptions, Plane, SurfacePoint};

/// Evenly spread directions (a Fibonacci spiral).
fn directions(count: usize) -> Vec<Vector3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / count as f64;
            let (radius, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
            Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
        })
        .collect()
}

/// Strongest cells of the accumulator, none near a stronger one.
pub(super) fn peaks(points: &[SurfacePoint], size: f64, options: &FloorOptions) -> Vec<Plane> {
    let directions = directions(options.directions);
    let cell = options.distance_cell * size;
    let near = options.normal_spread_deg.to_radians().cos();
    // Each direction has its own cells, so directions go in parallel.
    let mut cells: Vec<(f64, Plane)> = directions
        .par_iter()
        .flat_map_iter(|normal| {
            let facing = points.iter().filter(|p| p.normal.dot(normal) > near);
            let voters: Vec<(f64, f64)> = facing.map(|p| (normal.dot(&p.position.coords), p.area)).collect();
            let low = voters.iter().map(|v| v.0).fold(f64::MAX, f64::min);
            let high = voters.iter().map(|v| v.0).fold(f64::MIN, f64::max);
            let count = if low <= high { ((high - low) / cell) as usize + 2 } else { 0 };
            let mut votes = vec![0.0; count];
            for (distance, area) in voters {
                // A vote is shared between the two nearest cells, so that a plane on a border loses nothing.
                let at = (distance - low) / cell;
                let (below, share) = (at as usize, at.fract());
                votes[below] += area * (1.0 - share);
                if below + 1 < count {
                    votes[below + 1] += area * share;
                }
            }
            votes
                .into_iter()
                .enumerate()
                .filter(|(_, v)| *v > 0.0)
                .map(move |(i, v)| (v, Plane { normal: *normal, distance: low + cell * i as f64 }))
                .collect::<Vec<_>>()
        })
        .collect();
    cells.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut peaks: Vec<Plane> = Vec::new();
    for (_, plane) in cells {
        if peaks.len() >= options.peaks {
            break;
        }
        let apart = |other: &Plane| {
            other.normal.dot(&plane.normal) < 12f64.to_radians().cos()
                || (other.distance - plane.distance).abs() > 4.0 * cell
        };
        if peaks.iter().all(apart) {
            peaks.push(plane);
        }
    }
    peaks
}
