//! Calibration of the reported uncertainty.

use super::Matched;

/// 95 % quantile of the squared distance, in standard deviations, of a normal distribution on the plane.
const ELLIPSE_95: f64 = 5.991;

/// Share of the found people whose true place lies in the 95 % ellipse around the estimate; `None` when nobody was
/// found.
pub fn coverage(matched: &[Matched]) -> Option<f64> {
    let inside: Vec<bool> = matched
        .iter()
        .filter_map(|row| {
            let found = row.found.as_ref()?;
            let [dx, dy] = [found.x - row.place.x, found.y - row.place.y];
            Some((dx / found.sigma[0]).powi(2) + (dy / found.sigma[1]).powi(2) <= ELLIPSE_95)
        })
        .collect();
    (!inside.is_empty()).then(|| inside.iter().filter(|i| **i).count() as f64 / inside.len() as f64)
}
