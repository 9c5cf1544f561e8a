//! The offsets of all cameras, from those of the pairs: weighted least squares, for each group of cameras that pairs
//! join.
//!
//! Around a triangle of cameras the pairs' offsets should add up to 0. Where they contradict each other by more than
//! their uncertainties, all uncertainties grow by as much (Birge, "The calculation of errors by the method of least
//! squares", Physical Review 40, 1932).

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::OffsetOptions;
use super::fit::OffsetLine;

/// Estimated offset and drift of the clock of one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraOffset {
    /// Camera whose clock this one is compared with: the first of all cameras that are joined by people whom two of
    /// them see. A camera that is its own reference has offset 0.
    pub reference: usize,
    /// Seconds to add to this camera's times to get the reference's clock, at [`super::Offsets::at_s`].
    pub offset_s: f64,
    /// Standard deviation of the offset, seconds; infinite where nothing is observed.
    pub sigma_s: f64,
    /// Rate at which the offset changes, microseconds a second; drawn towards 0 while little is observed.
    pub drift_ppm: f64,
    /// Standard deviation of the drift, microseconds a second.
    pub drift_sigma_ppm: f64,
    /// Whether the offset can be used: it comes from a real peak and is well enough determined, or the camera is the
    /// reference of others.
    pub is_known: bool,
}

impl CameraOffset {
    /// Drift, microseconds a second; `None` until it is known well enough to be reported.
    pub fn known_drift_ppm(&self) -> Option<f64> {
        (self.is_known && self.drift_sigma_ppm < REPORTED_DRIFT_SIGMA_PPM).then_some(self.drift_ppm)
    }
}

/// Standard deviation below which a drift is reported: a quarter of the largest difference between clocks.
const REPORTED_DRIFT_SIGMA_PPM: f64 = 50.0;

/// Solves for the offsets of `count` cameras from the lines of pairs, all of the same time.
pub(super) fn solve(
    count: usize,
    lines: &[([usize; 2], OffsetLine)],
    options: &OffsetOptions,
) -> Vec<CameraOffset> {
    let reference = references(count, lines);
    let mut normal = DMatrix::<f64>::zeros(2 * count, 2 * count);
    let mut right = DVector::<f64>::zeros(2 * count);
    for ([a, b], line) in lines {
        let precision = line.precision();
        for (camera, sign) in [(*a, -1.0), (*b, 1.0)] {
            let mut rows = right.fixed_rows_mut::<2>(2 * camera);
            rows += precision * line.value * sign;
            add(&mut normal, camera, camera, &precision);
        }
        add(&mut normal, *a, *b, &-precision);
        add(&mut normal, *b, *a, &-precision);
    }
    // The references are held at 0.
    for camera in (0..count).filter(|camera| reference[*camera] == *camera) {
        for i in [2 * camera, 2 * camera + 1] {
            normal.row_mut(i).fill(0.0);
            normal.column_mut(i).fill(0.0);
            normal[(i, i)] = 1.0;
            right[i] = 0.0;
        }
    }
    let covariance = normal.try_inverse();
    let solution = covariance.as_ref().map(|covariance| covariance * right);
    let groups = (0..count).filter(|camera| reference[*camera] == *camera).count();
    let birge = solution.as_ref().map_or(1.0, |solution| {
        let squares: f64 = lines.iter().map(|(cameras, line)| contradiction(*cameras, line, solution)).sum();
        // Each pair gives two numbers, and each camera that is no reference takes two.
        let freedom = 2 * (lines.len() + groups).saturating_sub(count);
        if freedom > 0 { (squares / freedom as f64).sqrt().max(1.0) } else { 1.0 }
    });
    let offset = |camera: usize| {
        let reference = reference[camera];
        if reference == camera {
            let is_used = lines.iter().any(|(cameras, _)| cameras.contains(&camera));
            return CameraOffset::of_reference(camera, is_used);
        }
        let (Some(covariance), Some(solution)) = (&covariance, &solution) else {
            return CameraOffset::of_reference(camera, false);
        };
        let value: Vector2<f64> = solution.fixed_rows::<2>(2 * camera).into();
        let sigma = [0, 1].map(|i| birge * covariance[(2 * camera + i, 2 * camera + i)].sqrt());
        CameraOffset {
            reference,
            offset_s: value.x,
            sigma_s: sigma[0],
            drift_ppm: 1e6 * value.y,
            drift_sigma_ppm: 1e6 * sigma[1],
            is_known: sigma[0] < options.known_sigma_s,
        }
    };
    (0..count).map(offset).collect()
}

impl CameraOffset {
    /// Offset of a camera that is its own reference: others are compared with it (`is_used`), or it is compared with
    /// none.
    fn of_reference(camera: usize, is_used: bool) -> Self {
        let sigma = if is_used { 0.0 } else { f64::INFINITY };
        Self {
            reference: camera,
            offset_s: 0.0,
            sigma_s: sigma,
            drift_ppm: 0.0,
            drift_sigma_ppm: sigma,
            is_known: is_used,
        }
    }
}

/// Squared distance between a pair's own line and the solution, in standard deviations.
fn contradiction([a, b]: [usize; 2], line: &OffsetLine, solution: &DVector<f64>) -> f64 {
    let of = |camera: usize| -> Vector2<f64> { solution.fixed_rows::<2>(2 * camera).into() };
    let apart = line.value - (of(b) - of(a));
    apart.dot(&(line.precision() * apart))
}

fn add(matrix: &mut DMatrix<f64>, row: usize, column: usize, block: &Matrix2<f64>) {
    let mut view = matrix.fixed_view_mut::<2, 2>(2 * row, 2 * column);
    view += block;
}

/// First camera that pairs join each camera with.
fn references(count: usize, lines: &[([usize; 2], OffsetLine)]) -> Vec<usize> {
    let mut reference: Vec<usize> = (0..count).collect();
    // One round for each link of the longest possible chain.
    for _ in 0..count {
        for ([a, b], _) in lines {
            let first = reference[*a].min(reference[*b]);
            (reference[*a], reference[*b]) = (first, first);
        }
    }
    reference
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(offset_s: f64, drift_ppm: f64, sigma_s: f64) -> OffsetLine {
        let covariance = Matrix2::from_diagonal(&Vector2::new(sigma_s.powi(2), 1e-4_f64.powi(2)));
        OffsetLine { at_s: 0.0, value: Vector2::new(offset_s, 1e-6 * drift_ppm), covariance }
    }

    #[test]
    fn pairs_that_agree_give_weighted_means() {
        let lines = [
            ([0, 1], line(0.50, 100.0, 0.01)),
            ([1, 2], line(-0.80, -100.0, 0.01)),
            ([0, 2], line(-0.303, 0.0, 0.01)),
        ];
        let found = solve(3, &lines, &OffsetOptions::recording());
        // The triangle does not close by 3 ms, of which each side takes a third.
        assert!(
            (found[1].offset_s - 0.499).abs() < 1e-9 && (found[2].offset_s + 0.302).abs() < 1e-9,
            "{found:?}"
        );
        assert!((found[1].drift_ppm - 100.0).abs() < 1e-6 && found[2].drift_ppm.abs() < 1e-6, "{found:?}");
        // One side, and the two others one after the other: variances of 1 and 2 in parallel.
        let expected_s = 0.01 * (2.0_f64 / 3.0).sqrt();
        assert!((found[1].sigma_s - expected_s).abs() < 1e-9, "{found:?}");
        assert!(found.iter().all(|camera| camera.is_known && camera.reference == 0));
    }

    #[test]
    fn pairs_that_contradict_each_other_are_less_certain() {
        let sides = [([0, 1], 0.5), ([1, 2], -0.8), ([0, 2], 0.0)];
        let lines = sides.map(|(cameras, offset_s)| (cameras, line(offset_s, 0.0, 0.01)));
        let found = solve(3, &lines, &OffsetOptions::recording());
        assert!(found[1].sigma_s > 0.08 && !found[1].is_known && !found[2].is_known, "{found:?}");
    }

    #[test]
    fn cameras_that_no_pair_joins_have_references_of_their_own() {
        let lines = [([1, 3], line(0.2, 0.0, 0.02)), ([3, 4], line(0.1, 0.0, 0.02))];
        let found = solve(5, &lines, &OffsetOptions::recording());
        let references: Vec<usize> = found.iter().map(|camera| camera.reference).collect();
        assert_eq!(references, [0, 1, 2, 1, 1]);
        let known: Vec<bool> = found.iter().map(|camera| camera.is_known).collect();
        assert_eq!(known, [false, true, false, true, true]);
        assert!((found[4].offset_s - 0.3).abs() < 1e-9, "{found:?}");
        assert!(found[0].sigma_s.is_infinite() && found[2].sigma_s.is_infinite());
    }
}
