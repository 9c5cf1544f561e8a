//! The pose from three points (P3P), of which up to four are possible: Grunert's solution as R. M. Haralick, C.-N. Lee,
//! K. Ottenberg & M. Nölle, "Review and analysis of solutions of the three point perspective pose estimation problem",
//! IJCV 13 (1994), write it (section 2.1): a quartic in the ratio of two distances from the camera.
//!
//! Own code, though OpenCV has several: the estimators build without OpenCV, and the refinement on all points removes
//! the advantage of a more careful solution of the quartic.

use nalgebra::{Isometry3, Matrix4, Point3, Schur, Vector2, Vector3};

use super::Pick;
use crate::absolute_orientation::rigid;

/// Imaginary part below which a root of the quartic counts as real: where two real roots meet, rounding and noise
/// split them into a conjugate pair.
const IMAGINARY_TOLERANCE: f64 = 0.05;
/// Limit of the QR iteration; a dozen or two steps suffice.
const MAX_QR_STEPS: usize = 200;
/// Relative error of the third side beyond which a solution belongs to the other root of its second distance.
const SIDE_TOLERANCE: f64 = 0.1;

/// Poses from every three of the picks.
pub(super) fn from_triples(picks: &[Pick], rays: &[Vector2<f64>]) -> Vec<Isometry3<f64>> {
    let mut poses = Vec::new();
    for i in 0..picks.len() {
        for j in i + 1..picks.len() {
            for k in j + 1..picks.len() {
                let triple = [i, j, k];
                let directions = triple.map(|n| rays[n].push(1.0).normalize());
                poses.extend(solve(triple.map(|n| picks[n].world), directions));
            }
        }
    }
    poses
}

/// Every `camera_from_world` that maps three world points into three unit directions.
pub(crate) fn solve(world: [Point3<f64>; 3], directions: [Vector3<f64>; 3]) -> Vec<Isometry3<f64>> {
    let squared = |i: usize, j: usize| (world[i] - world[j]).norm_squared();
    let (a2, b2, c2) = (squared(1, 2), squared(0, 2), squared(0, 1));
    let cosine = |i: usize, j: usize| directions[i].dot(&directions[j]);
    let (cos_a, cos_b, cos_c) = (cosine(1, 2), cosine(0, 2), cosine(0, 1));
    let (p, q) = ((a2 - c2) / b2, (a2 + c2) / b2);
    let (a, c) = (a2 / b2, c2 / b2);
    let quartic = [
        (1.0 + p).powi(2) - 4.0 * a * cos_c * cos_c,
        4.0 * (-p * (1.0 + p) * cos_b + 2.0 * a * cos_c * cos_c * cos_b - (1.0 - q) * cos_a * cos_c),
        2.0 * (p * p - 1.0 + 2.0 * p * p * cos_b * cos_b + 2.0 * (1.0 - c) * cos_a * cos_a
            - 4.0 * q * cos_a * cos_b * cos_c
            + 2.0 * (1.0 - a) * cos_c * cos_c),
        4.0 * (p * (1.0 - p) * cos_b - (1.0 - q) * cos_a * cos_c + 2.0 * c * cos_a * cos_a * cos_b),
        (p - 1.0).powi(2) - 4.0 * c * cos_a * cos_a,
    ];
    let mut poses = Vec::new();
    for ratio in real_roots(quartic).into_iter().filter(|v| *v > 0.0) {
        let first = (b2 / (1.0 + ratio * ratio - 2.0 * ratio * cos_b)).sqrt();
        let third = ratio * first;
        // The second distance comes from its side to the first point, not from Haralick's equation 8, which divides by
        // zero where the triangle is seen symmetrically.
        let discriminant = c2 - first * first * (1.0 - cos_c * cos_c);
        let half = discriminant.max(0.0).sqrt();
        for second in [first * cos_c + half, first * cos_c - half] {
            let side = second * second + third * third - 2.0 * second * third * cos_a;
            if second > 0.0 && (side - a2).abs() <= SIDE_TOLERANCE * a2 {
                let seen = [first, second, third];
                let camera: Vec<Point3<f64>> =
                    directions.iter().zip(seen).map(|(d, distance)| (d * distance).into()).collect();
                // Three points on a line determine no pose.
                poses.extend(rigid(&world, &camera).ok());
            }
        }
    }
    poses
}

/// Real roots of Σ `coefficients[k]` xᵏ, as eigenvalues of its companion matrix.
fn real_roots(coefficients: [f64; 5]) -> Vec<f64> {
    let monic = [0, 1, 2, 3].map(|k| -coefficients[k] / coefficients[4]);
    if !monic.iter().all(|c| c.is_finite()) {
        return Vec::new();
    }
    #[rustfmt::skip]
    let companion = Matrix4::new(
        0.0, 0.0, 0.0, monic[0],
        1.0, 0.0, 0.0, monic[1],
        0.0, 1.0, 0.0, monic[2],
        0.0, 0.0, 1.0, monic[3],
    );
    // The QR iteration does not converge for some matrices.
    let Some(schur) = Schur::try_new(companion, f64::EPSILON, MAX_QR_STEPS) else { return Vec::new() };
    let roots = schur.complex_eigenvalues();
    roots.iter().filter(|r| r.im.abs() <= IMAGINARY_TOLERANCE).map(|r| r.re).collect()
}
