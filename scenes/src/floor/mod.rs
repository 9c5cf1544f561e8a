//! The floor: a three-dimensional Hough transform over plane parameters, and the world frame that stands on it.
//!
//! A plane is a direction on the sphere (its normal, towards the cameras) and a distance. Every surface point votes for
//! the planes through it whose normal is near its own, with the area it stands for, so that densely sampled nearby
//! things do not win. Peaks are thinned by non-maximum suppression and refined by weighted least squares. T. Osawa et
//! al. ("MCMC based Multiple People Tracking using 3D Environmental Information", paper LI-007) take the plane of the
//! largest area; in many rooms that is a wall, and in a bent reconstruction a seemingly large floor combines a little
//! of it with something else. Here every plane that could be level given the cameras' orientations determines a
//! candidate floor: a plane that has almost nothing behind it and every camera above it. The area of the planes level
//! or plumb with it ([`vertical`]) and the vertical lines in the pictures ([`Plumb`]) support the vertical, and
//! the floor's own area the plane at that height, so the candidate with the largest sum of both wins, less the area
//! behind it: a polished floor reflects another ceiling.

mod fit;
mod hough;
mod plumb;
mod surface;
#[cfg(test)]
mod tests;
mod vertical;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use fit::{Cloud, PlaneFit};
use vertical::VerticalConsensus;

pub use plumb::{Plumb, tangents};
pub use surface::surface_points;

/// A surface point with the area it stands for.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfacePoint {
    /// Position.
    pub position: Point3<f64>,
    /// Unit normal, towards the camera that saw it.
    pub normal: Vector3<f64>,
    /// Area that the point stands for, in the positions' units squared.
    pub area: f64,
    /// Standard deviation of the position along the ray it was seen on.
    pub sigma: f64,
}

/// Options of the floor's search. Lengths are shares of the room's size: the median distance of surface and cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FloorOptions {
    /// Number of directions on the sphere.
    pub directions: usize,
    /// Width of a distance cell.
    pub distance_cell: f64,
    /// Angle between a point's normal and the directions it votes for, degrees.
    pub normal_spread_deg: f64,
    /// Largest distance of a plane's points.
    pub thickness: f64,
    /// Largest share of the area that may lie behind a floor.
    pub largest_behind: f64,
    /// Largest rotation of a camera about its axis against the floor, degrees …
    pub largest_roll_deg: f64,
    /// … and largest angle by which it may look upwards; downwards there is no limit.
    pub largest_upward_deg: f64,
    /// Least share of the seen area that a floor has.
    pub least_share: f64,
    /// Number of peaks examined.
    pub peaks: usize,
    /// Correlation length of the residuals.
    pub correlated: f64,
    /// Standard deviation of furniture and ceilings from level, degrees.
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
    /// Distance from the origin along the normal.
    pub distance: f64,
}

impl Plane {
    /// Signed distance of a point in front of the plane.
    pub fn height(&self, p: &Point3<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.distance
    }
}

/// Report of the floor's search.
#[derive(Debug, Clone, PartialEq)]
pub struct FloorReport {
    /// Number of planes examined, after suppression.
    pub peaks: usize,
    /// Floor's share of all area seen.
    pub area_share: f64,
    /// Share of the area that lies behind the floor.
    pub behind_share: f64,
    /// Root mean square distance of the floor's points.
    pub rms: f64,
    /// Number of planes that support the vertical: the floor and those parallel to it …
    pub level_planes: usize,
    /// … and walls; …
    pub plumb_planes: usize,
    /// … and captures whose pictures' vertical lines support it.
    pub plumb_captures: usize,
}

/// Finds the floor among `points`.
///
/// # Arguments
/// `cameras`: each camera's pose (camera from the points' frame). `plumb`: vertical there by the lines in each camera's
/// pictures, where they determine it.
///
/// # Errors
/// The problem of the best plane, when none can be a floor.
pub fn find(
    points: &[SurfacePoint],
    cameras: &[Isometry3<f64>],
    plumb: &[Plumb],
    options: &FloorOptions,
) -> Result<(Plane, FloorReport), String> {
    let centres: Vec<Point3<f64>> = cameras.iter().map(|c| c.inverse() * Point3::origin()).collect();
    let size =
        room_size(points, &centres).ok_or("no surface was reconstructed, so there is no floor to find")?;
    // The weight of a point falls with its uncertainty relative to a plane's thickness: far points are large and
    // uncertain.
    let vague = |p: &SurfacePoint| 1.0 + (p.sigma / (options.thickness * size)).powi(2);
    let points: Vec<SurfacePoint> =
        points.iter().map(|p| SurfacePoint { area: p.area / vague(p), ..p.clone() }).collect();
    let cloud = Cloud { points: &points, size, options };
    let total = cloud.area();
    let peaks = hough::peaks(&points, size, options);
    let fits = cloud.planes(&peaks);
    let large: Vec<&PlaneFit> = fits.iter().filter(|f| f.area >= options.least_share * total).collect();
    let upright = |fit: &PlaneFit| {
        2 * cameras.iter().filter(|camera| stands_on(camera, &fit.plane, options)).count() > cameras.len()
    };
    let level: Vec<&PlaneFit> = large.iter().copied().filter(|fit| upright(fit)).collect();
    let mut refusal = if fits.iter().any(upright) {
        "the planes that lie level are too small; let the captures show more of the floor"
    } else {
        "no plane was found that lies level; let the captures show the floor, and put the cameras up as pictures are meant to \
         be seen"
    };
    let mut best: Option<(f64, Plane, FloorReport)> = None;
    for &up in &level {
        for (floor, plane) in grounds(&cloud, up, &level) {
            if floor.area < options.least_share * total {
                continue;
            }
            if !centres.iter().all(|c| plane.height(c) > 3.0 * options.thickness * size) {
                refusal = "the planes that lie level are not below every camera; check the picks, and let a capture show the floor itself";
                break;
            }
            let behind = cloud.area_behind(&plane);
            if behind > options.largest_behind * total {
                refusal = "each plane that lies level has too much below it; is the floor itself in view?";
                break;
            }
            let voices = VerticalConsensus::new(&floor, &large, plumb, size, options);
            let ups = std::iter::once(&plane.normal).chain(plumb.iter().map(|of| &of.up));
            let agreed = ups.filter_map(|up| voices.consensus(up));
            let Some(agreed) = agreed.reduce(|a, b| if b.area > a.area { b } else { a }) else { continue };
            let worth = (agreed.area + floor.area - behind) / total;
            let report = FloorReport {
                peaks: peaks.len(),
                area_share: floor.area / total,
                behind_share: behind / total,
                rms: floor.rms,
                level_planes: agreed.level,
                plumb_planes: agreed.plumb,
                plumb_captures: agreed.lines,
            };
            tracing::debug!("up {:.3?}: worth {worth:.3} with {report:?}", agreed.up.as_slice());
            if best.as_ref().is_none_or(|(most, ..)| worth > *most) {
                let plane = Plane { normal: agreed.up, distance: agreed.up.dot(&floor.mean.coords) };
                best = Some((worth, plane, report));
            }
        }
    }
    best.map(|(_, plane, report)| (plane, report))
        .ok_or_else(|| format!("no floor found among {} planes: {refusal}", peaks.len()))
}

/// Candidate floors if a plane is level, the lowest first, each with the level plane through it: points parallel to the
/// plane at the heights of others, and the plane itself.
fn grounds(cloud: &Cloud<'_>, up: &PlaneFit, level: &[&PlaneFit]) -> impl Iterator<Item = (PlaneFit, Plane)> {
    let normal = up.plane.normal;
    let height = move |fit: &PlaneFit| normal.dot(&fit.mean.coords);
    let apart = cloud.options.thickness * cloud.size;
    let its_own = move |distance: f64| (distance - height(up)).abs() < apart;
    let mut heights: Vec<f64> = level.iter().map(|other| height(other)).filter(|h| !its_own(*h)).collect();
    heights.push(height(up));
    heights.sort_by(f64::total_cmp);
    heights.dedup_by(|next, before| *next - *before < apart && !its_own(*next));
    heights.into_iter().filter_map(move |distance| {
        let start = Plane { normal, distance };
        let fit = if its_own(distance) { up.clone() } else { cloud.refine_parallel(&start)? };
        let plane = Plane { normal, distance: height(&fit) };
        Some((fit, plane))
    })
}

/// Tells whether the plane could be the floor given a camera's orientation: its normal points up in the image or, when
/// the camera looks down, towards it; the normals of walls point sideways, or away.
fn stands_on(camera: &Isometry3<f64>, plane: &Plane, options: &FloorOptions) -> bool {
    let normal = camera.rotation * plane.normal;
    let (right, up, back) = (normal.x, -normal.y, -normal.z);
    let pitch_deg = back.atan2(up).to_degrees();
    right.abs() < options.largest_roll_deg.to_radians().sin()
        && pitch_deg > -options.largest_upward_deg
        && pitch_deg < 90.0 + options.largest_upward_deg
}

/// The shortest turn and move that bring the floor to z = 0: about the point of the floor below the cameras' middle, which
/// keeps its x and y. `cameras`: their centres.
pub fn levelled(floor: &Plane, cameras: &[Point3<f64>]) -> Isometry3<f64> {
    let middle = cameras.iter().map(|c| c.coords).sum::<Vector3<f64>>() / cameras.len().max(1) as f64;
    let foot = middle - floor.normal * floor.height(&middle.into());
    // Half a turn has no shortest way: about x.
    let rotation = UnitQuaternion::rotation_between(&floor.normal, &Vector3::z())
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let kept = Vector3::new(foot.x, foot.y, 0.0);
    Isometry3::from_parts(Translation3::from(kept - rotation * foot), rotation)
}

/// World frame of a room: the floor is z = 0, the origin lies below the first camera's centre, x is the horizontal
/// projection of its optical axis. Returns `world_from_common`, without scale.
pub fn world_frame(floor: &Plane, first_camera: &Isometry3<f64>) -> Isometry3<f64> {
    let centre = first_camera.inverse() * Point3::origin();
    let origin = centre - floor.normal * floor.height(&centre);
    let level = |direction: Vector3<f64>| direction - floor.normal * floor.normal.dot(&direction);
    let from_camera = first_camera.rotation.inverse();
    let ahead = level(from_camera * Vector3::z());
    // A camera that looks straight down (or up) has no direction ahead on the floor; the image's upward direction is
    // used.
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

/// Median distance between surface points and the cameras' mean.
fn room_size(points: &[SurfacePoint], cameras: &[Point3<f64>]) -> Option<f64> {
    let mean = cameras.iter().map(|c| c.coords).sum::<Vector3<f64>>() / cameras.len().max(1) as f64;
    let mut distances: Vec<f64> = points.iter().map(|p| (p.position.coords - mean).norm()).collect();
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied().filter(|size| *size > 0.0)
}
