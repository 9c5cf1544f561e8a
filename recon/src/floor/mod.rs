//! The floor: a three-dimensional Hough transform over plane parameters, and the world frame that stands on it.
//!
//! A plane is a direction on the sphere (its normal, towards the cameras) and a distance. Every surface point votes for
//! the planes through it whose normal is near its own, with the area it stands for, so that densely sampled
//! nearby things do not win. Peaks are thinned by non-maximum suppression and refined by weighted least squares.
//! Osawa et al. take the plane of the largest area; in many rooms that is a wall. Here the floor is the largest
//! plane that has almost nothing behind it, every camera above it, and lies below the way the images stand.
//! Where little of it is seen, the other level planes say better which way is up ([`vertical`]).

mod hough;
#[cfg(test)]
mod tests;
mod vertical;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};

use crate::{Error, Result};

/// A piece of surface.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfacePoint {
    /// Where it is.
    pub position: Point3<f64>,
    /// Unit normal, towards the camera that saw it.
    pub normal: Vector3<f64>,
    /// The area it stands for, in the positions' units squared.
    pub area: f64,
    /// Standard deviation of the position along the ray it was seen on.
    pub sigma: f64,
}

/// How the floor is looked for. Lengths are shares of the room's size: the median distance of surface and cameras.
#[derive(Debug, Clone)]
pub struct FloorOptions {
    /// Directions on the sphere.
    pub directions: usize,
    /// Width of a distance cell.
    pub distance_cell: f64,
    /// A point votes for directions this close to its normal, degrees.
    pub normal_spread_deg: f64,
    /// Points this close belong to the plane.
    pub thickness: f64,
    /// At most this share of the area may lie behind a floor.
    pub largest_behind: f64,
    /// A camera is turned about its axis by at most this much against the floor, degrees …
    pub largest_roll_deg: f64,
    /// … and looks at most this far upwards; downwards it may look as it likes.
    pub largest_upward_deg: f64,
    /// A floor has at least this share of the area seen.
    pub least_share: f64,
    /// Peaks looked at.
    pub peaks: usize,
    /// Over this length residuals hang together.
    pub correlated: f64,
    /// How far level furniture and ceilings are from level, degrees (standard deviation).
    pub level_sigma_deg: f64,
}

impl Default for FloorOptions {
    fn default() -> Self {
        Self {
            directions: 4000,
            distance_cell: 0.02,
            normal_spread_deg: 25.0,
            thickness: 0.015,
            largest_behind: 0.04,
            largest_roll_deg: 35.0,
            largest_upward_deg: 25.0,
            least_share: 0.02,
            peaks: 100,
            correlated: 0.3,
            level_sigma_deg: 0.5,
        }
    }
}

/// A plane `normal · x = distance`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit normal, towards the cameras.
    pub normal: Vector3<f64>,
    /// Its distance from the origin along the normal.
    pub distance: f64,
}

impl Plane {
    /// How far a point lies before the plane.
    pub fn height(&self, p: &Point3<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.distance
    }
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct FloorReport {
    /// Planes that were looked at, after suppression.
    pub peaks: usize,
    /// The floor's share of all area seen.
    pub area_share: f64,
    /// The share of the area that lies behind it.
    pub behind_share: f64,
    /// Root mean square distance of its points.
    pub rms: f64,
    /// Planes that say which way is up: the floor and those parallel to it.
    pub level_planes: usize,
}

/// A plane fitted to surface points.
#[derive(Debug, Clone)]
struct Fit {
    plane: Plane,
    /// The points' area.
    area: f64,
    /// Root mean square distance of the points.
    rms: f64,
    /// Weighted mean of what stereo says of its own standard deviation, squared.
    sigma_squared: f64,
    /// The points' weighted mean …
    mean: Point3<f64>,
    /// … and covariance.
    spread: Matrix3<f64>,
}

/// The floor among `points`.
///
/// # Arguments
/// `cameras`: each camera's pose (camera from the points' frame).
///
/// # Errors
/// [`Error::Room`] when no plane can be a floor, saying what was wrong with the best.
pub fn find(
    points: &[SurfacePoint],
    cameras: &[Isometry3<f64>],
    options: &FloorOptions,
) -> Result<(Plane, FloorReport)> {
    let centres: Vec<Point3<f64>> = cameras.iter().map(|c| c.inverse() * Point3::origin()).collect();
    let size = room_size(points, &centres)
        .ok_or_else(|| Error::Room("no surface was reconstructed, so there is no floor to find".into()))?;
    // What is not known to within a plane's thickness says as much less about planes: far things are large and vague.
    let vague = |p: &SurfacePoint| 1.0 + (p.sigma / (options.thickness * size)).powi(2);
    let points: &[SurfacePoint] =
        &points.iter().map(|p| SurfacePoint { area: p.area / vague(p), ..p.clone() }).collect::<Vec<_>>();
    let total: f64 = points.iter().map(|p| p.area).sum();
    let peaks = hough::peaks(points, size, options);
    let fits: Vec<Fit> = peaks.iter().filter_map(|peak| refine(points, peak, size, options)).collect();
    let mut best: Option<(&Fit, FloorReport)> = None;
    let mut refusal = "no plane was found at all";
    for fit in &fits {
        let Fit { plane, area, rms, .. } = fit;
        let upright = cameras.iter().filter(|c| stands_on(c, plane, options)).count();
        if 2 * upright <= cameras.len() {
            continue;
        }
        if *area < options.least_share * total {
            refusal = "the planes that lie level are too small; let the cameras see more of the floor";
            continue;
        }
        if !centres.iter().all(|c| plane.height(c) > 3.0 * options.thickness * size) {
            refusal = "the planes that lie level are not below every camera";
            continue;
        }
        let behind: f64 = points
            .iter()
            .filter(|p| plane.height(&p.position) < -3.0 * options.thickness * size - 3.0 * p.sigma)
            .map(|p| p.area)
            .sum();
        let (share, low) = (area / total, behind / total);
        tracing::debug!("a level plane with {share:.3} of the area, {low:.3} below it, {rms:.4} rms");
        if behind > options.largest_behind * total {
            refusal = "each plane that lies level has too much below it; is the floor itself in view?";
            continue;
        }
        if best.as_ref().is_none_or(|(most, _)| *area > most.area) {
            let report = FloorReport {
                peaks: peaks.len(),
                area_share: share,
                behind_share: low,
                rms: *rms,
                level_planes: 1,
            };
            best = Some((fit, report));
        }
    }
    let (floor, mut report) =
        best.ok_or_else(|| Error::Room(format!("no floor found among {} planes: {refusal}", peaks.len())))?;
    let mut large: Vec<&Fit> = fits.iter().filter(|f| f.area >= options.least_share * total).collect();
    large.sort_by(|a, b| b.area.total_cmp(&a.area));
    let (normal, voters) = vertical::vote(floor, &large, size, options);
    report.level_planes = voters;
    Ok((Plane { normal, distance: normal.dot(&floor.mean.coords) }, report))
}

/// Whether the plane could be the floor by the way a camera's image stands: its normal goes up in the image or, when the
/// camera looks down, towards it; walls go sideways, or away.
fn stands_on(camera: &Isometry3<f64>, plane: &Plane, options: &FloorOptions) -> bool {
    let normal = camera.rotation * plane.normal;
    let (right, up, back) = (normal.x, -normal.y, -normal.z);
    let pitch_deg = back.atan2(up).to_degrees();
    right.abs() < options.largest_roll_deg.to_radians().sin()
        && pitch_deg > -options.largest_upward_deg
        && pitch_deg < 90.0 + options.largest_upward_deg
}

/// The world frame of `interfaces.md`: the floor is z = 0, the origin lies below the first camera's centre, x is the
/// horizontal projection of its optical axis. Returns `world_from_common`, without scale.
pub fn world_frame(floor: &Plane, first_camera: &Isometry3<f64>) -> Isometry3<f64> {
    let centre = first_camera.inverse() * Point3::origin();
    let origin = centre - floor.normal * floor.height(&centre);
    let level = |direction: Vector3<f64>| direction - floor.normal * floor.normal.dot(&direction);
    let from_camera = first_camera.rotation.inverse();
    let ahead = level(from_camera * Vector3::z());
    // Looking straight down (or up), ahead is no direction on the floor; what is up in the image is.
    let ahead = if ahead.norm() > 0.02 { ahead } else { level(from_camera * -Vector3::y()) };
    let x = ahead.normalize();
    let y = floor.normal.cross(&x);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&[
        x.transpose(),
        y.transpose(),
        floor.normal.transpose(),
    ]));
    let rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    Isometry3::from_parts(Translation3::from(-(rotation * origin.coords)), rotation)
}

/// `world_from_common` with the scale: `metres_per_unit` metres a unit of the common frame.
pub fn metric(world_from_common: &Isometry3<f64>, metres_per_unit: f64) -> Similarity3<f64> {
    Similarity3::from_parts(
        Translation3::from(world_from_common.translation.vector * metres_per_unit),
        world_from_common.rotation,
        metres_per_unit,
    )
}

/// The median distance between surface points and the cameras' mean.
fn room_size(points: &[SurfacePoint], cameras: &[Point3<f64>]) -> Option<f64> {
    let mean = cameras.iter().map(|c| c.coords).sum::<Vector3<f64>>() / cameras.len().max(1) as f64;
    let mut distances: Vec<f64> = points.iter().map(|p| (p.position.coords - mean).norm()).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().filter(|size| *size > 0.0)
}

/// Least squares on what lies within an ever thinner slab.
fn refine(points: &[SurfacePoint], start: &Plane, size: f64, options: &FloorOptions) -> Option<Fit> {
    let near = options.normal_spread_deg.to_radians().cos();
    let mut plane = *start;
    let mut result = None;
    for thickness in [3.0, 2.0, 1.5, 1.0, 1.0, 1.0] {
        let slab = thickness * options.thickness * size;
        let inside: Vec<&SurfacePoint> = points
            .iter()
            .filter(|p| plane.height(&p.position).abs() < slab && p.normal.dot(&plane.normal) > near)
            .collect();
        if inside.len() < 10 {
            return None;
        }
        // By area, so that every piece of floor has its say, and by what is known of it.
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
        let normal = if normal.dot(&plane.normal) < 0.0 { -normal } else { normal };
        plane = Plane { normal, distance: normal.dot(&mean) };
        result = Some(Fit {
            plane,
            area: inside.iter().map(|p| p.area).sum(),
            rms: eigen.eigenvalues[smallest].max(0.0).sqrt(),
            sigma_squared: inside.iter().map(|p| p.sigma.powi(2) * weight(p)).sum::<f64>() / total,
            mean: mean.into(),
            spread,
        });
    }
    result
}
