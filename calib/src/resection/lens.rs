//! Resection of a camera with unknown lens: the direct linear transform's 3 × 4 matrix holds the lens as well as the
//! pose. They are separated by the dual image of the absolute conic, ω* = K Kᵀ (R. Hartley & A. Zisserman, *Multiple
//! View Geometry*, 2nd ed., sections 6.2.4 and 8.5), then refined together. The lens has no distortion.

use nalgebra::{Cholesky, Matrix3, SMatrix, Vector2};

use super::linear::{PrincipalFrame, projection};
use super::{LEAST_FOR_SPACE, PICK_SIGMA_PX, Pick, Resection, refine, refuse_not_finite, residuals_px};
use crate::{Camera, Distortion, Error, Intrinsics, Result};

/// Largest relative standard deviation of a focal length that is accepted: the camera's distance is uncertain by the
/// same share.
const LARGEST_FOCAL_SIGMA: f64 = 0.2;

/// A camera's pose and lens, and the uncertainty of the lens.
#[derive(Debug, Clone)]
pub struct LensResection {
    /// The camera, its pose, and how well they explain the picks.
    pub resection: Resection,
    /// Standard deviations of fx, fy, cx, cy, pixels, for picks with errors of half a pixel or of their residuals,
    /// whichever is larger.
    pub sigma_px: [f64; 4],
}

/// Estimates pose, focal lengths and principal point of a camera without distortion from 6 or more points in space.
///
/// `size` is the image's width and height, pixels.
///
/// # Errors
/// [`Error::Degenerate`] for fewer points, points on a line, on a plane or so near one that they do not determine the
/// focal length, a number that is not finite, or points that come out behind the camera; [`Error::Invalid`] for an
/// empty image.
pub fn resect_with_lens((width, height): (u32, u32), picks: &[Pick]) -> Result<LensResection> {
    refuse_not_finite(picks)?;
    if picks.len() < LEAST_FOR_SPACE {
        return Err(Error::Degenerate(format!(
            "{} points; without a lens at least {LEAST_FOR_SPACE} in space are needed",
            picks.len()
        )));
    }
    let frame = PrincipalFrame::of(picks)?;
    let start = linear_camera((width, height), &frame, picks).ok_or_else(untold)?;
    start.intrinsics.validate()?;
    let (camera, hessian) = refine::refine_camera(picks, start);
    let residuals_px = residuals_px(&camera, picks).ok_or_else(untold)?;
    let squares: f64 = residuals_px.iter().map(|r| r * r).sum();
    let beyond_need = (2 * picks.len() - 10) as f64;
    let variance = (squares / beyond_need).max(PICK_SIGMA_PX * PICK_SIGMA_PX);
    let sigma_px = deviations(&hessian, variance).ok_or_else(untold)?;
    let k = &camera.intrinsics;
    if sigma_px[0] > LARGEST_FOCAL_SIGMA * k.fx || sigma_px[1] > LARGEST_FOCAL_SIGMA * k.fy {
        return Err(untold());
    }
    Ok(LensResection { resection: Resection { camera, residuals_px, alternative: None }, sigma_px })
}

fn untold() -> Error {
    Error::Degenerate(
        "the points do not tell the focal length, as when they lie near one plane; pick some at other depths and \
         heights, or give the lens (`calib intrinsics`)"
            .into(),
    )
}

fn linear_camera((width, height): (u32, u32), frame: &PrincipalFrame, picks: &[Pick]) -> Option<Camera> {
    // Pixels centred and scaled to unit size, as in algorithm 7.1.
    let middle = picks.iter().map(|p| p.pixel.coords).sum::<Vector2<f64>>() / picks.len() as f64;
    let squares: f64 = picks.iter().map(|p| (p.pixel.coords - middle).norm_squared()).sum();
    let unit = (squares / picks.len() as f64).sqrt();
    if unit <= f64::EPSILON {
        return None;
    }
    let normalised: Vec<Vector2<f64>> = picks.iter().map(|p| (p.pixel.coords - middle) / unit).collect();
    let p = projection(frame, picks, &normalised)?;
    let scale = p.fixed_view::<1, 3>(2, 0).norm();
    let p = p / scale;
    let left = p.fixed_columns::<3>(0).into_owned();
    let conic = left * left.transpose();
    let (cx, cy) = (conic[(0, 2)], conic[(1, 2)]);
    let fy = (conic[(1, 1)] - cy * cy).sqrt();
    let skew = (conic[(0, 1)] - cx * cy) / fy;
    let fx = (conic[(0, 0)] - cx * cx - skew * skew).sqrt();
    let lens = Matrix3::new(fx, skew, cx, 0.0, fy, cy, 0.0, 0.0, 1.0).try_inverse()?;
    let camera_from_world = frame.pose(&(lens * left), lens * p.column(3));
    if !camera_from_world.to_homogeneous().iter().all(|v| v.is_finite()) {
        return None;
    }
    let [fx, fy] = [fx, fy].map(|f| f * unit);
    let principal = middle + Vector2::new(cx, cy) * unit;
    let intrinsics =
        Intrinsics { width, height, fx, fy, cx: principal.x, cy: principal.y, distortion: Distortion::NONE };
    Some(Camera { intrinsics, camera_from_world })
}

/// Standard deviations of the last four parameters, those of the lens.
fn deviations(hessian: &SMatrix<f64, 10, 10>, variance: f64) -> Option<[f64; 4]> {
    // Pixels, radians and metres differ by orders of magnitude: scaled to a unit diagonal first.
    let scale = hessian.diagonal().map(|d| 1.0 / d.sqrt());
    let scaled = SMatrix::<f64, 10, 10>::from_fn(|r, c| hessian[(r, c)] * scale[r] * scale[c]);
    let inverse = Cholesky::new(scaled)?.inverse();
    let sigma = [6, 7, 8, 9].map(|i| (variance * inverse[(i, i)]).sqrt() * scale[i]);
    sigma.iter().all(|s| s.is_finite()).then_some(sigma)
}
