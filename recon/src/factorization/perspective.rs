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
//! solution is a fixed point of the first step only: each of the two is followed on its own.

use nalgebra::{Isometry3, Vector2, Vector3};

use super::affine::{self, Measurements};
use super::metric::{self, Metric, Model};

const MAX_ITERATIONS: usize = 30;
/// Mean change of the corrections at which the iteration has settled.
const CHANGE_END: f64 = 1e-7;
/// Corrections are kept here: a point at less than a fifth of its origin's depth is no start for anything.
const EPSILON_RANGE: (f64, f64) = (-0.8, 4.0);

/// Both perspective readings of the measurements (normalised image coordinates), the better first, each with its root
/// mean square residual.
pub(crate) fn factorize(measured: &Measurements) -> Vec<(Metric, f64)> {
    let Some(start) = affine::factorize(measured) else { return Vec::new() };
    let Some(readings) = metric::upgrade(&start, Model::Paraperspective) else { return Vec::new() };
    let mut settled: Vec<(Metric, f64)> = readings
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

/// Iterates from one reading; keeps the best solution met, as the iteration may wander far from affine.
fn settle(measured: &Measurements, start: Metric) -> Metric {
    let (mut best, mut least) = (start.clone(), residual(measured, &start));
    let mut current = start;
    let mut before: Option<Measurements> = None;
    for _ in 0..MAX_ITERATIONS {
        let corrected = corrected(measured, &current);
        let change = before.as_ref().map_or(f64::INFINITY, |b| mean_change(b, &corrected));
        if change < CHANGE_END {
            break;
        }
        let next = affine::factorize(&corrected).and_then(|a| metric::upgrade(&a, Model::Paraperspective));
        let Some(readings) = next else { break };
        // Of the two readings, the one that is not the mirror of the last.
        let Some(next) =
            readings.into_iter().max_by(|a, b| likeness(&current, a).total_cmp(&likeness(&current, b)))
        else {
            break;
        };
        current = next;
        before = Some(corrected);
        let now = residual(measured, &current);
        if now < least {
            (best, least) = (current.clone(), now);
        }
    }
    best
}

/// Positive where two shapes agree about what is near and far as the first frame sees it.
fn likeness(a: &Metric, b: &Metric) -> f64 {
    let depth = |metric: &Metric| -> Vec<f64> {
        metric.points.iter().map(|s| (metric.poses[0].rotation * s).z).collect()
    };
    depth(a).iter().zip(depth(b)).map(|(x, y)| x * y).sum()
}

fn corrected(measured: &Measurements, metric: &Metric) -> Measurements {
    let correct = |point: &Vector3<f64>, seen: &Vec<Option<Vector2<f64>>>| {
        seen.iter()
            .zip(&metric.poses)
            .map(|(w, pose)| {
                let t = pose.translation.vector;
                let origin = t.xy() / t.z;
                let epsilon = ((pose.rotation * point).z / t.z).clamp(EPSILON_RANGE.0, EPSILON_RANGE.1);
                w.map(|w| (w - origin) * (1.0 + epsilon) + origin)
            })
            .collect()
    };
    metric.points.iter().zip(measured).map(|(point, seen)| correct(point, seen)).collect()
}

fn mean_change(a: &Measurements, b: &Measurements) -> f64 {
    let changes: Vec<f64> = a
        .iter()
        .flatten()
        .zip(b.iter().flatten())
        .filter_map(|(a, b)| Some((a.as_ref()? - b.as_ref()?).norm()))
        .collect();
    changes.iter().sum::<f64>() / changes.len().max(1) as f64
}

/// Root mean square distance between measured and projected normalised coordinates; 1 behind a camera.
pub(crate) fn residual(measured: &Measurements, metric: &Metric) -> f64 {
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
