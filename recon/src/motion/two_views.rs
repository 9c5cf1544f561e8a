//! Relative motion of two views: essential matrix by RANSAC, and the choice among its four motions.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::seq::index::sample;
use rand_pcg::Pcg64Mcg;

use super::five_point::essential_matrices;

/// Number of samples of five pairs.
const DRAWS: usize = 400;

/// Relative motion of two views.
pub(crate) struct TwoViews {
    /// `second_from_first`, translation of length 1.
    pub(crate) motion: Isometry3<f64>,
    /// Indices of the pairs that agree with it, and lie before both cameras.
    pub(crate) agreeing: Vec<usize>,
}

/// Relative motion from pairs of rays (z = 1); `tolerance` is the epipolar distance on the z = 1 plane at which a pair
/// still agrees.
pub(crate) fn relative_motion(
    first: &[Vector3<f64>],
    second: &[Vector3<f64>],
    tolerance: f64,
    rng: &mut Pcg64Mcg,
) -> Option<TwoViews> {
    if first.len() < 8 || first.len() != second.len() {
        return None;
    }
    let mut best: Option<(f64, Matrix3<f64>)> = None;
    for _ in 0..DRAWS {
        let drawn = sample(rng, first.len(), 5);
        let a: [Vector3<f64>; 5] = std::array::from_fn(|k| first[drawn.index(k)]);
        let b: [Vector3<f64>; 5] = std::array::from_fn(|k| second[drawn.index(k)]);
        for essential in essential_matrices(&a, &b) {
            // Truncated squares: the errors of the agreeing pairs count as well as their number.
            let cost: f64 = first
                .iter()
                .zip(second)
                .map(|(a, b)| sampson_squared(&essential, a, b).min(tolerance * tolerance))
                .sum();
            if best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, essential));
            }
        }
    }
    let (_, essential) = best?;
    four_motions(&essential)?
        .into_iter()
        .map(|motion| {
            let agreeing: Vec<usize> = (0..first.len())
                .filter(|&i| {
                    sampson_squared(&essential, &first[i], &second[i]) < tolerance * tolerance
                        && meets_in_front(&motion, &first[i], &second[i])
                })
                .collect();
            TwoViews { motion, agreeing }
        })
        .max_by_key(|views| views.agreeing.len())
}

/// Squared first-order distance of a pair to the epipolar constraint (P. D. Sampson 1982).
fn sampson_squared(e: &Matrix3<f64>, a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    let (ea, eb) = (e * a, e.transpose() * b);
    let slope = ea.xy().norm_squared() + eb.xy().norm_squared();
    b.dot(&ea).powi(2) / slope.max(f64::MIN_POSITIVE)
}

/// The two rotations and two directions of an essential matrix (Hartley & Zisserman, *Multiple View Geometry*, 2nd ed.,
/// result 9.19).
fn four_motions(essential: &Matrix3<f64>) -> Option<[Isometry3<f64>; 4]> {
    let svd = essential.svd(true, true);
    let (mut u, mut v_t) = (svd.u?, svd.v_t?);
    if u.determinant() < 0.0 {
        u = -u;
    }
    if v_t.determinant() < 0.0 {
        v_t = -v_t;
    }
    let w = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0);
    let rotation =
        |m: Matrix3<f64>| UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(m));
    let turns = [rotation(u * w * v_t), rotation(u * w.transpose() * v_t)];
    let t: Vector3<f64> = u.column(2).into();
    let motion = |r: UnitQuaternion<f64>, t: Vector3<f64>| Isometry3::from_parts(Translation3::from(t), r);
    Some([motion(turns[0], t), motion(turns[0], -t), motion(turns[1], t), motion(turns[1], -t)])
}

/// Tells whether two rays meet before both cameras.
fn meets_in_front(motion: &Isometry3<f64>, a: &Vector3<f64>, b: &Vector3<f64>) -> bool {
    let turned = motion.rotation * a;
    // depth_b · b = depth_a · R a + t, in the least-squares sense.
    let (aa, ab, bb) = (turned.norm_squared(), turned.dot(b), b.norm_squared());
    let t = motion.translation.vector;
    let determinant = aa * bb - ab * ab;
    let depth_a = (ab * b.dot(&t) - bb * turned.dot(&t)) / determinant;
    let depth_b = (aa * b.dot(&t) - ab * turned.dot(&t)) / determinant;
    depth_a > 0.0 && depth_b > 0.0
}

/// Rotation that best explains pairs of rays without any translation, and the median distance on the z = 1 plane that
/// it leaves: the parallax.
pub(crate) fn parallax_beyond_rotation(first: &[Vector3<f64>], second: &[Vector3<f64>]) -> Option<f64> {
    let mut keep: Vec<usize> = (0..first.len()).collect();
    let mut left: Vec<f64> = Vec::new();
    for _ in 0..3 {
        if keep.len() < 4 {
            return None;
        }
        let cross: Matrix3<f64> =
            keep.iter().map(|&i| second[i].normalize() * first[i].normalize().transpose()).sum();
        let rotation = calib::rotation::nearest(&cross);
        left = (0..first.len())
            .map(|i| {
                let turned = rotation * first[i];
                if turned.z <= 1e-3 { f64::INFINITY } else { (turned / turned.z - second[i]).xy().norm() }
            })
            .collect();
        let limit = 2.5 * median(&left)?;
        keep = (0..first.len()).filter(|&i| left[i] <= limit).collect();
    }
    median(&left)
}

/// Middle value (the upper of two); `None` for an empty slice.
pub(crate) fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied()
}

/// Point of closest approach of two rays of a known motion, in the first camera's frame.
#[cfg(test)]
fn meeting(motion: &Isometry3<f64>, a: &Vector3<f64>, b: &Vector3<f64>) -> nalgebra::Point3<f64> {
    let turned = motion.rotation * a;
    let t = motion.translation.vector;
    let (aa, ab, bb) = (turned.norm_squared(), turned.dot(b), b.norm_squared());
    nalgebra::Point3::from(a * ((ab * b.dot(&t) - bb * turned.dot(&t)) / (aa * bb - ab * ab)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Uniform};
    use synthetic::tracks::TrackOptions;

    type Rays = Vec<Vector3<f64>>;

    /// Points, and their rays from both views; the first `wrong` pairs are off.
    fn pairs(motion: &Isometry3<f64>, wrong: usize) -> (Vec<Point3<f64>>, Rays, Rays) {
        let mut rng = Pcg64Mcg::seed_from_u64(11);
        let side = Uniform::new(-1.0, 1.0).unwrap();
        let points: Vec<Point3<f64>> = (0..150)
            .map(|_| {
                let z = 3.5 + 1.5 * side.sample(&mut rng);
                Point3::new(0.6 * z * side.sample(&mut rng), 0.45 * z * side.sample(&mut rng), z)
            })
            .collect();
        let a = points.iter().map(|p| p.coords / p.z).collect();
        let b = points.iter().enumerate().map(|(i, p)| {
            let q = motion * p;
            let off = if i < wrong {
                0.2 * Vector3::new(side.sample(&mut rng), side.sample(&mut rng), 0.0)
            } else {
                Vector3::zeros()
            };
            q.coords / q.z + off
        });
        let b = b.collect();
        (points, a, b)
    }

    #[test]
    fn motion_is_found_among_wrong_pairs() {
        let t = Vector3::new(0.6, -0.1, 0.2);
        let truth = Isometry3::new(t, Vector3::new(0.05, -0.1, 0.2));
        let (points, a, b) = pairs(&truth, 45);
        let found = relative_motion(&a, &b, 1e-3, &mut Pcg64Mcg::seed_from_u64(1)).unwrap();
        assert!(found.motion.rotation.angle_to(&truth.rotation) < 1e-5);
        assert!((found.motion.translation.vector - t.normalize()).norm() < 1e-4);
        assert!(found.agreeing.len() >= 105);
        let at = meeting(&found.motion, &a[100], &b[100]) * t.norm();
        assert!((at - points[100]).norm() < 1e-3);
    }

    #[test]
    fn pure_rotation_has_no_parallax() {
        let turn = Isometry3::rotation(Vector3::new(0.05, -0.2, 0.1));
        let (_, a, b) = pairs(&turn, 20);
        assert!(parallax_beyond_rotation(&a, &b).unwrap() < 1e-9);
        let (_, a, b) = pairs(&(Isometry3::translation(0.5, 0.0, 0.0) * turn), 20);
        assert!(parallax_beyond_rotation(&a, &b).unwrap() > 0.01);
        assert!(parallax_beyond_rotation(&[], &[]).is_none());
    }

    #[test]
    fn synthetic_cameras_are_found_from_noisy_tracks_with_outliers() {
        for seed in 0..20 {
            let options =
                TrackOptions { seed, cameras: 2, points: 200, outliers: 0.15, ..TrackOptions::default() };
            let tracks = options.build();
            let [first, second] = tracks.camera_from_world[..] else { unreachable!() };
            let (mut a, mut b) = (Vec::new(), Vec::new());
            for seen in &tracks.observations {
                let [p, q] = seen[..] else { continue };
                a.push(options.intrinsics.unproject(&p.pixel).unwrap());
                b.push(options.intrinsics.unproject(&q.pixel).unwrap());
            }
            let limit = 1.0 / options.intrinsics.fx;
            let found = relative_motion(&a, &b, limit, &mut Pcg64Mcg::seed_from_u64(seed)).unwrap();
            let truth = second * first.inverse();
            let turn_deg = found.motion.rotation.angle_to(&truth.rotation).to_degrees();
            let aside_deg = found.motion.translation.vector.angle(&truth.translation.vector).to_degrees();
            assert!(turn_deg < 0.5 && aside_deg < 3.0, "seed {seed}: {turn_deg}°, {aside_deg}°");
        }
    }
}
