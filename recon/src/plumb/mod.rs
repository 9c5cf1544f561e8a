//! The vertical, estimated from vertical lines in the pictures: door frames, corners of the room, sides of furniture.
//! It needs no depth, so it is accurate where surfaces are bent, plain or covered.
//!
//! The interpretation plane of a plumb line ([`edges`]) has its normal n perpendicular to the vertical. Few edges are
//! plumb, so the vertical is the direction with most support to within the deviation σ of an edge's own direction: the
//! mode of
//!
//! ```text
//! Σ exp(−r² / 2σ²),   r = n · (u + A t)
//! ```
//!
//! over tilts t, A being the two axes across an initial vertical u. The mode is tracked from a wide σ to the narrow one
//! (graduated non-convexity, A. Blake and A. Zisserman, "Visual Reconstruction", MIT Press 1987), each step being
//! weighted least squares. Its covariance follows from the scatter of different lines, not of their pixels, of which
//! many belong to one line: pixels are grouped by the direction that their planes face, and the covariance is that of
//! clustered scores (K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika
//! 73, 1986).

pub mod edges;

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};
use rayon::prelude::*;

/// Standard deviations σ through which the mode is tracked, degrees; the last is that of an edge's direction.
const SIGMAS_DEG: [f64; 5] = [4.0, 2.8, 2.0, 1.4, 1.0];
/// Step between the edges that are used for the approximate mode.
const ROUGHLY: usize = 4;
/// Largest number of rounds at the last deviation, with all edges.
const ROUNDS: usize = 20;
/// Change of the tilt at which the iteration has converged.
const SETTLED: f64 = 1e-6;
/// Least ratio of the support of the mode to that beside it: where more than half of the edges are not plumb, a weaker
/// mode may be chance.
const STANDS_OUT: f64 = 2.2;
/// Distance in σ beyond which edges have no weight, nor will have after the last few steps.
const OUT_OF_REACH: f64 = 8.0;
/// Number of sectors of the half circle of horizontal directions; edges in one sector count as one cluster.
const SECTORS: usize = 18;
/// Error common to all lines of a capture, by its motion and the building, degrees.
const TURNED_DEG: f64 = 0.3;
/// Number of independent clusters up to which their scatter cannot be estimated.
const UNKNOWNS: f64 = 2.0;

pub use scenes::floor::Plumb;

/// Vertical by the normals of interpretation planes, searched near the unit vector `near`. `None` where too few lines
/// are plumb.
pub fn agreed(normals: &[Vector3<f64>], near: &Vector3<f64>) -> Option<Plumb> {
    let across = tangents(near)?;
    let mut seen: Vec<(Vector2<f64>, f64)> =
        normals.iter().map(|n| (across.tr_mul(n), n.dot(near))).collect();
    let some: Vec<(Vector2<f64>, f64)> = seen.iter().step_by(ROUGHLY).copied().collect();
    let mut tilt = Vector2::zeros();
    for sigma_deg in SIGMAS_DEG {
        tilt = step(&some, &tilt, sigma_deg.to_radians())?;
    }
    let sigma = SIGMAS_DEG[SIGMAS_DEG.len() - 1].to_radians();
    // Edges that are far off now stay so.
    seen.retain(|(axes, height)| (height + axes.dot(&tilt)).abs() < OUT_OF_REACH * sigma);
    for _ in 0..ROUNDS {
        let next = step(&seen, &tilt, sigma)?;
        let settled = (next - tilt).norm() < SETTLED;
        tilt = next;
        if settled {
            break;
        }
    }
    let up = (near + across * tilt).normalize();
    let across = tangents(&up)?;
    let seen: Vec<(Vector2<f64>, f64)> = normals.iter().map(|n| (across.tr_mul(n), n.dot(&up))).collect();
    if weight(&seen, &Vector2::zeros(), sigma) < STANDS_OUT * weight_beside(&seen, sigma) {
        return None;
    }
    let covariance = covariance(&seen, sigma)? + Matrix2::identity() * TURNED_DEG.to_radians().powi(2);
    Some(Plumb { up, covariance: across * covariance * across.transpose() })
}

/// Comparison of a supposed vertical with the lines of a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineVote {
    /// Angle between the supposed vertical and that with which most lines are plumb, degrees.
    pub lean_deg: f64,
    /// Number of lines for the latter, as a multiple of those for the former.
    pub outvoted: f64,
}

/// Compares a supposed vertical with that of most lines, among the directions that point up in an upright picture: a
/// camera that looks down by up to 70° or up by up to 20°, turned about its axis by up to 30°. `None` where no direction
/// stands out.
///
/// `normals`: of the edges' interpretation planes, in the frame of the reference camera.
pub fn against(normals: &[Vector3<f64>], supposed: &Vector3<f64>) -> Option<LineVote> {
    const PITCHES_DEG: [f64; 7] = [-20.0, -5.0, 10.0, 25.0, 40.0, 55.0, 70.0];
    const ROLLS_DEG: [f64; 3] = [-20.0, 0.0, 20.0];
    const TURNED_AT_MOST: f64 = 0.5;
    let start = |pitch: f64, roll: f64| {
        let ((s, c), (sin, cos)) = (roll.to_radians().sin_cos(), pitch.to_radians().sin_cos());
        Vector3::new(s * cos, -c * cos, -sin)
    };
    let is_upright = |up: &Vector3<f64>| up.x.abs() < TURNED_AT_MOST && up.y < 0.0;
    let starts = PITCHES_DEG.iter().flat_map(|pitch| ROLLS_DEG.iter().map(move |roll| start(*pitch, *roll)));
    let starts: Vec<Vector3<f64>> = starts.collect();
    let from = |near: &Vector3<f64>| {
        let up = agreed(normals, near)?.up;
        is_upright(&up).then(|| (number(normals, &up), up))
    };
    let found: Vec<Option<(f64, Vector3<f64>)>> = starts.par_iter().map(from).collect();
    let (most, up) = found.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0))?;
    // Lines near the supposed vertical are its own.
    let own = agreed(normals, supposed).map_or(*supposed, |plumb| plumb.up);
    let own = if own.angle(supposed) < 3.0 * SIGMAS_DEG[0].to_radians() { own } else { *supposed };
    Some(LineVote {
        lean_deg: up.angle(supposed).to_degrees(),
        outvoted: most / number(normals, &own).max(1.0),
    })
}

/// Number of edges that are plumb with a vertical, softly counted.
fn number(normals: &[Vector3<f64>], up: &Vector3<f64>) -> f64 {
    let sigma = SIGMAS_DEG[SIGMAS_DEG.len() - 1].to_radians();
    normals.iter().map(|normal| (-0.5 * (normal.dot(up) / sigma).powi(2)).exp()).sum()
}

/// Two unit vectors across a unit vector.
pub(crate) fn tangents(up: &Vector3<f64>) -> Option<Matrix3x2<f64>> {
    scenes::floor::tangents(up)
}

/// Support of a tilt by the edges.
fn weight(seen: &[(Vector2<f64>, f64)], tilt: &Vector2<f64>, sigma: f64) -> f64 {
    seen.iter().map(|(axes, height)| (-0.5 * ((height + axes.dot(tilt)) / sigma).powi(2)).exp()).sum()
}

/// Mean support beside the mode, which is at zero tilt: by edges that are plumb by chance.
fn weight_beside(seen: &[(Vector2<f64>, f64)], sigma: f64) -> f64 {
    const DIRECTIONS: u32 = 16;
    const BESIDE: f64 = 4.0;
    let at = |k: u32| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(DIRECTIONS)).sin_cos();
        weight(seen, &(BESIDE * sigma * Vector2::new(cos, sin)), sigma)
    };
    (0..DIRECTIONS).map(at).sum::<f64>() / f64::from(DIRECTIONS)
}

/// Weighted least squares about a tilt.
fn step(seen: &[(Vector2<f64>, f64)], tilt: &Vector2<f64>, sigma: f64) -> Option<Vector2<f64>> {
    let (mut information, mut sum) = (Matrix2::zeros(), Vector2::zeros());
    for (axes, height) in seen {
        let off = (height + axes.dot(tilt)) / sigma;
        let weighted = axes * (-0.5 * off * off).exp();
        information += weighted * axes.transpose();
        sum -= weighted * *height;
    }
    let tilt = information.try_inverse()? * sum;
    // Beyond this, the initial vertical was wrong.
    (tilt.norm() < 1.0).then_some(tilt)
}

/// Covariance of the mode, which is at zero tilt. `None` where it is no maximum, or has too little support.
fn covariance(seen: &[(Vector2<f64>, f64)], sigma: f64) -> Option<Matrix2<f64>> {
    let mut curvature = Matrix2::zeros();
    let (mut scores, mut weights) = ([Vector2::zeros(); SECTORS], [0.0; SECTORS]);
    for (axes, height) in seen {
        let off = height / sigma;
        let weight = (-0.5 * off * off).exp();
        curvature += axes * axes.transpose() * (weight * (1.0 - off * off));
        let turn = axes.y.atan2(axes.x).rem_euclid(std::f64::consts::PI) / std::f64::consts::PI;
        let sector = ((turn * SECTORS as f64) as usize).min(SECTORS - 1);
        scores[sector] += axes * (weight * off * sigma);
        weights[sector] += weight;
    }
    let squares: f64 = weights.iter().map(|w| w * w).sum();
    let independent = weights.iter().sum::<f64>().powi(2) / squares;
    let scatter: Matrix2<f64> = scores.iter().map(|s| s * s.transpose()).sum();
    let eigenvalues = curvature.symmetric_eigenvalues();
    let is_told = eigenvalues.min() > 0.0 && independent > UNKNOWNS;
    let inverse = curvature.try_inverse().filter(|_| is_told)?;
    let covariance = inverse * scatter * inverse * (independent / (independent - UNKNOWNS));
    covariance.iter().all(|v| v.is_finite()).then_some(covariance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Rotation3, UnitQuaternion};
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    /// Normals of planes through `lines` plumb lines, each of many pixels, and through `others` edges of any direction;
    /// the vertical is tilted by `tilt_deg`. Directions are off by the deviation of an edge, and each line's by
    /// `leaning_deg`.
    fn normals(
        seed: u64,
        lines: usize,
        others: usize,
        tilt_deg: [f64; 2],
        leaning_deg: f64,
    ) -> Vec<Vector3<f64>> {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let turned = Rotation3::rotation_between(
            &Vector3::z(),
            &Vector3::new(tilt_deg[0].to_radians().tan(), tilt_deg[1].to_radians().tan(), 1.0),
        )
        .unwrap();
        let gauss = |rng: &mut Pcg64Mcg| -> f64 { StandardNormal.sample(rng) };
        let mut normals = Vec::new();
        for _ in 0..lines {
            let (facing, leans) = (rng.random_range(0.0..6.3_f64), leaning_deg * gauss(&mut rng));
            for _ in 0..60 {
                let off = (leans + 0.6 * gauss(&mut rng)).to_radians();
                normals.push(turned * Vector3::new(facing.cos(), facing.sin(), off).normalize());
            }
        }
        for _ in 0..others {
            let any = Vector3::new(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)).normalize();
            normals.extend([any; 3]);
        }
        normals
    }

    /// A camera that looks down by 30°, among upright lines: the floor's normal is the vertical, a façade's is not.
    #[test]
    fn lines_tell_the_floor_from_a_wall() {
        let up = Vector3::new(0.0, -30f64.to_radians().cos(), -30f64.to_radians().sin());
        let camera_from_world = Rotation3::rotation_between(&Vector3::z(), &up).unwrap();
        let normals: Vec<Vector3<f64>> =
            normals(3, 14, 200, [0.0, 0.0], 0.3).iter().map(|n| camera_from_world * n).collect();
        let floor = against(&normals, &up).unwrap();
        assert!(floor.lean_deg < 1.0 && floor.outvoted < 1.2, "{floor:?}");
        let wall = Vector3::new(0.0, 30f64.to_radians().sin(), -30f64.to_radians().cos());
        let wall = against(&normals, &wall).unwrap();
        assert!((wall.lean_deg - 90.0).abs() < 1.5 && wall.outvoted > 2.0, "{wall:?}");
        assert!(against(&[], &up).is_none());
    }

    fn tilt_deg(found: &Plumb) -> [f64; 2] {
        [found.up.x, found.up.y].map(|t| (t / found.up.z).atan().to_degrees())
    }

    #[test]
    fn up_is_found_among_many_edges_that_are_not_plumb_from_wherever_it_is_thought() {
        for (seed, true_deg) in [(1, [0.0, 0.0]), (2, [4.0, -3.0]), (3, [-3.0, 4.0]), (4, [3.0, -4.0])] {
            let normals = normals(seed, 40, 3000, true_deg, 0.0);
            let found = agreed(&normals, &Vector3::z()).unwrap();
            let [x, y] = tilt_deg(&found);
            assert!((x - true_deg[0]).abs() < 0.3 && (y - true_deg[1]).abs() < 0.3, "{true_deg:?}: {x} {y}");
        }
    }

    #[test]
    fn the_vertical_scatters_by_its_covariance() {
        // Each line leans on its own: many pixels on few lines are few observations.
        let (mut squares, mut believed, runs) = (0.0, 0.0, 200);
        for seed in 0..runs {
            let found = agreed(&normals(seed, 30, 0, [0.0, 0.0], 0.4), &Vector3::z()).unwrap();
            squares += found.up.xy().norm_squared();
            believed += found.covariance.trace() - 2.0 * TURNED_DEG.to_radians().powi(2);
        }
        let ratio = (squares / believed).sqrt();
        assert!((0.7..1.4).contains(&ratio), "{ratio}");
        let sigma_deg = (squares / (2 * runs) as f64).sqrt().to_degrees();
        assert!(sigma_deg > 0.08, "{sigma_deg}");
    }

    #[test]
    fn edges_that_run_any_way_say_nothing() {
        let said = (0..50).filter_map(|seed| agreed(&normals(seed, 0, 3000, [0.0, 0.0], 0.0), &Vector3::z()));
        assert_eq!(said.count(), 0);
    }

    #[test]
    fn without_lines_that_differ_nothing_is_said() {
        let up = Vector3::z();
        assert!(agreed(&[], &up).is_none());
        // A single line seen over and over, and two that face alike.
        let one = normals(1, 1, 0, [0.0, 0.0], 0.0);
        assert!(agreed(&one, &up).is_none());
        assert!(agreed(&[Vector3::x(); 50], &up).is_none());
        assert!(agreed(&[Vector3::repeat(f64::NAN); 50], &up).is_none());
    }

    #[test]
    fn lines_in_one_wall_say_nothing_of_a_tilt_along_their_planes() {
        // All lines face along x, to within 25°.
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        let normals: Vec<Vector3<f64>> = (0..4000)
            .map(|_| {
                let (facing, off) = (rng.random_range(-0.45..0.45_f64), rng.random_range(-0.01..0.01_f64));
                Vector3::new(facing.cos(), facing.sin(), off + 0.004 * (9.0 * facing).sin()).normalize()
            })
            .collect();
        let found = agreed(&normals, &Vector3::z()).unwrap();
        let own = |k: usize| found.covariance[(k, k)] - TURNED_DEG.to_radians().powi(2);
        assert!(own(1) > 6.0 * own(0) && own(0) > 0.0, "{}", found.covariance);
        assert_relative_eq!(found.covariance * found.up, Vector3::zeros(), epsilon = 1e-12);
        assert_relative_eq!(found.covariance, found.covariance.transpose(), epsilon = 1e-12);
    }

    #[test]
    fn the_vertical_turns_with_its_frame() {
        let normals = normals(1, 40, 500, [2.0, 1.0], 0.3);
        let turn = UnitQuaternion::from_euler_angles(0.4, -1.1, 2.0);
        let found = agreed(&normals, &Vector3::z()).unwrap().turned(&turn);
        let seen: Vec<Vector3<f64>> = normals.iter().map(|n| turn * n).collect();
        let there = agreed(&seen, &(turn * Vector3::z())).unwrap();
        assert_relative_eq!(found.up, there.up, epsilon = 1e-4);
        assert_relative_eq!(found.covariance, there.covariance, max_relative = 0.3, epsilon = 3e-6);
    }
}
