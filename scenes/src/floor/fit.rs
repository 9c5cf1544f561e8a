//! Planes fitted to surface points, refined in ever thinner slabs.

use nalgebra::{Matrix3, Point3, Vector3};

use super::{FloorOptions, Plane, SurfacePoint};

/// Thicknesses of the successive slabs, in units of [`FloorOptions::thickness`].
const SLABS: [f64; 6] = [3.0, 2.0, 1.5, 1.0, 1.0, 1.0];
/// Least number of points of a plane.
const LEAST_POINTS: usize = 10;
/// Angle below which planes have the same direction, degrees …
const SAME_DEG: f64 = 0.05;
/// … and distance, as a share of their thickness, below which they are the same.
const SAME_SHARE: f64 = 0.05;

/// A plane fitted to surface points.
#[derive(Debug, Clone)]
pub(super) struct PlaneFit {
    pub(super) plane: Plane,
    /// Area of the points.
    pub(super) area: f64,
    /// Root mean square distance of the points from the plane.
    pub(super) rms: f64,
    /// Weighted mean of stereo's variance of the points.
    pub(super) sigma_squared: f64,
    /// Weighted mean of the points …
    pub(super) mean: Point3<f64>,
    /// … and covariance.
    pub(super) spread: Matrix3<f64>,
}

impl PlaneFit {
    fn is_same(&self, other: &Self, thickness: f64) -> bool {
        self.plane.normal.dot(&other.plane.normal) > SAME_DEG.to_radians().cos()
            && self.plane.height(&other.mean).abs() < SAME_SHARE * thickness
            && (self.mean - other.mean).norm() < thickness
    }
}

/// Surface points to which planes are fitted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cloud<'a> {
    pub(super) points: &'a [SurfacePoint],
    /// Size of the room.
    pub(super) size: f64,
    pub(super) options: &'a FloorOptions,
}

impl Cloud<'_> {
    pub(super) fn area(&self) -> f64 {
        self.points.iter().map(|p| p.area).sum()
    }

    /// Area of the points that lie clearly behind a plane.
    pub(super) fn area_behind(&self, plane: &Plane) -> f64 {
        let clearly = |p: &&SurfacePoint| plane.height(&p.position) < -3.0 * (self.thickness() + p.sigma);
        self.points.iter().filter(clearly).map(|p| p.area).sum()
    }

    /// Planes refined from the peaks of the accumulator, each once, the largest first.
    pub(super) fn planes(&self, peaks: &[Plane]) -> Vec<PlaneFit> {
        let mut fits: Vec<PlaneFit> = Vec::with_capacity(peaks.len());
        for fit in peaks.iter().filter_map(|peak| self.refine(peak)) {
            if !fits.iter().any(|other| other.is_same(&fit, self.thickness())) {
                fits.push(fit);
            }
        }
        fits.sort_by(|a, b| b.area.total_cmp(&a.area));
        fits
    }

    /// Least squares on the points within an ever thinner slab; `None` where there are hardly any.
    fn refine(&self, start: &Plane) -> Option<PlaneFit> {
        SLABS.iter().try_fold(None, |fit: Option<PlaneFit>, thickness| {
            let about = fit.map_or(*start, |fit| fit.plane);
            self.fitted(&about, *thickness).map(Some)
        })?
    }

    /// [`Self::refine`] with slabs that stay parallel; the points in the last one may slope within it.
    pub(super) fn refine_parallel(&self, start: &Plane) -> Option<PlaneFit> {
        SLABS.iter().try_fold(None, |fit: Option<PlaneFit>, thickness| {
            let distance = fit.map_or(start.distance, |fit| start.normal.dot(&fit.mean.coords));
            self.fitted(&Plane { distance, ..*start }, *thickness).map(Some)
        })?
    }

    /// Plane through the points in a slab about another plane.
    fn fitted(&self, about: &Plane, thickness: f64) -> Option<PlaneFit> {
        let slab = thickness * self.thickness();
        let near = self.options.normal_spread_deg.to_radians().cos();
        let inside: Vec<&SurfacePoint> = self
            .points
            .iter()
            .filter(|p| about.height(&p.position).abs() < slab && p.normal.dot(&about.normal) > near)
            .collect();
        if inside.len() < LEAST_POINTS {
            return None;
        }
        // Weighted by area, so that every piece of floor counts, and by precision.
        let weight = |p: &SurfacePoint| p.area / (p.sigma.powi(2) + (0.1 * slab).powi(2));
        let total: f64 = inside.iter().map(|p| weight(p)).sum();
        let mean = inside.iter().map(|p| p.position.coords * weight(p)).sum::<Vector3<f64>>() / total;
        let scatter: Matrix3<f64> = inside
            .iter()
            .map(|p| {
                let d = p.position.coords - mean;
                d * d.transpose() * weight(p)
            })
            .sum();
        let spread = scatter / total;
        let eigen = spread.symmetric_eigen();
        let smallest = eigen.eigenvalues.imin();
        let normal: Vector3<f64> = eigen.eigenvectors.column(smallest).into_owned();
        let normal = if normal.dot(&about.normal) < 0.0 { -normal } else { normal };
        Some(PlaneFit {
            plane: Plane { normal, distance: normal.dot(&mean) },
            area: inside.iter().map(|p| p.area).sum(),
            rms: eigen.eigenvalues[smallest].max(0.0).sqrt(),
            sigma_squared: inside.iter().map(|p| p.sigma.powi(2) * weight(p)).sum::<f64>() / total,
            mean: mean.into(),
            spread,
        })
    }

    fn thickness(&self) -> f64 {
        self.options.thickness * self.size
    }
}
