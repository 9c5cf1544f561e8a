//! Perspective by iterated paraperspective factorization.
//!
//! S. Christy and R. Horaud, "Euclidean shape and motion from multiple perspective views by affine iterations" (PAMI
//! 1996). With `ε_fp = k_f · s_p / z_f`, a perspective measurement `w` satisfies exactly
//!
//! ```text
//! (w_fp − o_f)(1 + ε_fp) + o_f = M_f s_p + o_f        (M_f the paraperspective rows)
//! ```
//!
//! so corrected measurements factorize affinely. `ε` starts at zero and follows from each solution. The mirrored
//! solution is a fixed point of the first step only: each of the two is iterated on its own.

use nalgebra::{Isometry3, Vector2, Vector3};

use super::affine::{self, Measurements};
use super::metric::{self, AffineModel, MetricMotion};

const MAX_ITERATIONS: usize = 40;
/// Smallest share of a correction that is applied.
const MIN_STRIDE: f64 = 0.1;
/// Mean change of the corrections at which the iteration has converged.
const CHANGE_END: f64 = 1e-7;
/// Range of the corrections: a point at less than a fifth of its origin's depth is no start for anything.
const EPSILON_RANGE: (f64, f64) = (-0.8, 4.0);

/// Both perspective interpretations of the measurements (normalised image coordinates), the better first, each with its
/// root mean square residual.
pub(crate) fn factorize(measured: &Measurements) -> Vec<(MetricMotion, f64)> {
    let Some(start) = affine::factorize(measured) else { return Vec::new() };
    // The affine camera with the smaller residual starts the iteration: paraperspective, unless noise spoils its
    // constraints.
    let least = |readings: &[MetricMotion; 2]| {
        readings.iter().map(|r| residual(measured, r)).fold(f64::INFINITY, f64::min)
    };
    let Some(readings) = [AffineModel::Paraperspective, AffineModel::Orthographic]
        .into_iter()
        .filter_map(|model| metric::upgrade(&start, model))
        .min_by(|a, b| least(a).total_cmp(&least(b)))
    else {
        return Vec::new();
    };
    let mut settled: Vec<(MetricMotion, f64)> = readings
        .into_iter()
        .map(|reading| settle(measured, reading))
        .map(|metric| {
            let residual = residual(measured, &metric);
            (metric, residual)
        })
        .collect();
    settled.sort_by(|a, b| a.1.total_cmp(&b.1));
    settled
}

/// Iterates from one interpretation; keeps the best solution met. Where the residual grows, corrections are applied in
/// smaller steps: far from affine (wide lenses, near things) whole steps overshoot.
fn settle(measured: &Measurements, start: MetricMotion) -> MetricMotion {
    let (mut best, mut least) = (start.clone(), residual(measured, &start));
    let mut current = start;
    let mut epsilon = vec![vec![0.0; current.poses.len()]; measured.len()];
    let mut origins: Option<Vec<Vector2<f64>>> = None;
    let (mut stride, mut last) = (1.0_f64, f64::INFINITY);
    for _ in 0..MAX_ITERATIONS {
        let mut change = 0.0;
        for (row, point) in epsilon.iter_mut().zip(&current.points) {
            for (e, pose) in row.iter_mut().zip(&current.poses) {
                let wanted =
                    ((pose.rotation * point).z / pose.translation.z).clamp(EPSILON_RANGE.0, EPSILON_RANGE.1);
                change += (wanted - *e).abs();
                *e += stride * (wanted - *e);
            }
        }
        // The origin's image moves with the corrections, by the same steps.
        let seen_at = current.poses.iter().map(|pose| pose.translation.vector.xy() / pose.translation.z);
        let moved: Vec<Vector2<f64>> = match origins {
            Some(old) => old.iter().zip(seen_at).map(|(o, n)| o + stride * (n - o)).collect(),
            None => seen_at.collect(),
        };
        let corrected = corrected(measured, &epsilon, &moved);
        origins = Some(moved);
        if change < CHANGE_END * (epsilon.len() * current.poses.len()) as f64 {
            break;
        }
        let next =
            affine::factorize(&corrected).and_then(|a| metric::upgrade(&a, AffineModel::Paraperspective));
        let Some(readings) = next else { break };
        // Of the two interpretations, the one that is not the mirror of the last.
        let likest =
            readings.into_iter().max_by(|a, b| likeness(&current, a).total_cmp(&likeness(&current, b)));
        let Some(next) = likest else { break };
        current = next;
        let now = residual(measured, &current);
        stride = if now > last { (0.5 * stride).max(MIN_STRIDE) } else { (1.2 * stride).min(1.0) };
        last = now;
        if now < least {
            (best, least) = (current.clone(), now);
        }
    }
    best
}

/// Positive where two shapes have the same depth order in the first frame.
fn likeness(a: &MetricMotion, b: &MetricMotion) -> f64 {
    let depth = |metric: &MetricMotion| -> Vec<f64> {
        metric.points.iter().map(|s| (metric.poses[0].rotation * s).z).collect()
    };
    depth(a).iter().zip(depth(b)).map(|(x, y)| x * y).sum()
}

/// Measurements of a paraperspective camera by the present corrections.
fn corrected(measured: &Measurements, epsilon: &[Vec<f64>], origins: &[Vector2<f64>]) -> Measurements {
    let correct =
        |(w, (e, o)): (&Option<Vector2<f64>>, (&f64, &Vector2<f64>))| w.map(|w| (w - o) * (1.0 + e) + o);
    measured
        .iter()
        .zip(epsilon)
        .map(|(seen, epsilon)| seen.iter().zip(epsilon.iter().zip(origins)).map(correct).collect())
        .collect()
}

/// Root mean square distance between measured and projected normalised coordinates; 1 behind a camera.
pub(crate) fn residual(measured: &Measurements, metric: &MetricMotion) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for (point, seen) in metric.points.iter().zip(measured) {
        for (w, pose) in seen.iter().zip(&metric.poses) {
            let Some(w) = w else { continue };
            sum += projected(pose, point).map_or(1.0, |p| (p - w).norm_squared().min(1.0));
            count += 1;
        }
    }
    (sum / f64::from(count.max(1))).sqrt()
}

fn projected(pose: &Isometry3<f64>, point: &Vector3<f64>) -> Option<Vector2<f64>> {
    let p = pose.rotation * point + pose.translation.vector;
    (p.z > 1e-9).then(|| p.xy() / p.z)
}
