//! The search for one patch in all frames: coarsely over all inverse depths, then by registration in each frame.

use calib::Intrinsics;
use calib::least_squares::Loss;
use nalgebra::{Isometry3, Matrix2, Point2, Point3, Vector2, Vector3};

use super::{Asked, RayDepth, RayMeasurement};
use crate::features::{Intensity, Patch, Warp};

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

/// A frame beside the reference frame.
pub(super) struct FrameView<'a> {
    pub(super) frame: usize,
    pub(super) image: &'a Intensity,
    pub(super) from_reference: Isometry3<f64>,
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

    /// Pixel of the patch's middle in a view for an inverse depth.
    fn seen(&self, lens: &Intrinsics, view: &FrameView<'_>, inverse_depth: f64) -> Option<Point2<f64>> {
        lens.project(&(view.from_reference * Point3::from(self.ray / inverse_depth)))
    }
}

/// The frames in which patches of the reference frame are searched, their lens, and how far away things can be.
pub(super) struct RaySearch<'a> {
    pub(super) lens: &'a Intrinsics,
    pub(super) views: Vec<FrameView<'a>>,
    /// Smallest and largest possible depth.
    pub(super) range: (f64, f64),
}

impl RaySearch<'_> {
    /// Depth of the patch of `2 radius_px + 1` pixels a side around a pixel; `None` where it has no texture, fits at several depths, or
    /// too few frames show it.
    pub(super) fn patch_depth(
        &self,
        reference: &Intensity,
        asked: &Asked,
        radius_px: i32,
    ) -> Option<RayMeasurement> {
        let place = self.place(asked)?;
        let home = Warp { center: asked.pixel, affine: Matrix2::identity() };
        let patch = Patch::cut(reference, &home, radius_px)?;
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

    /// Piece of plane that the pixel's patch shows; `None` where that is seen too flat.
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
