//! Depth of single pixels of the reference image, from all frames of the capture.
//!
//! Dense stereo smooths over its supports and matches a few key frames. For a picked pixel more effort is spent: its
//! patch is searched in every frame along the epipolar line (all inverse depths, multiple-baseline stereo after M.
//! Okutomi and T. Kanade, "A multiple-baseline stereo", PAMI 1993), registered there to a fraction of a pixel, and the
//! inverse depth that explains all registrations is estimated robustly, with its standard deviation.
//!
//! A patch that holds an edge of something near moves with that edge, whatever surface its middle is on. So patches of several sizes
//! are measured, and the largest that agrees with the smallest is taken (after T. Kanade and M. Okutomi, "A stereo matching algorithm
//! with an adaptive window", PAMI 1994). Within half the smallest patch of an edge all sizes err. There the neighbours on both
//! sides tell: along a plane the inverse depth is linear over the image, so that of a pixel is the mean of theirs.

mod search;

use calib::Intrinsics;
use image::RgbImage;
use nalgebra::{Isometry3, Point2, Vector2, Vector3};
use rayon::prelude::*;

use crate::features::Intensity;
use search::{FrameView, RaySearch};

/// Half the sides of a pixel's patches. The larger one is, the more precise; the smaller, the less it holds of another surface.
const PATCH_RADII_PX: [i32; 3] = [4, 7, 10];
/// Relative difference of two depths of a pixel that are the same surface's.
const SAME_SURFACE: f64 = 0.01;
/// Distance of the neighbours that show whether the surface goes on, pixels along each axis.
const NEIGHBOUR_PX: f64 = 6.0;
/// Directions of pairs of neighbours, one on each side of the pixel.
const DIRECTIONS: [(f64, f64); 4] = [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)];
/// Relative difference between the inverse depth of a pixel and the mean of its neighbours' that is an edge: least, and in standard
/// deviations.
const LEAST_EDGE: f64 = 0.015;
const EDGE_SIGMAS: f64 = 3.0;

/// A capture with known motion. World = the reference frame's camera.
#[derive(Debug, Clone, Copy)]
pub struct PosedFilm<'a> {
    /// Frames, all of one size.
    pub frames: &'a [RgbImage],
    /// Index of the reference frame.
    pub reference: usize,
    /// Intrinsics of the frames as filmed.
    pub intrinsics: &'a Intrinsics,
    /// Pose of each frame; the reference frame's is the identity.
    pub camera_from_world: &'a [Option<Isometry3<f64>>],
}

/// A depth along z and its uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayDepth {
    /// Depth in the capture's unit.
    pub depth: f64,
    /// Standard deviation as a share of the depth.
    pub sigma: f64,
}

/// A depth with the registrations that it was measured from.
#[derive(Debug, Clone, PartialEq)]
pub struct RayMeasurement {
    /// Measured depth. Beside an edge its standard deviation is as large as the step that the neighbours show.
    pub depth: RayDepth,
    /// Frames in which the pixel's patch was registered, and its pixel (as filmed) there; without the reference frame. None beside an
    /// edge, which may be what was registered.
    pub seen: Vec<(usize, Point2<f64>)>,
}

/// A pixel of the reference image (as filmed) whose depth was measured.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredPixel {
    /// Pixel as filmed.
    pub pixel: Point2<f64>,
    /// Measured depth.
    pub measured: RayMeasurement,
}

/// A pixel of the reference image (as filmed), and the supposed normal of the surface there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asked {
    /// Pixel as filmed.
    pub pixel: Point2<f64>,
    /// Normal in the reference camera's frame; `None` assumes that the surface faces the camera.
    pub normal: Option<Vector3<f64>>,
}

/// Measures the depth of each pixel (as filmed); `None` where it is undetermined: no texture, hidden, or too little
/// parallax.
///
/// `range`: the smallest and the largest possible depth.
pub fn measure(film: &PosedFilm<'_>, pixels: &[Asked], range: (f64, f64)) -> Vec<Option<RayMeasurement>> {
    if pixels.is_empty() || range.0 <= 0.0 || range.1.is_nan() || range.1 <= range.0 {
        return vec![None; pixels.len()];
    }
    let images: Vec<Intensity> = film.frames.par_iter().map(Intensity::new).collect();
    let views: Vec<FrameView<'_>> = images
        .iter()
        .zip(film.camera_from_world)
        .enumerate()
        .filter(|(frame, _)| *frame != film.reference)
        .filter_map(|(frame, (image, pose))| Some(FrameView { frame, image, from_reference: (*pose)? }))
        .collect();
    let search = RaySearch { lens: film.intrinsics, views, range };
    let reference = &images[film.reference];
    pixels.par_iter().map(|asked| measured(&search, reference, asked)).collect()
}

/// Depth of a pixel by the largest of its patches that agrees with the smallest.
fn measured(search: &RaySearch<'_>, reference: &Intensity, asked: &Asked) -> Option<RayMeasurement> {
    let mut sizes =
        PATCH_RADII_PX.iter().filter_map(|radius_px| search.patch_depth(reference, asked, *radius_px));
    let smallest = sizes.next()?;
    let is_same = |m: &RayMeasurement| (m.depth.depth / smallest.depth.depth - 1.0).abs() < SAME_SURFACE;
    let larger = sizes.rfind(is_same);
    let mut found = larger.unwrap_or(smallest);
    if let Some(step) = edge(search, reference, asked, &found.depth) {
        found.depth.sigma = found.depth.sigma.hypot(step);
        found.seen.clear();
    }
    Some(found)
}

/// Largest step of the inverse depth from a pixel to its neighbours, as a share of its own, where two of them on opposite sides show
/// an edge; `None` where the surface goes on as a plane, as far as the neighbours are known.
fn edge(search: &RaySearch<'_>, reference: &Intensity, asked: &Asked, found: &RayDepth) -> Option<f64> {
    // Inverse depth over the pixel's own, and its standard deviation.
    let neighbour = |across: Vector2<f64>| {
        let beside = Asked { pixel: asked.pixel + across, ..*asked };
        let there = search.patch_depth(reference, &beside, PATCH_RADII_PX[0])?.depth;
        let share = found.depth / there.depth;
        Some((share, share * there.sigma))
    };
    let step = |(x, y): (f64, f64)| {
        let across = NEIGHBOUR_PX * Vector2::new(x, y);
        let ((one, one_sigma), (other, other_sigma)) = (neighbour(across)?, neighbour(-across)?);
        let bend = (0.5 * (one + other) - 1.0).abs();
        let sigma = found.sigma.hypot(0.5 * one_sigma.hypot(other_sigma));
        let is_edge = bend > LEAST_EDGE.max(EDGE_SIGMAS * sigma);
        is_edge.then_some((one - 1.0).abs().max((other - 1.0).abs()))
    };
    DIRECTIONS.into_iter().filter_map(step).max_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;
    use nalgebra::Point3;

    /// A slanted, irregular wall: its depth on the axis is 3, growing to the right.
    fn depth_at(lens: &Intrinsics, pixel: &Point2<f64>) -> f64 {
        let ray = lens.unproject(pixel).unwrap();
        // x cos a − (z − 3) sin a … the plane z = 3 + x / 2.
        3.0 / (1.0 - 0.5 * ray.x)
    }

    /// Depth of the post, and where it stands in its plane.
    const POST_M: f64 = 2.0;
    const POST_X_M: std::ops::Range<f64> = 0.0..0.2;

    fn paint(x: f64, y: f64) -> u8 {
        let value = 120.0
            + 35.0 * (31.0 * x + 4.0 * y * y).sin()
            + 30.0 * (27.0 * y - 3.0 * x * x).cos()
            + 20.0 * (40.0 * x * y).sin();
        value.round().clamp(0.0, 255.0) as u8
    }

    /// Films of the wall, or of a post before a wall of finer texture.
    fn film(frames: usize, post: bool) -> (Intrinsics, Vec<RgbImage>, Vec<Option<Isometry3<f64>>>) {
        let lens = Intrinsics::from_horizontal_fov(200, 150, 60.0);
        let poses: Vec<Isometry3<f64>> = (0..frames)
            .map(|i| {
                let s = i as f64 / frames as f64;
                Isometry3::new(Vector3::new(-0.3 * s, 0.08 * s, 0.0), Vector3::new(0.0, 0.05 * s, 0.01 * s))
            })
            .collect();
        let images = poses
            .iter()
            .map(|pose| {
                let (eye, back) = (pose.inverse() * Point3::origin(), pose.rotation.inverse());
                RgbImage::from_fn(lens.width, lens.height, |u, v| {
                    let ray = back * lens.unproject(&Point2::new(f64::from(u), f64::from(v))).unwrap();
                    let at = eye + ray * ((POST_M - eye.z) / ray.z);
                    if post && POST_X_M.contains(&at.x) {
                        return Rgb([paint(2.0 * at.x, at.y) / 3; 3]);
                    }
                    let t = (3.0 + 0.5 * eye.x - eye.z) / (ray.z - 0.5 * ray.x);
                    let at = eye + ray * t;
                    let fine = if post { 2.0 } else { 1.0 };
                    Rgb([paint(fine * at.x, fine * at.y); 3])
                })
            })
            .collect();
        (lens, images, poses.into_iter().map(Some).collect())
    }

    #[test]
    fn depths_on_a_slanted_wall_are_found_to_their_own_sigma() {
        let (lens, frames, poses) = film(12, false);
        let film = PosedFilm { frames: &frames, reference: 0, intrinsics: &lens, camera_from_world: &poses };
        let pixels: Vec<Point2<f64>> = [(60.2, 40.7), (100.0, 75.0), (85.5, 110.3), (120.9, 60.1)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec();
        for normal in [None, Some(Vector3::new(0.5, 0.0, -1.0).normalize())] {
            let asked: Vec<Asked> = pixels.iter().map(|pixel| Asked { pixel: *pixel, normal }).collect();
            for (pixel, found) in pixels.iter().zip(measure(&film, &asked, (1.0, 20.0))) {
                let found = found.unwrap();
                assert!(found.seen.len() >= 4 && found.seen.iter().all(|(frame, _)| (1..12).contains(frame)));
                for (frame, seen) in &found.seen {
                    let place = Point3::from(lens.unproject(pixel).unwrap() * depth_at(&lens, pixel));
                    let there = lens.project(&(poses[*frame].unwrap() * place)).unwrap();
                    assert!((there - seen).norm() < 0.5, "{pixel} {frame}: {there} {seen}");
                }
                let found = found.depth;
                let off = found.depth / depth_at(&lens, pixel) - 1.0;
                assert!(off.abs() < 0.004 && off.abs() < 4.0 * found.sigma, "{pixel}: {off} {found:?}");
            }
        }
    }

    #[test]
    fn beside_a_post_the_wall_is_measured_or_the_step_is_told() {
        let (lens, frames, poses) = film(12, true);
        let film = PosedFilm { frames: &frames, reference: 0, intrinsics: &lens, camera_from_world: &poses };
        let side_px = |x: f64| lens.project(&Point3::new(x, 0.0, POST_M)).unwrap().x;
        let beside = |distance: f64| {
            let places = [side_px(POST_X_M.start) - distance, side_px(POST_X_M.end) + distance];
            places.into_iter().flat_map(|x| (0..8).map(move |k| Point2::new(x, 30.0 + 12.0 * f64::from(k))))
        };
        // Registered and right; wrong without a standard deviation that says so: far from the post, near it.
        let (mut right, mut wrong) = ([0, 0], [0, 0]);
        for (near, distance) in [(0, 6.0), (0, 8.0), (1, 3.0), (1, 4.0)] {
            for pixel in beside(distance) {
                let asked = [Asked { pixel, normal: Some(Vector3::new(0.5, 0.0, -1.0).normalize()) }];
                let Some(found) = measure(&film, &asked, (1.0, 20.0)).remove(0) else { continue };
                let off = (found.depth.depth / depth_at(&lens, &pixel) - 1.0).abs();
                right[near] += usize::from(off < 0.01 && !found.seen.is_empty());
                wrong[near] += usize::from(off > 0.02_f64.max(4.0 * found.depth.sigma));
            }
        }
        // Far enough for the smallest patch, nothing is wrong. Nearer, a depth between the two surfaces may look like a steep one.
        assert!(right[0] >= 12 && wrong[0] == 0, "{right:?} right, {wrong:?} wrong of 32 each");
        assert!(wrong[1] <= 6, "{right:?} right, {wrong:?} wrong of 32 each");
    }

    #[test]
    fn without_motion_texture_or_frames_there_is_no_depth() {
        let (lens, frames, poses) = film(12, false);
        let pixel = [Asked { pixel: Point2::new(100.0, 75.0), normal: None }];
        let measured = |frames: &[RgbImage], poses: &[Option<Isometry3<f64>>], range| {
            let film = PosedFilm { frames, reference: 0, intrinsics: &lens, camera_from_world: poses };
            measure(&film, &pixel, range).remove(0)
        };
        assert!(measured(&frames, &poses, (1.0, 20.0)).is_some());
        let still = vec![frames[0].clone(); 12];
        assert!(measured(&still, &vec![poses[0]; 12], (1.0, 20.0)).is_none());
        let blank = vec![RgbImage::from_pixel(200, 150, Rgb([90; 3])); 12];
        assert!(measured(&blank, &poses, (1.0, 20.0)).is_none());
        assert!(measured(&frames, &vec![None; 12], (1.0, 20.0)).is_none());
        assert!(measured(&frames, &poses, (2.0, 1.0)).is_none());
        assert!(measured(&frames, &poses, (f64::NAN, f64::NAN)).is_none());
    }
}
