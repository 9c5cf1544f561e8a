//! Check that points are spread widely enough to join two cameras.

use nalgebra::{Matrix3, Point3, Vector3};

/// Least second principal spread as a share of the distance: points on a line leave the rotation about it open, and
/// depths have about this error.
const LEAST_WIDTH: f64 = 0.03;

/// Tells whether points, in a camera's frame, are not on a line.
pub(crate) fn is_wide(points: &[Point3<f64>]) -> bool {
    let n = points.len().max(1) as f64;
    let mean = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
    let scatter: Matrix3<f64> =
        points.iter().map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
    let mut spreads: [f64; 3] = scatter.symmetric_eigenvalues().into();
    spreads.sort_by(f64::total_cmp);
    (spreads[1].max(0.0) / n).sqrt() > LEAST_WIDTH * mean.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_are_not_wide() {
        let line: Vec<Point3<f64>> =
            (0..6).map(|i| Point3::new(0.3 * f64::from(i), 0.1 * f64::from(i), 3.0)).collect();
        assert!(!is_wide(&line) && !is_wide(&line[..1]) && !is_wide(&[]));
        assert!(is_wide(&[line[0], line[5], Point3::new(0.0, 0.8, 3.0)]));
        // Ten centimetres beside a line that is three metres away suffice; at a hundred metres they do not.
        let beside = |depth: f64| {
            let zigzag = |i: i32| Point3::new(0.3 * f64::from(i), 0.1 * f64::from(i % 2), depth);
            is_wide(&(0..8).map(zigzag).collect::<Vec<_>>())
        };
        assert!(beside(1.0) && !beside(3.0));
    }
}
