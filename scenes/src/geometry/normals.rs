//! Normals of a bare cloud, as laser scanners write them: the direction in which a point's neighbours spread least (H.
//! Hoppe et al., "Surface reconstruction from unorganized points", SIGGRAPH 1992), turned to the nearest camera.

use std::num::NonZero;

use glam::Vec3;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rayon::prelude::*;

use super::vector_from_vec3;

/// Number of neighbours that the surface is fitted to, the point itself included.
const NEIGHBOURS: NonZero<usize> = NonZero::new(13).unwrap();
/// Ratio of the second largest to the largest squared spread below which neighbours count as lying on a line.
const LEAST_WIDTH: f64 = 1e-4;

/// Unit normal of each point, towards the nearest of `viewpoints`; straight at it where the neighbours make no surface,
/// upwards without any viewpoint. The points must be finite.
pub(super) fn estimate(points: &[Vec3], viewpoints: &[Vec3]) -> Vec<Vec3> {
    let entries: Vec<[f32; 3]> = points.iter().map(Vec3::to_array).collect();
    let tree = ImmutableKdTree::new_from_slice(&entries).ok().filter(|_| points.len() >= NEIGHBOURS.get());
    entries
        .par_iter()
        .zip(points)
        .map(|(entry, point)| {
            let nearest = viewpoints
                .iter()
                .min_by(|a, b| a.distance_squared(*point).total_cmp(&b.distance_squared(*point)));
            let towards = nearest.map_or(Vec3::Z, |eye| (*eye - *point).normalize_or(Vec3::Z));
            let Some(tree) = &tree else { return towards };
            let near = tree.query(entry).nearest_n::<SquaredEuclidean<f32>>(NEIGHBOURS).execute();
            let around: Vec<Vec3> = near.iter().map(|n| points[n.item as usize]).collect();
            let normal = least_spread(*point, &around).unwrap_or(towards);
            if normal.dot(towards) < 0.0 { -normal } else { normal }
        })
        .collect()
}

/// Direction of the least spread of points; `origin` is subtracted first, so that coordinates far from zero lose no
/// digits.
fn least_spread(origin: Vec3, points: &[Vec3]) -> Option<Vec3> {
    let offset = |p: &Vec3| vector_from_vec3(*p - origin);
    let mean = points.iter().map(offset).sum::<Vector3<f64>>() / points.len() as f64;
    let spread: Matrix3<f64> = points.iter().map(|p| offset(p) - mean).map(|d| d * d.transpose()).sum();
    let eigen = SymmetricEigen::new(spread);
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let [least, middle, most] = order;
    if eigen.eigenvalues[middle] <= LEAST_WIDTH * eigen.eigenvalues[most] {
        return None;
    }
    let n = eigen.eigenvectors.column(least);
    Vec3::new(n.x as f32, n.y as f32, n.z as f32).try_normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Points all over a sphere around (3, 1, 2).
    fn sphere(noise_m: f32) -> (Vec3, Vec<Vec3>) {
        let middle = Vec3::new(3.0, 1.0, 2.0);
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let points = (0..4000)
            .map(|_| {
                let z = 2.0 * rng.random::<f32>() - 1.0;
                let (sin, cos) = (std::f32::consts::TAU * rng.random::<f32>()).sin_cos();
                let radius = 1.0 + noise_m * (rng.random::<f32>() - 0.5);
                middle + radius * Vec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
            })
            .collect();
        (middle, points)
    }

    #[test]
    fn a_sphere_seen_from_inside_faces_its_middle() {
        let (middle, points) = sphere(0.01);
        let normals = estimate(&points, &[middle, middle + 50.0 * Vec3::X]);
        for (point, normal) in points.iter().zip(&normals) {
            let off = normal.angle_between(middle - *point).to_degrees();
            assert!(off < 20.0, "{point}: {off}°");
        }
        let mean = points.iter().zip(&normals).map(|(p, n)| n.angle_between(middle - *p)).sum::<f32>();
        assert!((mean / points.len() as f32).to_degrees() < 5.0);
    }

    #[test]
    fn no_surface_faces_the_camera() {
        let line: Vec<Vec3> = (0..40).map(|i| Vec3::new(0.1 * i as f32, 0.0, 0.0)).collect();
        let eye = Vec3::new(2.0, 5.0, 0.0);
        for cloud in [&line[..], &line[..3], &[Vec3::ONE; 30]] {
            for (point, normal) in cloud.iter().zip(estimate(cloud, &[eye])) {
                assert!(normal.distance((eye - *point).normalize()) < 1e-5, "{point} {normal}");
            }
        }
        assert_eq!(estimate(&[eye], &[eye]), [Vec3::Z]);
        assert_eq!(estimate(&line[..1], &[]), [Vec3::Z]);
        assert!(estimate(&[], &[eye]).is_empty());
    }
}
