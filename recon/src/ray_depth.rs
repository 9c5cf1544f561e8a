//! Depth of single pixels of the reference image, from all frames of the capture.
//!
//! Dense stereo smooths over its supports and matches a few key frames. For a picked pixel more effort is spent: its
//! patch is searched in every frame along the epipolar line (all inverse depths, multiple-baseline stereo after M.
//! Okutomi and T. Kanade, "A multiple-baseline stereo", PAMI 1993), registered there to a fraction of a pixel, and the
//! inverse depth that explains all registrations is estimated robustly, with its standard deviation.

use calib::Intrinsics;
use calib::least_squares::Loss;
use image::RgbImage;
use nalgebra::{Isometry3, Matrix2, Point2, Point3, Vector2, Vector3};
use rayon::prelude::*;

use crate::features::{Intensity, Patch, Warp};

/// Half the side of a pixel's patch.
const PATCH_RADIUS_PX: i32 = 10;
/// Largest number of steps of inverse depth that are searched.
const MOST_STEPS: usize = 400;
/// Least mean correlation of the better half of the frames at the best inverse depth.
const LEAST_SCORE: f32 = 0.6;
/// Least difference in score between the best inverse depth and any that is not its neighbour.
const LEAST_LEAD: f32 = 0.03;
/// Number of steps that count as neighbours.
const NEIGHBOURS: usize = 5;
/// Registrations: least correlation, and largest distance from the prediction, pixels.
const LEAST_CORRELATION: f64 = 0.7;
const LARGEST_MISS_PX: f64 = 3.0;
/// Least cosine between normal and ray: flatter surfaces are not measured.
const FLATTEST: f64 = 0.1;
/// Least number of frames that must agree.
const LEAST_FRAMES: usize = 4;
/// Standard deviation of registration, pixels: residuals may look smaller by chance.
const NOISE_PX: f64 = 0.25;
/// Largest relative standard deviation of a measurement.
const LARGEST_SIGMA: f64 = 0.05;

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
    /// Measured depth.
    pub depth: RayDepth,
    /// Frames in which the pixel's patch was registered, and its pixel (as filmed) there; without the reference frame.
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
    pixels.par_iter().map(|asked| search.depth(reference, asked)).collect()
}

struct FrameView<'a> {
    frame: usize,
    image: &'a Intensity,
    from_reference: Isometry3<f64>,
}

/// A pixel's patch as a piece of plane: the rays of its centre and of its neighbours, scaled to meet that plane when
/// the centre's depth is 1.
struct PixelPatch {
    ray: Vector3<f64>,
    right: Vector3<f64>,
    below: Vector3<f64>,
}

impl PixelPatch {
    /// Predicted position of the patch in a view for an inverse depth of its pixel.
    fn predicted(&self, lens: &Intrinsics, view: &FrameView<'_>, inverse_depth: f64) -> Option<Warp> {
        let carried =
            |ray: &Vector3<f64>| lens.project(&(view.from_reference * Point3::from(ray / inverse_depth)));
        let center = carried(&self.ray)?;
        let columns = [carried(&self.right)? - center, carried(&self.below)? - center];
        Some(Warp { center, affine: Matrix2::from_columns(&columns) })
    }

    fn seen(&self, lens: &Intrinsics, view: &FrameView<'_>, inverse_depth: f64) -> Option<Point2<f64>> {
        lens.project(&(view.from_reference * Point3::from(self.ray / inverse_depth)))
    }
}

struct RaySearch<'a> {
    lens: &'a Intrinsics,
    views: Vec<FrameView<'a>>,
    range: (f64, f64),
}

impl RaySearch<'_> {
    fn depth(&self, reference: &Intensity, asked: &Asked) -> Option<RayMeasurement> {
        let place = self.place(asked)?;
        let home = Warp { center: asked.pixel, affine: Matrix2::identity() };
        let patch = Patch::cut(reference, &home, PATCH_RADIUS_PX)?;
        let start = self.best_inverse_depth(&patch, &place)?;
        let seen: Vec<(&FrameView<'_>, Point2<f64>)> = self
            .views
            .iter()
            .filter_map(|view| {
                let warp = place.predicted(self.lens, view, start)?;
                let found = patch.register(view.image, &warp)?;
                let near = (found.warp.center - warp.center).norm() <= LARGEST_MISS_PX;
                (near && found.correlation >= LEAST_CORRELATION).then_some((view, found.warp.center))
            })
            .collect();
        let depth = self.refined(&place, &seen, start)?;
        let seen = seen.into_iter().map(|(view, pixel)| (view.frame, pixel)).collect();
        Some(RayMeasurement { depth, seen })
    }

    fn place(&self, asked: &Asked) -> Option<PixelPatch> {
        let ray = self.lens.unproject(&asked.pixel)?;
        let normal = asked.normal.unwrap_or(-ray);
        let facing = normal.dot(&ray);
        // Intersection of a neighbour's ray with the plane through the point at depth 1.
        let beside = |aside: Vector2<f64>| {
            let other = self.lens.unproject(&(asked.pixel + aside))?;
            Some(other * (facing / normal.dot(&other)))
        };
        let flat = facing.abs() < FLATTEST * normal.norm() * ray.norm();
        (!flat).then_some(PixelPatch { ray, right: beside(Vector2::x())?, below: beside(Vector2::y())? })
    }

    /// Inverse depth with the highest score; `None` if another one comes near it.
    fn best_inverse_depth(&self, patch: &Patch, place: &PixelPatch) -> Option<f64> {
        let (near, far) = (1.0 / self.range.0, 1.0 / self.range.1);
        let steps = self.steps(place);
        let at = |step: usize| far + (near - far) * step as f64 / steps as f64;
        let scores: Vec<f32> = (0..=steps).map(|step| self.score(patch, place, at(step))).collect();
        let (best, highest) = scores.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        let rivalled = scores
            .iter()
            .enumerate()
            .any(|(step, score)| step.abs_diff(best) > NEIGHBOURS && *score > highest - LEAST_LEAD);
        (*highest >= LEAST_SCORE && !rivalled).then(|| at(best))
    }

    /// Number of steps: the pixels of the longest epipolar segment among the views.
    fn steps(&self, place: &PixelPatch) -> usize {
        let longest = self
            .views
            .iter()
            .filter_map(|view| {
                let ends = [1.0 / self.range.1, 1.0 / self.range.0].map(|w| place.seen(self.lens, view, w));
                Some((ends[0]? - ends[1]?).norm())
            })
            .fold(0.0, f64::max);
        (longest.ceil() as usize).clamp(8, MOST_STEPS)
    }

    /// Mean correlation over the better half of the views in which the patch is visible.
    fn score(&self, patch: &Patch, place: &PixelPatch, inverse_depth: f64) -> f32 {
        let mut seen: Vec<f32> = self
            .views
            .iter()
            .filter_map(|view| {
                let warp = place.predicted(self.lens, view, inverse_depth)?;
                patch.probe(&warp.affine).correlation(view.image, &warp.center)
            })
            .collect();
        if seen.len() < LEAST_FRAMES {
            return 0.0;
        }
        seen.sort_by(|a, b| b.total_cmp(a));
        let half = seen.len().div_ceil(2).max(LEAST_FRAMES);
        seen[..half].iter().sum::<f32>() / half as f32
    }

    /// Gauss–Newton on the logarithm of the inverse depth, Cauchy weights.
    fn refined(
        &self,
        place: &PixelPatch,
        seen: &[(&FrameView<'_>, Point2<f64>)],
        start: f64,
    ) -> Option<RayDepth> {
        const ROUNDS: usize = 20;
        const STEP: f64 = 1e-4;
        let loss = Loss::Cauchy(3.0 * NOISE_PX);
        let mut inverse_depth = start;
        let (mut information, mut squares, mut weights) = (0.0, 0.0, 0.0);
        for _ in 0..ROUNDS {
            (information, squares, weights) = (0.0, 0.0, 0.0);
            let mut gradient = 0.0;
            for (view, found) in seen {
                let at = |factor: f64| place.seen(self.lens, view, inverse_depth * factor);
                let (Some(here), Some(more), Some(less)) = (at(1.0), at(STEP.exp()), at((-STEP).exp()))
                else {
                    continue;
                };
                let slope = (more - less) / (2.0 * STEP);
                let off = here - found;
                let weight = loss.weight(off.norm_squared());
                information += weight * slope.norm_squared();
                gradient += weight * slope.dot(&off);
                squares += weight * off.norm_squared();
                weights += weight;
            }
            if weights < (LEAST_FRAMES as f64).max(0.5 * seen.len() as f64) || information <= 0.0 {
                return None;
            }
            let step = (-gradient / information).clamp(-0.2, 0.2);
            inverse_depth *= step.exp();
            if step.abs() < 1e-7 {
                break;
            }
        }
        // Each observation has two coordinates.
        let noise = (squares / (2.0 * weights)).sqrt().max(NOISE_PX);
        let sigma = noise / information.sqrt();
        (sigma <= LARGEST_SIGMA).then_some(RayDepth { depth: 1.0 / inverse_depth, sigma })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    /// A slanted, irregular wall: its depth on the axis is 3, growing to the right.
    fn depth_at(lens: &Intrinsics, pixel: &Point2<f64>) -> f64 {
        let ray = lens.unproject(pixel).unwrap();
        // x cos a − (z − 3) sin a … the plane z = 3 + x / 2.
        3.0 / (1.0 - 0.5 * ray.x)
    }

    fn paint(x: f64, y: f64) -> u8 {
        let value = 120.0
            + 35.0 * (31.0 * x + 4.0 * y * y).sin()
            + 30.0 * (27.0 * y - 3.0 * x * x).cos()
            + 20.0 * (40.0 * x * y).sin();
        value.round().clamp(0.0, 255.0) as u8
    }

    fn film(frames: usize) -> (Intrinsics, Vec<RgbImage>, Vec<Option<Isometry3<f64>>>) {
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
                    let t = (3.0 + 0.5 * eye.x - eye.z) / (ray.z - 0.5 * ray.x);
                    let at = eye + ray * t;
                    Rgb([paint(at.x, at.y); 3])
                })
            })
            .collect();
        (lens, images, poses.into_iter().map(Some).collect())
    }

    #[test]
    fn depths_on_a_slanted_wall_are_found_to_their_own_sigma() {
        let (lens, frames, poses) = film(12);
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
    fn without_motion_texture_or_frames_there_is_no_depth() {
        let (lens, frames, poses) = film(12);
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
