//! The offsets of all cameras, from those of the pairs: weighted least squares, for each group of cameras that pairs join.

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::OffsetOptions;
use super::fit::Line;

/// What is known of the clock of one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraOffset {
    /// The camera whose clock this one is compared with: of all cameras that are joined by people whom two of them see, the
    /// first. A camera that is its own reference has offset 0.
    pub reference: usize,
    /// What to add to this camera's times, so that they agree with the reference's clock: seconds, at [`super::Offsets::at_s`].
    pub offset_s: f64,
    /// Standard deviation of the offset, seconds; infinite where nothing is observed.
    pub sigma_s: f64,
    /// How fast the offset changes, microseconds a second. Drawn to 0 while little is observed.
    pub drift_ppm: f64,
    /// Standard deviation of the drift.
    pub drift_sigma_ppm: f64,
    /// Whether the offset can be used: it is that of a real peak, well enough determined; or the camera is the reference of
    /// others.
    pub is_known: bool,
}

impl CameraOffset {
    /// The drift, once it has been observed for long enough to be worth telling.
    pub fn known_drift_ppm(&self) -> Option<f64> {
        (self.is_known && self.drift_sigma_ppm < TOLD_DRIFT_SIGMA_PPM).then_some(self.drift_ppm)
    }
}

/// A drift is told when its standard deviation is below this: a quarter of what clocks differ by at most.
const TOLD_DRIFT_SIGMA_PPM: f64 = 50.0;

/// Solves for the offsets of `count` cameras from the lines of pairs, all of the same time.
pub(super) fn solve(
    count: usize,
    lines: &[([usize; 2], Line)],
    options: &OffsetOptions,
) -> Vec<CameraOffset> {
    let reference = references(count, lines);
    let precision = |line: &Line| line.covariance.try_inverse().unwrap_or_default();
    let mut normal = DMatrix::<f64>::zeros(2 * count, 2 * count);
    let mut right = DVector::<f64>::zeros(2 * count);
    for ([a, b], line) in lines {
        let precision = precision(line);
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
        let sigma = [0, 1].map(|i| covariance[(2 * camera + i, 2 * camera + i)].sqrt());
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
    /// A camera that is its own reference, because others are compared with it or because it is with none.
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

fn add(matrix: &mut DMatrix<f64>, row: usize, column: usize, block: &Matrix2<f64>) {
    let mut view = matrix.fixed_view_mut::<2, 2>(2 * row, 2 * column);
    view += block;
}

/// For each camera the first one that pairs join it with.
fn references(count: usize, lines: &[([usize; 2], Line)]) -> Vec<usize> {
    let mut reference: Vec<usize> = (0..count).collect();
    // As many rounds as the longest chain has links.
    for _ in 0..count {
        for ([a, b], _) in lines {
            let first = reference[*a].min(reference[*b]);
            (reference[*a], reference[*b]) = (first, first);
        }
    }
    reference
}
