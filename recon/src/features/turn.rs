//! Rotation of the camera between two frames, from the whole image at low resolution: it predicts the points' positions
//! in the next frame. A hand-held camera turns by tens of pixels a frame and shifts by few.
//!
//! All shifts are tried at the coarsest scale; Gauss–Newton on the rotation `R` of the infinite homography
//! `x' ~ K R K⁻¹ x` refines it.

use calib::Intrinsics;
use nalgebra::{Matrix3, Point2, Point3, UnitQuaternion, Vector3};

use super::intensity::Intensity;

/// Least width of the coarsest image, at which all shifts are tried; halving 640 px ends at 80.
const COARSE_WIDTH_PX: usize = 48;
/// Largest shift tried, as a fraction of the image.
const LARGEST_SHIFT: f64 = 0.4;
/// Number of scales, each twice the one before, on which the rotation is refined.
const REFINED_SCALES: usize = 2;
const STEPS: usize = 12;
/// Residual, in standard deviations, from which on a pixel's weight falls: parallax and moving things.
const HUBER: f64 = 0.7;

/// An image at the coarse scales, the coarsest first, with their pinhole cameras.
pub(crate) struct CoarseScales(Vec<(Intensity, Intrinsics)>);

impl CoarseScales {
    pub(crate) fn new(image: &Intensity, intrinsics: &Intrinsics) -> Self {
        let mut scales = Vec::new();
        let mut scale = image.clone();
        while scale.width >= 2 * COARSE_WIDTH_PX {
            scale = scale.halved();
            if scale.width < COARSE_WIDTH_PX << REFINED_SCALES {
                scales.push(scale.smoothed(1.0));
            }
        }
        if scales.is_empty() {
            scales.push(image.clone());
        }
        scales.reverse();
        let sized = scales.into_iter().map(|s| {
            let camera = intrinsics.without_distortion().resized(s.width as u32, s.height as u32);
            (s, camera)
        });
        Self(sized.collect())
    }

    /// Rotation `to_from_from` that best maps this image onto `to`.
    pub(crate) fn turn_to(&self, to: &Self) -> UnitQuaternion<f64> {
        let (Some(first), Some(second)) = (self.0.first(), to.0.first()) else {
            return UnitQuaternion::identity();
        };
        let (dx, dy) = best_shift(&first.0, &second.0);
        let camera = &first.1;
        // A point that moves right by dx is turned by dx / fx about y; down by dy: by −dy / fy about x.
        let mut rotation = UnitQuaternion::from_scaled_axis(Vector3::new(
            -(dy as f64 / camera.fy).atan(),
            (dx as f64 / camera.fx).atan(),
            0.0,
        ));
        for ((from, camera), (to, _)) in self.0.iter().zip(&to.0) {
            rotation = refine(from, to, camera, rotation);
        }
        rotation
    }
}

/// Position of a pixel after a rotation of the camera; `None` behind the camera.
pub(crate) fn moved(
    pixel: &Point2<f64>,
    intrinsics: &Intrinsics,
    rotation: &UnitQuaternion<f64>,
) -> Option<Point2<f64>> {
    intrinsics.project(&Point3::from(rotation * intrinsics.unproject(pixel)?))
}

/// Whole-pixel shift with the highest correlation over the overlap.
fn best_shift(from: &Intensity, to: &Intensity) -> (i32, i32) {
    let (width, height) = (from.width as i32, from.height as i32);
    let (reach_x, reach_y) = ((LARGEST_SHIFT * width as f64) as i32, (LARGEST_SHIFT * height as f64) as i32);
    let mut best = (f64::NEG_INFINITY, (0, 0));
    for dy in -reach_y..=reach_y {
        for dx in -reach_x..=reach_x {
            let (mut n, mut sa, mut sb, mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
            for y in 0.max(-dy)..height.min(height - dy) {
                for x in 0.max(-dx)..width.min(width - dx) {
                    let a = f64::from(from.pixel(x as usize, y as usize));
                    let b = f64::from(to.pixel((x + dx) as usize, (y + dy) as usize));
                    n += 1.0;
                    sa += a;
                    sb += b;
                    saa += a * a;
                    sbb += b * b;
                    sab += a * b;
                }
            }
            let variance = (saa - sa * sa / n) * (sbb - sb * sb / n);
            let correlation = if variance > 1e-6 { (sab - sa * sb / n) / variance.sqrt() } else { -1.0 };
            // A slight preference for no motion decides between equals on blank images.
            let score = correlation - 1e-4 * f64::from(dx.abs() + dy.abs());
            if score > best.0 {
                best = (score, (dx, dy));
            }
        }
    }
    best.1
}

/// Gauss–Newton on the rotation, brightness normalised over the overlap, Huber weights.
fn refine(
    from: &Intensity,
    to: &Intensity,
    camera: &Intrinsics,
    start: UnitQuaternion<f64>,
) -> UnitQuaternion<f64> {
    let mut rotation = start;
    let rays: Vec<Vector3<f64>> = (0..from.width * from.height)
        .map(|i| {
            let (x, y) = ((i % from.width) as f64, (i / from.width) as f64);
            Vector3::new((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1.0)
        })
        .collect();
    for _ in 0..STEPS {
        let mut samples = Vec::with_capacity(rays.len());
        for (index, ray) in rays.iter().enumerate() {
            let p = rotation * ray;
            if p.z <= 0.1 {
                continue;
            }
            let (x, y) = (camera.fx * p.x / p.z + camera.cx, camera.fy * p.y / p.z + camera.cy);
            if !(to.holds(x - 1.0, y - 1.0) && to.holds(x + 1.0, y + 1.0)) {
                continue;
            }
            let here = f64::from(from.pixel(index % from.width, index / from.width));
            let gradient_x = 0.5 * f64::from(to.at(x + 1.0, y) - to.at(x - 1.0, y));
            let gradient_y = 0.5 * f64::from(to.at(x, y + 1.0) - to.at(x, y - 1.0));
            // d pixel / d ω for p ← exp(ω) p is projection-Jacobian · −[p]×; contracted with the gradient first.
            let (gx, gy) = (gradient_x * camera.fx / p.z, gradient_y * camera.fy / p.z);
            let g = Vector3::new(gx, gy, -(gx * p.x + gy * p.y) / p.z);
            samples.push((here, f64::from(to.at(x, y)), p.cross(&g)));
        }
        if samples.len() < rays.len() / 4 {
            return start;
        }
        let n = samples.len() as f64;
        let normal = |pick: fn(&(f64, f64, Vector3<f64>)) -> f64| {
            let mean = samples.iter().map(pick).sum::<f64>() / n;
            let deviation = (samples.iter().map(|s| (pick(s) - mean).powi(2)).sum::<f64>() / n).sqrt();
            (mean, deviation.max(1.0))
        };
        let ((mean_a, dev_a), (mean_b, dev_b)) = (normal(|s| s.0), normal(|s| s.1));
        let (mut hessian, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (a, b, j) in &samples {
            let residual = (b - mean_b) / dev_b - (a - mean_a) / dev_a;
            let weight = if residual.abs() <= HUBER { 1.0 } else { HUBER / residual.abs() };
            let j = j / dev_b;
            hessian += weight * j * j.transpose();
            right -= weight * residual * j;
        }
        let Some(step) = hessian.cholesky().map(|c| c.solve(&right)) else { return rotation };
        rotation = UnitQuaternion::from_scaled_axis(step) * rotation;
        if step.norm() * camera.fx < 0.02 {
            break;
        }
    }
    rotation
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_turn_is_found_to_a_few_pixels() {
        let camera = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        let truth = UnitQuaternion::from_scaled_axis(Vector3::new(-0.08, 0.2, 0.05));
        let scene = |ray: Vector3<f64>| {
            let (a, b) = (ray.x / ray.z, ray.y / ray.z);
            (128.0
                + 60.0 * ((7.0 * a + 2.0 * b).sin() + (9.0 * b - 3.0 * a * a).cos())
                + 20.0 * (31.0 * a).sin()) as f32
        };
        let seen = |rotation: &UnitQuaternion<f64>| {
            Intensity::from_fn(320, 240, |x, y| {
                let ray = camera.unproject(&Point2::new(x as f64, y as f64)).unwrap();
                scene(rotation.inverse() * ray)
            })
        };
        let scales = [UnitQuaternion::identity(), truth].map(|r| CoarseScales::new(&seen(&r), &camera));
        let found = scales[0].turn_to(&scales[1]);
        for (x, y) in [(60.0, 200.0), (160.0, 120.0), (100.0, 150.0)] {
            let pixel = Point2::new(x, y);
            let off = moved(&pixel, &camera, &found).unwrap() - moved(&pixel, &camera, &truth).unwrap();
            assert!(off.norm() < 3.0, "{off}");
        }
    }

    #[test]
    fn blank_images_do_not_turn() {
        let camera = Intrinsics::from_horizontal_fov(320, 240, 60.0);
        let blank = CoarseScales::new(&Intensity::from_fn(320, 240, |_, _| 7.0), &camera);
        assert!(blank.turn_to(&blank).angle() < 1e-6);
    }
}
