//! Resection: the pose of a camera from known points and their pixels; its lens, too, where that is unknown.
//!
//! Closed forms give starting poses, least squares on the reprojection error refine each, and the least error
//! decides. The closed form is not chosen from the points beforehand: four corners of a table measured by hand lie
//! neither on one plane nor well in space, and a plane seen from afar has two poses with nearly the same image.
//! [`resect_by_consensus`] tells wrong picks and mirrored worlds besides.
//!
//! | start | points | source |
//! |---|---|---|
//! | 3 × 4 projection | 6 or more in space | direct linear transform, Hartley & Zisserman, *Multiple View Geometry*, 2nd ed., algorithm 7.1 |
//! | homography | 4 or more on a plane, or nearly | the same, algorithm 4.2 |
//! | the homography's mirror image | the same | Schweighofer & Pinz, PAMI 2006 |
//! | three points at a time | 4 or 5 | Grunert's solution, as in Haralick et al., IJCV 1994 |

mod consensus;
mod lens;
mod linear;
mod refine;
#[cfg(test)]
mod tests;
mod three_points;

use nalgebra::{Isometry3, Matrix3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector2};

use crate::least_squares::{Loss, Options};
use crate::{Camera, Error, Intrinsics, Result};
use linear::PrincipalFrame;

pub use consensus::{Consensus, mirrored_world, refuse_mirrored_world, resect_by_consensus, wrong_from_px};
pub use lens::{LensResection, resect_with_lens};
pub use refine::refine_pose;
#[cfg(feature = "vision")]
pub(crate) use three_points::solve as poses_of_three_points;

/// Standard deviation of picks by hand.
const PICK_SIGMA_PX: f64 = 0.5;
/// Ratio of two residuals below which the two poses cannot be told apart.
const ALTERNATIVE_FACTOR: f64 = 2.0;
/// Angle below which two refined poses count as the same.
const SAME_POSE_DEG: f64 = 1.0;
/// Least number of points for which a direct linear transform gives the pose in space.
const LEAST_FOR_SPACE: usize = 6;

/// A point with known world coordinates, and its pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pick {
    /// World coordinates, metres.
    pub world: Point3<f64>,
    /// Pixel in the (distorted) image.
    pub pixel: Point2<f64>,
}

/// A camera's pose and its residuals on the picks.
#[derive(Debug, Clone)]
pub struct Resection {
    /// The camera at its pose.
    pub camera: Camera,
    /// Distance between each pick and its point's projection, pixels.
    pub residuals_px: Vec<f64>,
    /// Another pose that explains the picks almost as well, if there is one: more picks are needed to decide.
    pub alternative: Option<AlternativePose>,
}

/// A pose whose residual is almost as small as that of the chosen one.
#[derive(Debug, Clone)]
pub struct AlternativePose {
    /// The camera at that pose.
    pub camera: Camera,
    /// Root mean square residual, pixels.
    pub rms_px: f64,
}

impl Resection {
    /// Root mean square residual, pixels.
    pub fn rms_px(&self) -> f64 {
        rms(&self.residuals_px)
    }
}

/// Estimates the pose of a camera with known lens, from 4 or more points.
///
/// # Errors
/// [`Error::Degenerate`] for too few points, points on a line, a number that is not finite, a pixel that the lens
/// model has no ray for, or points that no pose puts in front of the camera.
pub fn resect(intrinsics: &Intrinsics, picks: &[Pick]) -> Result<Resection> {
    refuse_not_finite(picks)?;
    let rays: Vec<Vector2<f64>> = picks
        .iter()
        .enumerate()
        .map(|(i, pick)| {
            let ray = intrinsics.unproject(&pick.pixel);
            ray.map(|r| r.xy()).ok_or_else(|| {
                Error::Degenerate(format!("pick {}: the lens model has no ray for this pixel", i + 1))
            })
        })
        .collect::<Result<_>>()?;
    if picks.len() < 4 {
        return Err(Error::Degenerate(format!("{} points; at least 4 are needed", picks.len())));
    }
    let frame = PrincipalFrame::of(picks)?;
    let mut fits: Vec<(Camera, Vec<f64>)> = starts(&frame, picks, &rays)
        .into_iter()
        .filter_map(|start| {
            let pose = refine_pose(intrinsics, picks, &start, Loss::Squares, &Options::default());
            let camera = Camera { intrinsics: intrinsics.clone(), camera_from_world: pose };
            let residuals = residuals_px(&camera, picks)?;
            Some((camera, residuals))
        })
        .collect();
    fits.sort_by(|a, b| rms(&a.1).total_cmp(&rms(&b.1)));
    let mut fits = fits.into_iter();
    let Some((camera, residuals_px)) = fits.next() else {
        return Err(Error::Degenerate(
            "no pose puts all points in front of the camera; check the picks' coordinates".into(),
        ));
    };
    let indistinct = ALTERNATIVE_FACTOR * rms(&residuals_px).max(PICK_SIGMA_PX);
    let alternative = fits
        .map(|(camera, residuals)| AlternativePose { camera, rms_px: rms(&residuals) })
        .take_while(|other| other.rms_px <= indistinct)
        .find(|other| {
            let [a, b] = [&camera, &other.camera].map(|c| c.camera_from_world.rotation);
            crate::rotation::angle_between_deg(&a, &b) > SAME_POSE_DEG
        });
    Ok(Resection { camera, residuals_px, alternative })
}

/// Poses proposed by all closed forms.
fn starts(frame: &PrincipalFrame, picks: &[Pick], rays: &[Vector2<f64>]) -> Vec<Isometry3<f64>> {
    let mut starts = Vec::new();
    if picks.len() >= LEAST_FOR_SPACE {
        starts.extend(linear::from_space(frame, picks, rays));
    } else {
        starts.extend(three_points::from_triples(picks, rays));
    }
    if let Some(upright) = linear::from_plane(frame, picks, rays) {
        starts.extend([upright, mirrored(frame, &upright)]);
    }
    starts.retain(|pose| pose.to_homogeneous().iter().all(|v| v.is_finite()));
    starts
}

/// Mirror image of a pose, in which the picks' plane leans the other way: seen from afar it looks the same, since
/// depths are mirrored about the plane through the centroid that faces the camera.
fn mirrored(frame: &PrincipalFrame, pose: &Isometry3<f64>) -> Isometry3<f64> {
    let camera_from_principal = pose * frame.principal_from_world.inverse();
    let centroid = camera_from_principal.translation.vector;
    let sight = centroid.normalize();
    let mirror = Matrix3::identity() - 2.0 * sight * sight.transpose();
    let other_side = Matrix3::from_diagonal(&[1.0, 1.0, -1.0].into());
    let rotation = mirror * camera_from_principal.rotation.to_rotation_matrix().matrix() * other_side;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Isometry3::from_parts(Translation3::from(centroid), rotation) * frame.principal_from_world
}

fn refuse_not_finite(picks: &[Pick]) -> Result<()> {
    let finite = |p: &Pick| p.world.coords.iter().chain(p.pixel.coords.iter()).all(|v| v.is_finite());
    match picks.iter().position(|p| !finite(p)) {
        Some(bad) => Err(Error::Degenerate(format!("pick {} is not finite", bad + 1))),
        None => Ok(()),
    }
}

/// Distance of each pick to its point's projection, pixels; `None` when a point comes out behind the camera.
fn residuals_px(camera: &Camera, picks: &[Pick]) -> Option<Vec<f64>> {
    picks.iter().map(|pick| Some((camera.project(&pick.world)? - pick.pixel).norm())).collect()
}

fn rms(residuals: &[f64]) -> f64 {
    (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64).sqrt()
}
