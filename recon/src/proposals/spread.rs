//! Choice of few matches out of many: those that lie farthest apart in space.

use nalgebra::Point3;

use super::guided::GuidedMatch;
use crate::project::{self, LEAST_SHARED_POINTS};

/// Chooses at most `count` matches, each the one farthest from all before; the best-correlated first.
pub(super) fn choose(found: &[GuidedMatch], count: usize) -> Vec<GuidedMatch> {
    let mut left = found.to_vec();
    left.sort_by(|p, q| q.correlation.total_cmp(&p.correlation));
    let mut chosen: Vec<GuidedMatch> = Vec::new();
    while chosen.len() < count && !left.is_empty() {
        let apart = |m: &GuidedMatch| {
            let at = &m.positions[0];
            let distance = |other: &GuidedMatch| (other.positions[0] - at).norm() / at.coords.norm();
            chosen.iter().map(distance).fold(f64::INFINITY, f64::min)
        };
        // Of equal distances the first one, which is better correlated.
        let farthest = (0..left.len()).rev().max_by(|i, j| apart(&left[*i]).total_cmp(&apart(&left[*j])));
        let Some(farthest) = farthest else { break };
        let next = left.remove(farthest);
        if apart(&next) <= 0.0 {
            break;
        }
        chosen.push(next);
    }
    chosen
}

/// Tells whether the points suffice to join two cameras: enough, and not on a line.
pub(super) fn is_wide(chosen: &[GuidedMatch]) -> bool {
    let points: Vec<Point3<f64>> = chosen.iter().map(|m| m.positions[0]).collect();
    points.len() >= LEAST_SHARED_POINTS && project::is_wide(&points)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    fn at(x: f64, y: f64, correlation: f64) -> GuidedMatch {
        let pixel = Point2::new(100.0 * x, 100.0 * y);
        let position = Point3::new(x, y, 3.0);
        GuidedMatch { pixels: [pixel; 2], positions: [position; 2], correlation, off_px: 0.0 }
    }

    #[test]
    fn matches_far_apart_are_chosen() {
        let crowd = (0..20).map(|i| at(0.5 + 0.001 * f64::from(i), 0.5, 0.9));
        let corners = [at(0.0, 0.0, 0.8), at(1.0, 0.0, 0.8), at(0.0, 1.0, 0.8), at(1.0, 1.0, 0.8)];
        let all: Vec<GuidedMatch> = crowd.chain(corners).collect();
        let chosen = choose(&all, 5);
        assert_eq!(chosen.len(), 5);
        for corner in corners {
            assert!(chosen.contains(&corner), "{chosen:?}");
        }
        assert!(choose(&[], 4).is_empty());
        assert_eq!(choose(&[corners[0], corners[0], corners[1]], 9).len(), 2, "one place is proposed once");
    }

    #[test]
    fn the_best_correlated_comes_first() {
        assert_eq!(
            choose(&[at(0.0, 0.0, 0.8), at(0.1, 0.0, 0.95), at(0.3, 0.0, 0.9)], 1),
            [at(0.1, 0.0, 0.95)]
        );
    }

    #[test]
    fn points_on_a_line_do_not_join_cameras() {
        let line: Vec<GuidedMatch> =
            (0..6).map(|i| at(0.3 * f64::from(i), 0.1 * f64::from(i), 0.9)).collect();
        assert!(!is_wide(&line) && !is_wide(&line[..2]) && !is_wide(&[]));
        assert!(is_wide(&[line[0], line[5], at(0.0, 0.8, 0.9)]));
    }
}
