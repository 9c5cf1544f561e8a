//! Distance of a track from a known route, as T. Osawa et al. measure it ("MCMC based Multiple People Tracking using 3D
//! Environmental Information", paper LI-007, section 4.3): video and true positions are not synchronised there, so each
//! estimated place counts with its distance from the nearest point of the route.

use std::ops::RangeInclusive;
use std::path::Path;

use nalgebra::Point2;

use crate::chain::StepResult;

/// Frames of the office in which person 1 is alone: in from the door, and along a rectangle.
pub const ALONE: RangeInclusive<u32> = 45..=170;
/// Frames of the true way that count as the route: early and late estimates still lie beside it.
pub const ROUTE: RangeInclusive<u32> = 35..=173;

/// Distances of a track's places from a route.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RouteError {
    /// Number of places measured.
    pub places: usize,
    /// Mean distance, metres.
    pub mean_m: f64,
    /// Greatest distance, metres.
    pub maximum_m: f64,
}

/// Distances of places from the line through the points of a route; `None` without places, or for a route of fewer than
/// two points.
pub fn route(places: &[Point2<f64>], line: &[Point2<f64>]) -> Option<RouteError> {
    let distances: Option<Vec<f64>> = places.iter().map(|place| distance_m(place, line)).collect();
    let distances = distances.filter(|d| !d.is_empty())?;
    Some(RouteError {
        places: distances.len(),
        mean_m: distances.iter().sum::<f64>() / distances.len() as f64,
        maximum_m: distances.iter().copied().fold(0.0, f64::max),
    })
}

/// [`route`] of a run on the office, against its truth.
///
/// # Errors
/// A file that cannot be read; no person in these frames.
pub fn office_route(office: &Path, tracks: &Path) -> StepResult<RouteError> {
    let way = places(&office.join("truth.txt"), &ROUTE)?;
    route(&places(tracks, &ALONE)?, &way).ok_or_else(|| format!("{}: nobody to measure", tracks.display()))
}

/// Places of all people in some frames of a file of `MOTChallenge` rows on the floor.
///
/// # Errors
/// A file that cannot be read, an invalid row.
pub fn places(rows: &Path, frames: &RangeInclusive<u32>) -> StepResult<Vec<Point2<f64>>> {
    let text = std::fs::read_to_string(rows).map_err(|e| format!("{}: {e}", rows.display()))?;
    let place = |line: &str| {
        let columns: Vec<f64> = line.split(',').map_while(|value| value.trim().parse().ok()).collect();
        let [frame, .., x, y, _] = columns[..] else { return Err(format!("{}: {line}", rows.display())) };
        Ok(frames.contains(&(frame as u32)).then(|| Point2::new(x, y)))
    };
    text.lines().map(place).filter_map(Result::transpose).collect()
}

fn distance_m(place: &Point2<f64>, line: &[Point2<f64>]) -> Option<f64> {
    let to_side = |[a, b]: &[Point2<f64>; 2]| {
        let side = b - a;
        let along = (place - a).dot(&side) / side.norm_squared().max(f64::MIN_POSITIVE);
        (place - (a + side * along.clamp(0.0, 1.0))).norm()
    };
    line.array_windows().map(to_side).reduce(f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points<const N: usize>(places: [(f64, f64); N]) -> [Point2<f64>; N] {
        places.map(|(x, y)| Point2::new(x, y))
    }

    #[test]
    fn distances_are_those_from_the_nearest_side() {
        let line = points([(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)]);
        // On a side, inside, outside a side, outside a corner, beyond the end.
        let places = points([(1.0, 0.0), (2.0, 0.3), (2.0, -0.4), (4.3, -0.4), (-0.1, 2.0)]);
        let found = route(&places, &line).unwrap();
        assert_eq!(found.places, 5);
        assert!((found.mean_m - (0.0 + 0.3 + 0.4 + 0.5 + 0.1) / 5.0).abs() < 1e-12, "{found:?}");
        assert!((found.maximum_m - 0.5).abs() < 1e-12);
        let open = route(&points([(0.0, 1.2)]), &line).unwrap();
        assert!((open.mean_m - 0.8).abs() < 1e-12, "the way back to the start is no part of it");
        assert!(route(&[], &line).is_none() && route(&places, &line[..1]).is_none());
    }
}
