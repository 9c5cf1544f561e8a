//! The floor where no capture measured anything.
//!
//! A carpet of one colour, a polished floor, the dark under a table: stereo finds nothing there, and nothing beside it continues
//! the floor, since outlines stop what is continued in the picture ([`crate::planes`]). Once the floor is known, a pixel without
//! a surface shows the floor more likely than anything else. A floor hides nobody who stands on it, so one too many does no harm.
//! In each direction it ends at the wall that the camera saw there, else as far away as it measured any floor.

use nalgebra::{Point3, Similarity3, Vector2, Vector3};
use rayon::prelude::*;
use scenes::geometry::{point_from_vec3, vec3_from_vector, vector_from_vec3};

use crate::dense::Support;
use crate::surface::{DepthOrigin, Surface};

/// Share of what a camera saw in a direction, the farthest, that tells nothing: reflections and strays.
const STRAY: f64 = 0.02;
/// Height above which a surface is a wall's or a tall thing's, which ends the floor in its direction, metres.
const TALL_M: f64 = 1.8;
/// Distance from the floor of what is measured on it, metres.
const FLOOR_M: f64 = 0.1;
/// Number of directions around a camera.
const DIRECTIONS: usize = 360;

/// Continues the floor z = 0 into what each camera filmed and did not measure; returns the number of such pixels.
///
/// # Arguments
/// `lenses`: intrinsics as filmed. `level_from_camera`: the frame in metres whose floor is z = 0 from each surface's frame.
pub(crate) fn continue_floor(
    surfaces: &mut [Surface],
    lenses: &[calib::Intrinsics],
    level_from_camera: &[Similarity3<f64>],
) -> usize {
    let cameras = surfaces.iter_mut().zip(lenses).zip(level_from_camera);
    cameras.map(|((surface, lens), level)| under(surface, lens, level)).sum()
}

/// How far from its camera the floor reaches, metres along the floor.
struct Reach {
    /// By direction: to the wall that was seen there.
    walls_m: Vec<Option<f64>>,
    /// Where no wall was seen: as far as floor was measured in any direction; 0 where none was.
    else_m: f64,
}

impl Reach {
    fn of(surface: &Surface, level_from_camera: &Similarity3<f64>) -> Self {
        let eye = (level_from_camera * Point3::origin()).xy();
        let (mut tall, mut measured) = (vec![Vec::new(); DIRECTIONS], Vec::new());
        for i in 0..surface.depth.len() {
            let Some(point) = surface.point(i).map(|point| level_from_camera * point_from_vec3(point)) else {
                continue;
            };
            let ahead = point.xy() - eye;
            if point.z > TALL_M {
                tall[direction(&ahead)].push(ahead.norm());
            }
            if surface.origin[i] == DepthOrigin::Stereo && point.z.abs() < FLOOR_M {
                measured.push(ahead.norm());
            }
        }
        let walls_m = tall.into_iter().map(farthest).collect();
        Self { walls_m, else_m: farthest(measured).unwrap_or(0.0) }
    }

    /// Whether the floor reaches so far from the camera.
    fn holds(&self, ahead: &Vector2<f64>) -> bool {
        ahead.norm() <= self.walls_m[direction(ahead)].unwrap_or(self.else_m)
    }
}

/// Number of a direction along the floor.
fn direction(ahead: &Vector2<f64>) -> usize {
    let turns = ahead.y.atan2(ahead.x) / std::f64::consts::TAU;
    (turns.rem_euclid(1.0) * DIRECTIONS as f64) as usize % DIRECTIONS
}

/// The largest distance without strays.
fn farthest(mut distances: Vec<f64>) -> Option<f64> {
    let last = distances.len().checked_sub(1)?;
    let kept = ((1.0 - STRAY) * last as f64) as usize;
    Some(*distances.select_nth_unstable_by(kept, f64::total_cmp).1)
}

/// Continues the floor in one camera's picture.
fn under(surface: &mut Surface, lens: &calib::Intrinsics, level_from_camera: &Similarity3<f64>) -> usize {
    let filmed = calib::undistort::UndistortMap::new(lens).filmed();
    let (width, camera) = (surface.width(), surface.pinhole());
    let rotation = level_from_camera.isometry.rotation;
    let up = vec3_from_vector(&(rotation.inverse() * Vector3::z()));
    let height_m = level_from_camera.isometry.translation.vector.z;
    let reach = Reach::of(surface, level_from_camera);
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
    let mut continued = 0;
    for (i, depth) in depths.into_iter().enumerate() {
        let Some(depth) = depth else { continue };
        surface.depth[i] = depth;
        surface.normal[i] = up;
        surface.origin[i] = DepthOrigin::Filled;
        continued += 1;
    }
    continued
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
        let down =
            -(level_from_camera() * Vector3::new(f64::from(ray.x), f64::from(ray.y), f64::from(ray.z))).z;
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

    #[test]
    fn a_carpet_amid_a_measured_floor_is_floor() {
        let before = carpet(&lens());
        let mut surfaces = [before.clone()];
        let continued = continue_floor(&mut surfaces, &[lens()], &[level_from_camera()]);
        let [after] = surfaces;
        assert_eq!(continued, 64 * 44);
        for i in 0..after.depth.len() {
            let expected = truth(&after, i).unwrap();
            assert!((f64::from(after.depth[i]) / expected - 1.0).abs() < 1e-5, "{i}");
            if before.origin[i] == DepthOrigin::Stereo {
                assert_eq!((after.origin[i], after.normal[i]), (DepthOrigin::Stereo, -Vec3::Z));
            } else {
                assert_eq!((after.origin[i], after.agreeing[i]), (DepthOrigin::Filled, 0));
                let up = level_from_camera().isometry.rotation * vector_from_vec3(after.normal[i]);
                assert!((up - Vector3::z()).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn the_floor_ends_at_walls_and_as_far_away_as_any_was_measured() {
        // A wall ahead, of which only what is higher than a person is known, in the left half of the picture.
        const WALL_M: f64 = 1.8;
        let mut surface = carpet(&lens());
        let level = level_from_camera();
        let eye = level * Point3::origin();
        let ahead = |i: usize, surface: &Surface| {
            level
                * vector_from_vec3(
                    surface.pinhole().ray((i % surface.width()) as f32, (i / surface.width()) as f32),
                )
        };
        let is_left = |i: usize| i as u32 % SIZE.0 < SIZE.0 / 2;
        let mut far_m = 0f64;
        for i in 0..surface.depth.len() {
            surface.forget(i);
            let ray = ahead(i, &surface);
            let wall = eye + ray * (WALL_M / ray.y);
            if is_left(i) && wall.z > TALL_M {
                surface.depth[i] = (WALL_M / ray.y) as f32;
                surface.origin[i] = DepthOrigin::Filled;
            } else if i as u32 % SIZE.0 == SIZE.0 - 1 && i as u32 / SIZE.0 > SIZE.1 / 2 {
                surface.depth[i] = truth(&surface, i).unwrap() as f32;
                surface.origin[i] = DepthOrigin::Stereo;
                far_m = far_m.max((ray * f64::from(surface.depth[i])).xy().norm());
            }
        }
        let before = surface.clone();
        let mut surfaces = [surface];
        let continued = continue_floor(&mut surfaces, &[lens()], &[level]);
        let [after] = surfaces;
        let places_m = |of: std::ops::Range<u32>| {
            let (before, after) = (&before, &after);
            (0..after.depth.len())
                .filter(move |i| before.depth[*i] == 0.0 && after.depth[*i] > 0.0)
                .filter(move |i| of.contains(&(*i as u32 % SIZE.0)))
                .map(move |i| (ahead(i, after) * f64::from(after.depth[i])).xy())
        };
        assert!(continued > 1200, "{continued}");
        // Below, the picture is wider than the wall.
        let below_wall = places_m(0..SIZE.0 / 2).filter(|place| place.x.abs() < 0.5 * place.y);
        let wall_m = below_wall.map(|place| place.y).fold(0.0, f64::max);
        assert!((WALL_M - 0.1..WALL_M + 0.05).contains(&wall_m), "{wall_m}");
        let right_m = places_m(SIZE.0 / 2 + 2..SIZE.0).map(|place| place.norm()).fold(0.0, f64::max);
        assert!((0.9 * far_m..=far_m).contains(&right_m), "{right_m} {far_m}");
    }

    #[test]
    fn a_camera_that_looks_up_or_measured_nothing_has_no_floor() {
        let up = Similarity3::from_parts(
            Translation3::new(0.0, 0.0, EYE_M),
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 0.2),
            UNIT_M,
        );
        assert_eq!(continue_floor(&mut [carpet(&lens())], &[lens()], &[up]), 0);
        let mut nothing = carpet(&lens());
        (0..nothing.depth.len()).for_each(|i| nothing.forget(i));
        assert_eq!(continue_floor(&mut [nothing], &[lens()], &[level_from_camera()]), 0);
        assert_eq!(continue_floor(&mut [], &[], &[]), 0);
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
        let continued = continue_floor(&mut surfaces, &[lens], &[level_from_camera()]);
        let [after] = surfaces;
        assert!(unfilmed > 100 && continued > 500, "{unfilmed} {continued}");
        assert!((0..filmed.len()).filter(|i| black(&after, *i)).all(|i| after.depth[i] == 0.0));
    }
}
