//! Estimated radius of the disc that each point of a cloud stands for, when the file states none.
//!
//! A surface sampled with density ρ has its k-th neighbour at about √(k / πρ). Discs of half the distance to the
//! sixth neighbour just close a square lattice (whose sixth neighbour is a diagonal one, √2 spacings away); a
//! little more closes random sampling, too.

use std::num::NonZero;

use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Rank of the neighbour from whose distance the spacing is estimated.
const NEIGHBOUR: usize = 6;
/// Radius as a fraction of that neighbour's distance.
const FRACTION: f32 = 0.6;
/// Largest radius as a multiple of the median, so that a lonely point does not become a wall.
const LARGEST_OVER_MEDIAN: f32 = 3.0;
/// Radius in metres where there are fewer points than neighbours.
const FALLBACK_RADIUS_M: f32 = 0.02;

/// Radius of each point, metres, from the distance to its neighbours. The points must be finite.
pub(super) fn radii(points: &[Vec3]) -> Vec<f32> {
    let entries: Vec<[f32; 3]> = points.iter().map(Vec3::to_array).collect();
    let (Some(wanted), true) = (NonZero::new(NEIGHBOUR + 1), points.len() > NEIGHBOUR) else {
        return vec![FALLBACK_RADIUS_M; points.len()];
    };
    let Ok(tree) = ImmutableKdTree::new_from_slice(&entries) else {
        return vec![FALLBACK_RADIUS_M; points.len()];
    };
    let mut radii: Vec<f32> = entries
        .iter()
        .map(|p| {
            let found = tree.query(p).nearest_n::<SquaredEuclidean<f32>>(wanted).execute();
            found.last().map_or(0.0, |farthest| FRACTION * farthest.distance.sqrt())
        })
        .collect();
    let mut sorted: Vec<f32> = radii.iter().copied().filter(|r| *r > 0.0).collect();
    sorted.sort_by(f32::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(FALLBACK_RADIUS_M);
    for radius in &mut radii {
        // Identical points have no spacing of their own.
        *radius = if *radius > 0.0 { radius.min(LARGEST_OVER_MEDIAN * median) } else { median };
    }
    radii
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn discs_on_a_lattice_leave_no_hole() {
        let spacing = 0.03;
        let lattice: Vec<Vec3> =
            (0..400).map(|i| Vec3::new((i % 20) as f32 * spacing, (i / 20) as f32 * spacing, 1.0)).collect();
        let radii = radii(&lattice);
        // The worst place is the middle between four points.
        let middle = lattice[10 * 20 + 10] + Vec3::new(0.5 * spacing, 0.5 * spacing, 0.0);
        assert!(lattice.iter().zip(&radii).any(|(p, r)| p.distance(middle) < *r));
        assert!(radii.iter().all(|r| *r < 2.0 * spacing));
    }

    #[test]
    fn lonely_points_and_piles_stay_small() {
        let mut points: Vec<Vec3> =
            (0..100).map(|i| Vec3::new((i % 10) as f32 * 0.01, (i / 10) as f32 * 0.01, 0.0)).collect();
        points.push(Vec3::new(50.0, 0.0, 0.0));
        points.extend([Vec3::new(1.0, 1.0, 1.0); 20]);
        let radii = radii(&points);
        assert!(radii.iter().all(|r| *r > 0.0 && *r < 0.05), "{radii:?}");
        assert_eq!(super::radii(&points[..2]), [FALLBACK_RADIUS_M; 2]);
        assert!(super::radii(&[]).is_empty());
    }
}
