//! The floor where no capture measured anything.
//!
//! A carpet of one colour, a polished floor, the dark under a table: stereo finds nothing there, and nothing beside it continues
//! the floor, since outlines stop what is continued in the picture ([`crate::planes`]). Once the floor is known, a pixel without
//! a surface shows the floor more likely than anything else, and a floor hides nobody who stands on it. In each direction from a
//! camera it ends at the wall that was seen there, or in the nearest direction in which one was seen; where floor was measured
//! behind, behind that. A camera that saw no wall has floor as far away as it measured any. A wall without texture from end to end
//! does not end it. It is no evidence: surfaces that other views measured before it stay.

use nalgebra::{Point3, Similarity3, Vector2, Vector3};
use rayon::prelude::*;
use scenes::geometry::{point_from_vec3, vec3_from_vector, vector_from_vec3};

use crate::dense::Support;
use crate::surface::{DepthOrigin, Surface};

/// Share of what a camera saw in a direction, the farthest, that tells nothing: reflections and strays; and least number of pixels
/// that tell something.
const STRAY: f64 = 0.02;
const LEAST_SEEN: usize = 5;
/// Height from which on an upright surface is a wall's rather than of something that one looks over, metres, and largest vertical
/// part of its normal.
const WALL_M: f64 = 1.8;
const UPRIGHT: f64 = 0.5;
/// Largest distance from the floor of points that are measured on it, metres.
const FLOOR_M: f64 = 0.1;
/// Number of directions around a camera.
const DIRECTIONS: usize = 360;

/// Assumes the floor z = 0 in what each camera filmed and did not measure.
///
/// # Arguments
/// `lenses`: intrinsics as filmed. `level_from_camera`: the frame in metres whose floor is z = 0 from each surface's frame.
pub(crate) fn assume_floor(
    surfaces: &mut [Surface],
    lenses: &[calib::Intrinsics],
    level_from_camera: &[Similarity3<f64>],
) {
    for ((surface, lens), level) in surfaces.iter_mut().zip(lenses).zip(level_from_camera) {
        assume_in(surface, lens, level);
    }
}

/// Distance from a camera at which the floor that is assumed for it ends, for each direction along the floor, metres.
struct Reach(Vec<f64>);

impl Reach {
    /// `None` of a camera that saw neither a wall nor floor.
    fn of(surface: &Surface, level_from_camera: &Similarity3<f64>) -> Option<Self> {
        let eye = (level_from_camera * Point3::origin()).xy();
        let (mut walls, mut floor) = (vec![Vec::new(); DIRECTIONS], vec![Vec::new(); DIRECTIONS]);
        for i in 0..surface.depth.len() {
            let Some(point) = surface.point(i).map(|point| level_from_camera * point_from_vec3(point)) else {
                continue;
            };
            let ahead = point.xy() - eye;
            let normal = level_from_camera.isometry.rotation * vector_from_vec3(surface.normal[i]);
            if point.z > WALL_M && normal.z.abs() < UPRIGHT {
                walls[direction(&ahead)].push(ahead.norm());
            } else if point.z.abs() < FLOOR_M {
                floor[direction(&ahead)].push(ahead.norm());
            }
        }
        let any_floor = farthest(floor.concat());
        let walls: Vec<Option<f64>> = walls.into_iter().map(farthest).collect();
        let nearest_wall = |from: usize| {
            (0..=DIRECTIONS / 2).find_map(|turn| {
                let sides = [(from + turn) % DIRECTIONS, (from + DIRECTIONS - turn) % DIRECTIONS];
                sides.into_iter().filter_map(|side| walls[side]).reduce(f64::max)
            })
        };
        let of_direction = |(from, floor): (usize, Vec<f64>)| {
            let wall = nearest_wall(from).or(any_floor)?;
            Some(farthest(floor).map_or(wall, |floor| floor.max(wall)))
        };
        Some(Self(floor.into_iter().enumerate().map(of_direction).collect::<Option<Vec<f64>>>()?))
    }

    /// Tells whether a place on the floor, given from the camera's foot, is within reach.
    fn holds(&self, ahead: &Vector2<f64>) -> bool {
        ahead.norm() <= self.0[direction(ahead)]
    }
}

/// Number of a direction along the floor.
fn direction(ahead: &Vector2<f64>) -> usize {
    let turns = ahead.y.atan2(ahead.x) / std::f64::consts::TAU;
    (turns.rem_euclid(1.0) * DIRECTIONS as f64) as usize % DIRECTIONS
}

/// The largest distance without strays; `None` of too few.
fn farthest(mut distances: Vec<f64>) -> Option<f64> {
    if distances.len() < LEAST_SEEN {
        return None;
    }
    let kept = ((1.0 - STRAY) * (distances.len() - 1) as f64) as usize;
    Some(*distances.select_nth_unstable_by(kept, f64::total_cmp).1)
}

/// Assumes the floor in one camera's picture.
fn assume_in(surface: &mut Surface, lens: &calib::Intrinsics, level_from_camera: &Similarity3<f64>) {
    let Some(reach) = Reach::of(surface, level_from_camera) else { return };
    let filmed = calib::undistort::UndistortMap::to(lens, &surface.intrinsics).filmed();
    let (width, camera) = (surface.width(), surface.pinhole());
    let rotation = level_from_camera.isometry.rotation;
    let up = vec3_from_vector(&(rotation.inverse() * Vector3::z()));
    let height_m = level_from_camera.isometry.translation.vector.z;
    let depth = |i: usize| {
        if surface.depth[i] > 0.0 || !filmed[i] {
            return None;
        }
        let ray = camera.ray((i % width) as f32, (i / width) as f32);
        if up.dot(ray) > -Support::LEAST_COSINE * ray.length() {
            return None;
        }
        let ahead_m = level_from_camera * vector_from_vec3(ray);
        let depth = -height_m / ahead_m.z;
        (depth > 0.0 && reach.holds(&(ahead_m.xy() * depth))).then_some(depth as f32)
    };
    let depths: Vec<Option<f32>> = (0..surface.depth.len()).into_par_iter().map(depth).collect();
    for (i, depth) in depths.into_iter().enumerate() {
        let Some(depth) = depth else { continue };
        surface.depth[i] = depth;
        surface.normal[i] = up;
        surface.origin[i] = DepthOrigin::Assumed;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::Intrinsics;
    use glam::Vec3;
    use image::RgbImage;
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};

    const SIZE: (u32, u32) = (80, 60);
    const EYE_M: f64 = 2.5;
    /// Metres in a unit of the capture.
    const UNIT_M: f64 = 1.6;

    fn lens() -> Intrinsics {
        Intrinsics::from_horizontal_fov(SIZE.0, SIZE.1, 60.0)
    }

    /// A camera 2.5 m above the floor that looks 40° down, towards y.
    fn level_from_camera() -> Similarity3<f64> {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -(90f64 + 40.0).to_radians());
        Similarity3::from_isometry(
            Isometry3::from_parts(Translation3::new(0.3, -1.0, EYE_M), rotation),
            UNIT_M,
        )
    }

    /// Depth of the floor at a pixel, in units of the capture.
    fn truth(surface: &Surface, i: usize) -> Option<f64> {
        let ray = surface.pinhole().ray((i % surface.width()) as f32, (i / surface.width()) as f32);
        let down = -(level_from_camera() * vector_from_vec3(ray)).z;
        (down > 0.0).then(|| EYE_M / down)
    }

    /// The floor, measured in the outermost pixels of a picture whose middle shows a carpet.
    fn carpet(intrinsics: &Intrinsics) -> Surface {
        let count = (intrinsics.width * intrinsics.height) as usize;
        let mut surface = Surface {
            picture: RgbImage::new(intrinsics.width, intrinsics.height),
            intrinsics: intrinsics.clone(),
            depth: vec![0.0; count],
            normal: vec![Vec3::ZERO; count],
            agreeing: vec![0; count],
            origin: vec![DepthOrigin::Unknown; count],
            step: 0.005,
        };
        for i in 0..count {
            let (x, y) = (i as u32 % intrinsics.width, i as u32 / intrinsics.width);
            let rim = x < 8 || x >= intrinsics.width - 8 || y < 8 || y >= intrinsics.height - 8;
            if let Some(depth) = truth(&surface, i).filter(|_| rim) {
                surface.depth[i] = depth as f32;
                surface.origin[i] = DepthOrigin::Stereo;
                surface.normal[i] = -Vec3::Z;
            }
        }
        surface
    }

    fn assumed(surface: &Surface) -> usize {
        surface.origin.iter().filter(|origin| **origin == DepthOrigin::Assumed).count()
    }

    #[test]
    fn a_carpet_amid_a_measured_floor_is_floor() {
        let before = carpet(&lens());
        let mut surfaces = [before.clone()];
        assume_floor(&mut surfaces, &[lens()], &[level_from_camera()]);
        let [after] = surfaces;
        assert!(assumed(&after) > 64 * 44 * 99 / 100, "{}", assumed(&after));
        for i in 0..after.depth.len() {
            if before.origin[i] == DepthOrigin::Stereo {
                assert_eq!((after.origin[i], after.normal[i]), (DepthOrigin::Stereo, -Vec3::Z));
            } else if after.origin[i] == DepthOrigin::Assumed {
                let expected = truth(&after, i).unwrap();
                assert!((f64::from(after.depth[i]) / expected - 1.0).abs() < 1e-5, "{i}");
                assert_eq!(after.agreeing[i], 0);
                let up = level_from_camera().isometry.rotation * vector_from_vec3(after.normal[i]);
                assert!((up - Vector3::z()).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn the_floor_ends_at_walls_and_reaches_as_far_as_it_was_measured() {
        // A wall ahead in the left half of the picture, of which only the upper part is known; floor at the right border.
        const AHEAD_M: f64 = 1.5;
        let mut surface = carpet(&lens());
        let level = level_from_camera();
        let eye = level * Point3::origin();
        let (width, middle) = (surface.width(), surface.width() / 2);
        let pinhole = surface.pinhole();
        let ahead = |i: usize| level * vector_from_vec3(pinhole.ray((i % width) as f32, (i / width) as f32));
        let towards = vec3_from_vector(&(level.isometry.rotation.inverse() * -Vector3::y()));
        let mut far_m = 0f64;
        for i in 0..surface.depth.len() {
            surface.forget(i);
            let ray = ahead(i);
            let wall = eye + ray * (AHEAD_M / ray.y);
            let depth = if i % width < middle && wall.z > WALL_M {
                AHEAD_M / ray.y
            } else if i % width > width - 12 && i / width > 30 {
                let depth = truth(&surface, i).unwrap();
                far_m = far_m.max((ray * depth).xy().norm());
                depth
            } else {
                continue;
            };
            (surface.depth[i], surface.normal[i], surface.origin[i]) =
                (depth as f32, towards, DepthOrigin::Stereo);
        }
        let mut surfaces = [surface];
        assume_floor(&mut surfaces, &[lens()], &[level]);
        let [after] = surfaces;
        let farthest_m = |columns: std::ops::Range<usize>, along: fn(&Vector2<f64>) -> f64| {
            (0..after.depth.len())
                .filter(|i| after.origin[*i] == DepthOrigin::Assumed && columns.contains(&(i % width)))
                .map(|i| along(&(ahead(i) * f64::from(after.depth[i])).xy()))
                .fold(0.0, f64::max)
        };
        assert!(assumed(&after) > 300, "{}", assumed(&after));
        let wall_m = farthest_m(10..middle - 2, |place| place.y);
        assert!((AHEAD_M - 0.15..AHEAD_M + 0.05).contains(&wall_m), "{wall_m}");
        let right_m = farthest_m(middle + 2..width, Vector2::norm);
        assert!((0.7 * far_m..=far_m).contains(&right_m), "{right_m} {far_m}");
    }

    #[test]
    fn a_camera_that_looks_up_or_measured_nothing_has_no_floor() {
        let up = Similarity3::from_parts(
            Translation3::new(0.0, 0.0, EYE_M),
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.2),
            UNIT_M,
        );
        let mut nothing = carpet(&lens());
        (0..nothing.depth.len()).for_each(|i| nothing.forget(i));
        for (surface, level) in [(carpet(&lens()), up), (nothing, level_from_camera())] {
            let mut surfaces = [surface];
            assume_floor(&mut surfaces, &[lens()], &[level]);
            assert_eq!(assumed(&surfaces[0]), 0);
        }
    }

    #[test]
    fn there_is_no_floor_where_the_lens_has_no_image() {
        let (width, height) = SIZE;
        let focal = f64::from(width / 2) / 70f64.to_radians();
        let lens = Intrinsics {
            width,
            height,
            fx: focal,
            fy: focal,
            cx: 40.0,
            cy: 30.0,
            distortion: calib::Fisheye::from([0.0; 4]).into(),
        };
        let filmed = calib::undistort::UndistortMap::new(&lens).filmed();
        let mut surfaces = [carpet(&lens.pinhole())];
        let measured = |surface: &Surface, i: usize| surface.origin[i] == DepthOrigin::Stereo;
        let black =
            |surface: &Surface, i: usize| !filmed[i] && !measured(surface, i) && truth(surface, i).is_some();
        let unfilmed = (0..filmed.len()).filter(|i| black(&surfaces[0], *i)).count();
        assume_floor(&mut surfaces, &[lens], &[level_from_camera()]);
        let [after] = surfaces;
        assert!(unfilmed > 100 && assumed(&after) > 500, "{unfilmed} {}", assumed(&after));
        assert!((0..filmed.len()).filter(|i| black(&after, *i)).all(|i| after.depth[i] == 0.0));
    }
}
