//! Estimates the vertical by robust consensus over floor, horizontal planes, walls and vertical lines: the table and
//! the walls around a mostly covered floor determine it better than the floor alone.
//!
//! A plane tilted by the small vector t moves a point at x from its mean by t · x. Residuals are correlated over some
//! length a (where a capture's space is bent, its surfaces are bent with it), so that a plane of area A counts as `n =
//! max(1, A / a²)` observations. With the points' covariance S and the residuals' variance r², the information of plane
//! k about its tilt is `Λ = n S / r²`. Things are level, or plumb, only within σ; the floor defines level. Tilts are
//! relative to the fitted floor, so t is the tilt of the vertical against its normal; of a wall, n is the normal across
//! that one, and s its component along it:
//!
//! ```text
//! floor          0 = t     + N(0, Λ⁻¹)
//! level plane  t_k = t     + N(0, Λ_k⁻¹ + σ² I)
//! wall         −s_k = n · t + N(0, (Λ_k⁻¹ along up) + σ²)
//! plumb lines  t_k = t     + N(0, C_k)
//! ```
//!
//! The last are those of one capture's pictures, with the covariance C of [`Plumb`].
//!
//! Sloped desks and leaning boards must be excluded: among the planes that face up, down or sideways to within some
//! angle, true ones are assumed q times as frequent as others, which are spread evenly within that angle. So a plane is
//! more likely a true one where its density is larger,
//!
//! ```text
//! χ²_k(t) < 2 ln (q · peak density / even density)
//! ```
//!
//! and the true planes together determine t. That has many solutions; each is rated by the area that agrees, in shares
//! of `1 − χ² / bound` (the truncated quadratics of A. Blake and A. Zisserman, "Visual Reconstruction", MIT Press
//! 1987).

#[cfg(test)]
mod tests;

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

use super::FloorOptions;
use super::fit::PlaneFit;
use super::plumb::{Plumb, tangents};

/// Ratio of true level or plumb planes to sloped ones, q.
const TRUE_TO_SLOPED: f64 = 10.0;
/// Largest number of rounds of reassignment.
const ROUNDS: usize = 20;

/// Result of the consensus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ConsensusResult {
    /// Common normal of all level planes.
    pub(super) up: Vector3<f64>,
    /// Number of level planes that agree, the floor among them.
    pub(super) level: usize,
    /// Number of plumb planes that agree.
    pub(super) plumb: usize,
    /// Number of captures whose vertical lines agree.
    pub(super) lines: usize,
    /// Area of all that agree, weighted by their agreement.
    pub(super) area: f64,
}

/// Constraint of one plane on the tilt: `χ²(t) = (t − tilt)ᵀ information (t − tilt)`.
#[derive(Debug)]
struct TiltConstraint {
    tilt: Vector2<f64>,
    information: Matrix2<f64>,
    /// χ² at which the plane is as likely to be a sloped one.
    bound: f64,
    area: f64,
}

impl TiltConstraint {
    /// Constraint of a level plane whose normal tilts by `tilt`; `widest` (radians): largest tilt of sloped planes.
    fn level(tilt: Vector2<f64>, covariance: &Matrix2<f64>, area: f64, widest: f64) -> Option<Self> {
        let information = covariance.try_inverse().filter(|m| m.iter().all(|v| v.is_finite()))?;
        let peak = information.determinant().sqrt() / std::f64::consts::TAU;
        let even = 1.0 / (std::f64::consts::PI * widest.powi(2));
        Self::believed(tilt, information, peak / even, area)
    }

    /// Constraint of a plumb plane whose normal is `across` along the axes of tilts and rises by `rise`.
    fn plumb(across: &Vector2<f64>, rise: f64, variance: f64, area: f64, widest: f64) -> Option<Self> {
        let information = across * across.transpose() / variance;
        let tilt = across * (-rise / across.norm_squared());
        let peak = 1.0 / (std::f64::consts::TAU * variance).sqrt();
        let even = 1.0 / (2.0 * widest);
        let finite = information.iter().chain(&tilt).all(|v| v.is_finite());
        finite.then(|| Self::believed(tilt, information, peak / even, area))?
    }

    /// `None` where the information is too little to exclude a sloped plane; `ratio`: density's peak over the even
    /// density.
    fn believed(tilt: Vector2<f64>, information: Matrix2<f64>, ratio: f64, area: f64) -> Option<Self> {
        let bound = 2.0 * (TRUE_TO_SLOPED * ratio).ln();
        (bound > 0.0).then_some(Self { tilt, information, bound, area })
    }

    fn agrees(&self, tilt: &Vector2<f64>) -> bool {
        self.agreement(tilt) > 0.0
    }

    /// Agreement with a tilt: from 1 at the optimum to 0 where a sloped plane is as likely.
    fn agreement(&self, tilt: &Vector2<f64>) -> f64 {
        let off = tilt - self.tilt;
        (1.0 - off.dot(&(self.information * off)) / self.bound).max(0.0)
    }
}

/// Consensus over all constraints, relative to one floor.
pub(super) struct VerticalConsensus {
    floor_normal: Vector3<f64>,
    floor_area: f64,
    /// Axes of tilts, and the constraint of the floor; `None` for a floor that is a line.
    floor: Option<(Matrix3x2<f64>, TiltConstraint)>,
    level: Vec<TiltConstraint>,
    plumb: Vec<TiltConstraint>,
    lines: Vec<TiltConstraint>,
}

impl VerticalConsensus {
    /// # Arguments
    /// `planes`: any planes, the largest first; one that hardly lies apart from an earlier one is skipped. `plumb`:
    /// vertical by the edges in each capture's pictures. `size`: that of the room.
    pub(super) fn new(
        floor: &PlaneFit,
        planes: &[&PlaneFit],
        plumb: &[Plumb],
        size: f64,
        options: &FloorOptions,
    ) -> Self {
        let up = floor.plane.normal;
        let widest = options.normal_spread_deg.to_radians();
        let patch = (options.correlated * size).powi(2);
        let mut voices = Self {
            floor_normal: up,
            floor_area: floor.area,
            floor: None,
            level: Vec::new(),
            plumb: Vec::new(),
            lines: Vec::new(),
        };
        let Some(across) = tangents(&up) else { return voices };
        let own = covariance(floor, &across, patch);
        voices.floor = own
            .and_then(|own| TiltConstraint::level(Vector2::zeros(), &own, floor.area, widest))
            .map(|voice| (across, voice));
        let apart = 4.0 * options.thickness * size;
        let untrue = options.level_sigma_deg.to_radians().powi(2);
        // Lines have no area. A capture has them on many things, so they count as much as its largest plane.
        let largest = planes.iter().map(|plane| plane.area).fold(0.0, f64::max);
        let said = |of: &Plumb| {
            let tilt = across.tr_mul(&of.up) / of.up.dot(&up);
            TiltConstraint::level(tilt, &(across.transpose() * of.covariance * across), largest, widest)
        };
        let near = |of: &&Plumb| of.up.dot(&up) > widest.cos();
        voices.lines = plumb.iter().filter(near).filter_map(said).collect();
        let (mut heights, mut walls) = (vec![0.0], Vec::<&PlaneFit>::new());
        for &plane in planes {
            let normal = plane.plane.normal;
            let facing = normal.dot(&up);
            if facing.abs() > widest.cos() {
                // Smaller planes at this height are parts of it, or of surfaces beside it.
                let height = up.dot(&(plane.mean - floor.mean));
                if heights.iter().any(|other: &f64| (height - other).abs() < apart) {
                    continue;
                }
                heights.push(height);
                // A ceiling faces down.
                let its = across.transpose() * normal * facing.signum();
                let own = covariance(plane, &across, patch).map(|c| c + Matrix2::identity() * untrue);
                voices.level.extend(own.and_then(|own| TiltConstraint::level(its, &own, plane.area, widest)));
            } else if facing.abs() < widest.sin() {
                let same = |wall: &&PlaneFit| {
                    wall.plane.normal.dot(&normal).abs() > widest.cos()
                        && wall.plane.height(&plane.mean).abs() < apart
                };
                if walls.iter().any(same) {
                    continue;
                }
                walls.push(plane);
                let Some(rising) = (up - normal * facing).try_normalize(0.0) else { continue };
                let along = Matrix3x2::from_columns(&[rising, normal.cross(&rising)]);
                let own = covariance(plane, &along, patch).map(|c| c[(0, 0)] + untrue);
                let its = across.transpose() * normal;
                voices
                    .plumb
                    .extend(own.and_then(|own| TiltConstraint::plumb(&its, facing, own, plane.area, widest)));
            }
        }
        voices
    }

    /// Vertical by the constraints that agree with `up`, weighted by their agreement: `up` itself where the floor is a
    /// line. `None` where the floor does not agree.
    pub(super) fn consensus(&self, up: &Vector3<f64>) -> Option<ConsensusResult> {
        let Some((across, floor)) = &self.floor else {
            return Some(ConsensusResult { up: *up, level: 1, plumb: 0, lines: 0, area: self.floor_area });
        };
        let all = || std::iter::once(floor).chain(&self.level).chain(&self.plumb).chain(&self.lines);
        let facing = up.dot(&self.floor_normal);
        if facing <= 0.0 {
            return None;
        }
        let mut tilt = across.transpose() * up / facing;
        for _ in 0..ROUNDS {
            let agreeing = || all().filter(|voice| voice.agrees(&tilt));
            let information: Matrix2<f64> = agreeing().map(|v| v.information).sum();
            let sum: Vector2<f64> = agreeing().map(|v| v.information * v.tilt).sum();
            let next = information.try_inverse()? * sum;
            let settled = (next - tilt).norm() < 1e-12;
            tilt = next;
            if settled {
                break;
            }
        }
        let count = |voices: &[TiltConstraint]| voices.iter().filter(|v| v.agrees(&tilt)).count();
        floor.agrees(&tilt).then(|| ConsensusResult {
            up: (self.floor_normal + across * tilt).normalize(),
            level: 1 + count(&self.level),
            plumb: count(&self.plumb),
            lines: count(&self.lines),
            area: all().map(|v| v.area * v.agreement(&tilt)).sum(),
        })
    }
}

/// Covariance of a plane's tilt along `across`, with one independent observation a `patch` (an area); `None` when its
/// points lie on a line.
fn covariance(fit: &PlaneFit, across: &Matrix3x2<f64>, patch: f64) -> Option<Matrix2<f64>> {
    // Residuals of points that were moved onto their plane are 0: stereo's own noise replaces them.
    let variance = fit.rms.powi(2).max(fit.sigma_squared) / (fit.area / patch).max(1.0);
    let spread: Matrix2<f64> = across.transpose() * fit.spread * across;
    spread.try_inverse().map(|inverse| inverse * variance).filter(|c| c.iter().all(|v| v.is_finite()))
}
