//! Cameras to look at a room with: from a point to a point, and from above over the whole of it.

use calib::{Camera, Intrinsics};
use glam::Vec3;
use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::geometry::{Geometry, point_from_vec3};

/// Share of a cloud's coordinates at either end that counts as stray: a reconstruction has some wild points.
const STRAY_SHARE: f64 = 0.01;

/// Pose (`camera_from_world`) of an upright camera at `eye` that looks at `target`.
///
/// Straight up or down, the image's top points along +Y. An eye at its target looks along +X.
pub fn look_at(eye: &Point3<f64>, target: &Point3<f64>) -> Isometry3<f64> {
    let forward = (target - eye).try_normalize(1e-12).unwrap_or_else(Vector3::x);
    let right = forward
        .cross(&Vector3::z())
        .try_normalize(1e-9)
        .or_else(|| forward.cross(&Vector3::y()).try_normalize(1e-9))
        .unwrap_or_else(Vector3::x);
    let down = forward.cross(&right);
    let world_from_camera = Rotation3::from_basis_unchecked(&[right, down, forward]);
    let rotation = UnitQuaternion::from_rotation_matrix(&world_from_camera).inverse();
    Isometry3::from_parts(Translation3::from(-(rotation * eye.coords)), rotation)
}

/// Smallest and largest corner of the box around the geometry above the floor, for pictures: the whole of a mesh, a
/// cloud without its stray points. `None` without any.
pub fn extent(geometry: &Geometry) -> Option<(Vec3, Vec3)> {
    let (points, stray_share): (Vec<Vec3>, f64) = match geometry {
        Geometry::Mesh(mesh) => (mesh.vertices.clone(), 0.0),
        Geometry::Discs(discs) => (discs.iter().map(|d| d.center).collect(), STRAY_SHARE),
    };
    let range = |axis: usize| {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).filter(|v| v.is_finite()).collect();
        values.sort_unstable_by(f32::total_cmp);
        let stray = (values.len() as f64 * stray_share) as usize;
        Some((*values.get(stray)?, *values.get(values.len() - 1 - stray)?))
    };
    let [x, y, z] = [range(0)?, range(1)?, range(2)?];
    // Nothing stands below the floor.
    Some((Vec3::new(x.0, y.0, z.0.max(0.0).min(z.1)), Vec3::new(x.1, y.1, z.1)))
}

/// Camera outside and above a box that sees the whole of it from the least distance.
///
/// `azimuth_deg` is the side: 0 from +X, 90 from +Y. `elevation_deg` is the angle above the horizon.
pub fn birds_eye(
    (low, high): (Vec3, Vec3),
    [width, height]: [u32; 2],
    azimuth_deg: f64,
    elevation_deg: f64,
) -> Camera {
    /// A long lens: parallel edges stay nearly parallel, as in an axonometric drawing.
    const FIELD_OF_VIEW_DEG: f64 = 32.0;
    /// Free rim around the box, a share of the image.
    const RIM: f64 = 0.03;

    let intrinsics = Intrinsics::from_horizontal_fov(width, height, FIELD_OF_VIEW_DEG);
    let (low, high) = (point_from_vec3(low), point_from_vec3(high));
    let center = nalgebra::center(&low, &high);
    let (azimuth, elevation) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    let outwards =
        Vector3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
    let corners: Vec<Point3<f64>> = (0..8)
        .map(|i| {
            let pick = |bit: usize, axis: usize| if i >> bit & 1 == 0 { low[axis] } else { high[axis] };
            Point3::new(pick(0, 0), pick(1, 1), pick(2, 2))
        })
        .collect();
    let at = |distance: f64, shift_px: [f64; 2]| {
        let mut intrinsics = intrinsics.clone();
        intrinsics.cx += shift_px[0];
        intrinsics.cy += shift_px[1];
        Camera { intrinsics, camera_from_world: look_at(&(center + outwards * distance), &center) }
    };
    // Left, top, right and bottom of the box's image; `None` when a corner is behind the camera.
    let covered = |camera: &Camera| {
        corners.iter().try_fold([f64::MAX, f64::MAX, f64::MIN, f64::MIN], |b, corner| {
            let p = camera.project(corner)?;
            Some([b[0].min(p.x), b[1].min(p.y), b[2].max(p.x), b[3].max(p.y)])
        })
    };
    let fits = |distance: f64| {
        covered(&at(distance, [0.0; 2])).is_some_and(|[left, top, right, bottom]| {
            right - left <= width as f64 * (1.0 - 2.0 * RIM)
                && bottom - top <= height as f64 * (1.0 - 2.0 * RIM)
        })
    };
    let size = (high - low).norm().max(1e-3);
    let (mut near, mut far) = (0.5 * size, 50.0 * size);
    for _ in 0..50 {
        let middle = 0.5 * (near + far);
        if fits(middle) {
            far = middle;
        } else {
            near = middle;
        }
    }
    // Perspective makes the nearer half larger: shift the image so that the box sits in its middle.
    let shift = covered(&at(far, [0.0; 2])).map_or([0.0; 2], |[left, top, right, bottom]| {
        [0.5 * (width as f64 - 1.0 - left - right), 0.5 * (height as f64 - 1.0 - top - bottom)]
    });
    at(far, shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Disc;
    use approx::assert_relative_eq;
    use nalgebra::Point2;

    #[test]
    fn a_camera_looks_where_it_was_told_and_stands_upright() {
        let intrinsics = Intrinsics::from_horizontal_fov(640, 480, 70.0);
        let (eye, target) = (Point3::new(1.0, -2.0, 2.4), Point3::new(3.0, 1.0, 0.8));
        let camera = Camera { intrinsics, camera_from_world: look_at(&eye, &target) };
        assert_relative_eq!(camera.center(), eye, epsilon = 1e-12);
        assert_relative_eq!(camera.project(&target).unwrap(), Point2::new(319.5, 239.5), epsilon = 1e-9);
        let above = camera.project(&(target + Vector3::z() * 0.3)).unwrap();
        assert!(above.y < 239.0 && (above.x - 319.5).abs() < 1e-9);

        let down = Camera { camera_from_world: look_at(&eye, &(eye - Vector3::z())), ..camera };
        let north = down.project(&Point3::new(1.0, -1.5, 0.0)).unwrap();
        let east = down.project(&Point3::new(1.5, -2.0, 0.0)).unwrap();
        assert!(north.y < 200.0 && (north.x - 319.5).abs() < 1e-9 && east.x > 350.0);
    }

    #[test]
    fn the_birds_eye_sees_the_whole_box_and_no_more_than_it_must() {
        let bounds = (Vec3::new(-1.0, 0.5, 0.0), Vec3::new(5.0, 4.0, 2.5));
        for (azimuth, elevation) in [(20.0, 50.0), (135.0, 35.0), (290.0, 89.0)] {
            let camera = birds_eye(bounds, [800, 600], azimuth, elevation);
            let mut nearest_rim = f64::MAX;
            for corner in 0..8 {
                let pick = |bit: usize, a: f32, b: f32| f64::from(if corner >> bit & 1 == 0 { a } else { b });
                let p = camera
                    .project(&Point3::new(pick(0, -1.0, 5.0), pick(1, 0.5, 4.0), pick(2, 0.0, 2.5)))
                    .unwrap();
                assert!(camera.intrinsics.contains(&p), "{azimuth} {elevation}: {p}");
                nearest_rim = nearest_rim.min(p.x.min(799.0 - p.x).min(p.y).min(599.0 - p.y));
            }
            assert!(nearest_rim < 25.0, "{azimuth} {elevation}: a rim of {nearest_rim} px is left");
        }
    }

    #[test]
    fn stray_points_do_not_stretch_the_extent() {
        let disc = |x: f32, y: f32| Disc {
            center: Vec3::new(x, y, 1.0),
            normal: Vec3::Z,
            radius: 0.1,
            color: [0; 3],
            filled: false,
            confidence: 1.0,
        };
        let mut discs: Vec<Disc> =
            (0..3000).map(|i| disc((i % 60) as f32 / 59.0, (i / 60) as f32 / 49.0)).collect();
        discs.push(disc(1000.0, f32::NAN));
        let (low, high) = extent(&Geometry::Discs(discs)).unwrap();
        assert!(
            low.distance(Vec3::new(0.0, 0.0, 1.0)) < 0.03 && high.distance(Vec3::ONE) < 0.03,
            "{low} {high}"
        );
        assert_eq!(extent(&Geometry::Discs(vec![])), None);
    }
}
