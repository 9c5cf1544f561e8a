//! Check that the picked points can join all cameras.

use nalgebra::Point2;

use super::{LEAST_SHARED_POINTS, Project};
use crate::{Error, Result};

impl Project {
    /// Checks that every camera is connected with the first over pairs that share enough points, not on a line.
    pub(super) fn check_connected(&self) -> Result<()> {
        let mut joined = vec![false; self.cameras.len()];
        joined[0] = true;
        let mut line: Option<(usize, usize)> = None;
        loop {
            let mut grown = false;
            for b in 0..self.cameras.len() {
                for a in 0..self.cameras.len() {
                    let shared = self.shared(a, b);
                    if joined[b] || !joined[a] || shared.len() < LEAST_SHARED_POINTS {
                        continue;
                    }
                    let (in_a, in_b): (Vec<_>, Vec<_>) = shared.into_iter().unzip();
                    if on_a_line(&in_a) && on_a_line(&in_b) {
                        line = Some((a, b));
                        continue;
                    }
                    joined[b] = true;
                    grown = true;
                }
            }
            if !grown {
                break;
            }
        }
        let Some(alone) = joined.iter().position(|j| !j) else { return Ok(()) };
        if let Some((a, b)) = line {
            let problem = format!(
                "the points shared by `{}` and `{}` lie on a line, which leaves a turn about it open; pick some beside it",
                self.cameras[a].name, self.cameras[b].name
            );
            return Err(Error::content(&self.path, "[[point]]", problem));
        }
        let most = (0..self.cameras.len())
            .filter(|a| joined[*a])
            .map(|a| (self.shared(a, alone).len(), a))
            .max_by_key(|(count, a)| (*count, usize::MAX - a));
        let (count, other) = most.unwrap_or((0, 0));
        let problem = format!(
            "`{}` and `{}` share {count} points; at least {LEAST_SHARED_POINTS} a pair are needed to join `{}` to the others",
            self.cameras[other].name, self.cameras[alone].name, self.cameras[alone].name
        );
        Err(Error::content(&self.path, "[[point]]", problem))
    }
}

/// Tells whether pixels lie on a line to within half a pixel: the smaller principal spread.
fn on_a_line(pixels: &[Point2<f64>]) -> bool {
    let n = pixels.len() as f64;
    let mean = pixels.iter().map(|p| p.coords).sum::<nalgebra::Vector2<f64>>() / n;
    let scatter: nalgebra::Matrix2<f64> =
        pixels.iter().map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
    let smallest = scatter.symmetric_eigenvalues().min();
    (smallest.max(0.0) / n).sqrt() < 0.5
}
