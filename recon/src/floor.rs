//! The floor: a three-dimensional Hough transform over plane parameters, and the world frame that stands on it.
//!
//! A plane is a direction on the sphere (its normal, towards the cameras) and a distance. Every surface point votes for
//! the planes through it whose normal is near its own, with the area it stands for, so that densely sampled
//! nearby things do not win. Peaks are thinned by non-maximum suppression and refined by weighted least squares.
//! Osawa et al. take the plane of the largest area; in many rooms that is a wall. Here the floor is the largest
//! plane that has almost nothing behind it, every camera above it, and lies below the way the images stand.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Similarity3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

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
            peaks: 40,
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
    let peaks = hough(points, size, options);
    let mut best: Option<(f64, Plane, FloorReport)> = None;
    let mut refusal = "no plane was found at all";
    for peak in &peaks {
        let Some((plane, area, rms)) = refine(points, peak, size, options) else { continue };
        let upright = cameras.iter().filter(|c| stands_on(c, &plane, options)).count();
        if 2 * upright <= cameras.len() {
            continue;
        }
        if area < options.least_share * total {
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
        if best.as_ref().is_none_or(|(most, ..)| area > *most) {
            let report = FloorReport {
                peaks: peaks.len(),
                area_share: area / total,
                behind_share: behind / total,
                rms,
            };
            best = Some((area, plane, report));
        }
    }
    best.map(|(_, plane, report)| (plane, report))
        .ok_or_else(|| Error::Room(format!("no floor found among {} planes: {refusal}", peaks.len())))
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

/// Evenly spread directions (a Fibonacci spiral).
fn directions(count: usize) -> Vec<Vector3<f64>> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2 * i + 1) as f64 / count as f64;
            let (radius, angle) = ((1.0 - z * z).sqrt(), golden * i as f64);
            Vector3::new(radius * angle.cos(), radius * angle.sin(), z)
        })
        .collect()
}

/// The strongest cells of the accumulator, none near a stronger one.
fn hough(points: &[SurfacePoint], size: f64, options: &FloorOptions) -> Vec<Plane> {
    let directions = directions(options.directions);
    let cell = options.distance_cell * size;
    let near = options.normal_spread_deg.to_radians().cos();
    // A direction's cells are its own, so directions go in parallel.
    let mut cells: Vec<(f64, Plane)> = directions
        .par_iter()
        .flat_map_iter(|normal| {
            let (mut low, mut high) = (f64::MAX, f64::MIN);
            for p in points.iter().filter(|p| p.normal.dot(normal) > near) {
                let d = normal.dot(&p.position.coords);
                (low, high) = (low.min(d), high.max(d));
            }
            let count = if low <= high { ((high - low) / cell) as usize + 2 } else { 0 };
            let mut votes = vec![0.0; count];
            for p in points.iter().filter(|p| p.normal.dot(normal) > near) {
                // Shared between the two nearest cells, so that a plane on a border loses nothing.
                let at = (normal.dot(&p.position.coords) - low) / cell;
                let (below, share) = (at as usize, at.fract());
                votes[below] += p.area * (1.0 - share);
                if below + 1 < count {
                    votes[below + 1] += p.area * share;
                }
            }
            votes
                .into_iter()
                .enumerate()
                .filter(|(_, v)| *v > 0.0)
                .map(move |(i, v)| (v, Plane { normal: *normal, distance: low + cell * i as f64 }))
                .collect::<Vec<_>>()
        })
        .collect();
    cells.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut peaks: Vec<Plane> = Vec::new();
    for (_, plane) in cells {
        if peaks.len() >= options.peaks {
            break;
        }
        let apart = |other: &Plane| {
            other.normal.dot(&plane.normal) < 12f64.to_radians().cos()
                || (other.distance - plane.distance).abs() > 4.0 * cell
        };
        if peaks.iter().all(apart) {
            peaks.push(plane);
        }
    }
    peaks
}

/// Least squares on what lies within an ever thinner slab; the plane, its area and the root mean square distance.
fn refine(
    points: &[SurfacePoint],
    start: &Plane,
    size: f64,
    options: &FloorOptions,
) -> Option<(Plane, f64, f64)> {
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
        let eigen = scatter.symmetric_eigen();
        let smallest = eigen.eigenvalues.imin();
        let normal: Vector3<f64> = eigen.eigenvectors.column(smallest).into_owned();
        let normal = if normal.dot(&plane.normal) < 0.0 { -normal } else { normal };
        plane = Plane { normal, distance: normal.dot(&mean) };
        let area = inside.iter().map(|p| p.area).sum();
        let rms = (eigen.eigenvalues[smallest].max(0.0) / total).sqrt();
        result = Some((plane, area, rms));
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    /// A room of four walls, a ceiling, a floor seen in part and a table, in its own frame with the floor at z = 0;
    /// sampled unevenly, with noise, and moved by `pose`.
    fn room(seed: u64, pose: &Similarity3<f64>) -> (Vec<SurfacePoint>, Vec<Isometry3<f64>>) {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (w, d, h) =
            (4.0 + rng.random::<f64>() * 4.0, 3.0 + rng.random::<f64>() * 3.0, 2.3 + rng.random::<f64>());
        let table = (0.3 * w, 0.3 * d, 0.75);
        // Origin, two edges, normal, density (points a square metre).
        let v = Vector3::new;
        let patches = [
            (v(0.0, 0.0, 0.0), v(w, 0.0, 0.0), v(0.0, 0.8 * d, 0.0), Vector3::z(), 40.0),
            (v(0.0, 0.0, h), v(w, 0.0, 0.0), v(0.0, d, 0.0), -Vector3::z(), 30.0),
            (v(0.0, 0.0, 0.0), v(w, 0.0, 0.0), v(0.0, 0.0, h), Vector3::y(), 90.0),
            (v(0.0, d, 0.0), v(w, 0.0, 0.0), v(0.0, 0.0, h), -Vector3::y(), 150.0),
            (v(0.0, 0.0, 0.0), v(0.0, d, 0.0), v(0.0, 0.0, h), Vector3::x(), 60.0),
            (v(w, 0.0, 0.0), v(0.0, d, 0.0), v(0.0, 0.0, h), -Vector3::x(), 60.0),
            (v(table.0, table.1, table.2), v(1.6, 0.0, 0.0), v(0.0, 1.0, 0.0), Vector3::z(), 800.0),
        ];
        let scale = pose.scaling();
        let mut points = Vec::new();
        for (origin, a, b, normal, density) in patches {
            let area: f64 = a.cross(&b).norm();
            let count = (area * density) as usize;
            for _ in 0..count {
                let (s, t): (f64, f64) = (rng.random(), rng.random());
                let mut gauss = || -> f64 { StandardNormal.sample(&mut rng) };
                let noise = 0.01 * gauss();
                let tilt = Vector3::new(gauss(), gauss(), gauss()) * 0.1;
                let local = Point3::from(origin + a * s + b * t + normal * noise);
                points.push(SurfacePoint {
                    position: pose * local,
                    normal: pose.isometry.rotation * (normal + tilt).normalize(),
                    area: area / count as f64 * scale * scale,
                    sigma: 0.01 * scale,
                });
            }
        }
        // In two corners, looking at the room's middle near the floor, slightly rolled.
        let cameras = [(v(0.3, 0.3, 2.1), 0.1), (v(w - 0.4, d - 0.3, 1.9), -0.15)].map(|(eye, roll)| {
            let ahead = v(0.5 * w, 0.5 * d, 0.3) - eye;
            let world_from_camera = UnitQuaternion::face_towards(&ahead, &-Vector3::z())
                * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), roll);
            let rotation = pose.isometry.rotation * world_from_camera;
            let centre = pose * Point3::from(eye);
            Isometry3::from_parts(Translation3::from(centre.coords), rotation).inverse()
        });
        (points, cameras.to_vec())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn the_floor_of_any_room_is_found(
            seed in 0u64..1000,
            angles in prop::array::uniform3(-3.0f64..3.0),
            shift in prop::array::uniform3(-5.0f64..5.0),
            scale in 0.05f64..20.0,
        ) {
            let rotation = UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]);
            let pose = Similarity3::from_parts(Translation3::from(Vector3::from(shift)), rotation, scale);
            let (points, cameras) = room(seed, &pose);
            let (plane, report) = find(&points, &cameras, &FloorOptions::default()).unwrap();
            let truth = rotation * Vector3::z();
            prop_assert!(plane.normal.angle(&truth).to_degrees() < 0.2, "{report:?}");
            let height = plane.height(&(pose * Point3::new(1.0, 1.0, 0.0))) / scale;
            prop_assert!(height.abs() < 0.01, "{height} {report:?}");
        }
    }

    #[test]
    fn without_its_floor_a_room_has_none() {
        let (points, cameras) = room(3, &Similarity3::identity());
        let without: Vec<SurfacePoint> = points.into_iter().filter(|p| p.position.z > 0.2).collect();
        let line = find(&without, &cameras, &FloorOptions::default());
        // The ceiling looks down, so at most the table is left, and walls reach below it.
        assert!(line.is_err(), "{line:?}");
        assert!(find(&[], &cameras, &FloorOptions::default()).is_err());
    }

    #[test]
    fn the_world_stands_on_the_floor_below_the_first_camera() {
        let floor = Plane { normal: Vector3::new(0.1, -0.9, 0.2).normalize(), distance: -1.3 };
        let camera = Isometry3::from_parts(
            Translation3::new(0.4, 0.2, -0.1),
            UnitQuaternion::from_euler_angles(0.3, 0.5, -0.2),
        );
        let world = world_frame(&floor, &camera);
        let centre = world * (camera.inverse() * Point3::origin());
        assert_relative_eq!(centre.xy(), Point3::origin().xy(), epsilon = 1e-12);
        let height = floor.height(&(camera.inverse() * Point3::origin()));
        assert_relative_eq!(centre.z, height, epsilon = 1e-12);
        let axis = world.rotation * (camera.rotation.inverse() * Vector3::z());
        assert_relative_eq!(axis.y, 0.0, epsilon = 1e-12);
        assert!(axis.x > 0.0);
        let on_floor = Point3::from(floor.normal * floor.distance);
        assert_relative_eq!((world * on_floor).z, 0.0, epsilon = 1e-12);
    }

    #[test]
    fn a_camera_that_looks_straight_down_gives_x_by_its_image() {
        let floor = Plane { normal: Vector3::z(), distance: 0.0 };
        // Looking down: image right is world x, image down is world −y, so image up is world y.
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let camera =
            Isometry3::from_parts(Translation3::from(rotation * -Vector3::new(1.0, 2.0, 3.0)), rotation);
        let world = world_frame(&floor, &camera);
        assert_relative_eq!(world.rotation * Vector3::y(), Vector3::x(), epsilon = 1e-9);
        assert_relative_eq!(world * Point3::new(1.0, 2.0, 0.0), Point3::origin(), epsilon = 1e-9);
    }
}
