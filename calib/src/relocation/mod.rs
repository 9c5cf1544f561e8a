//! Relocation: the pose of a camera from one picture and pictures of the same scene taken at known poses.
//!
//! ```text
//! reference pictures ── keypoints ── depth of the scene ──> landmarks
//!                                                              │ descriptors
//! new picture ───────── keypoints ─────────────────────> sightings ── consensus ── adjustment ──> pose, covariance
//! ```
//!
//! * [`Landmarks`] — keypoints of a reference picture, lifted to 3-D by the scene's depth.
//! * [`relocate`] — matches them with the keypoints of a new picture, finds the pose that most matches agree on
//!   (three points at a time, M. Fischler & R. Bolles, CACM 24, 1981), searches further matches near their predicted
//!   pixels, and adjusts the pose.
//! * [`recognise`], [`refined`] — the same without the judgement, and the adjustment to sightings that are more precise.
//! * [`Relocation`] — pose and standard deviations; [`Doubt`] — the reason for which there is none.
//!
//! The depth of a landmark is uncertain, far more so at the edges of things. Its uncertainty is propagated into the
//! new picture, so that a landmark whose depth is unknown still tells the camera's turn. Neighbouring landmarks share
//! the errors of one surface: the covariance takes each cell of a grid over the reference picture as one observation.

mod adjustment;
mod consensus;
mod sighting;
#[cfg(test)]
mod tests;

use std::fmt;

use image::GrayImage;
use nalgebra::{Isometry3, Point2, Point3, Vector3};

use crate::vision::Keypoints;
use crate::{Camera, Intrinsics, Result};
pub use sighting::Sighting;

/// Least contrast of a keypoint; half of Lowe's, for plain walls.
const CONTRAST: f64 = 0.02;
/// Most keypoints of a picture.
const MOST_KEYPOINTS: usize = 2500;
/// Ratio of the distances to the nearest and second nearest descriptor of a match.
const RATIO: f32 = 0.85;
/// The same within [`NEAR_PX`] of a landmark's predicted pixel, where few keypoints compete.
const NEAR_RATIO: f32 = 0.9;
/// Distance from a landmark's predicted pixel within which a further match is searched, pixels.
const NEAR_PX: f64 = 6.0;
/// Standard deviation of a keypoint's pixel, of both pictures together.
const KEYPOINT_SIGMA_PX: f64 = 0.7;
/// Columns and rows of the grid over a reference picture, each cell of which is one observation.
const GRID: [u32; 2] = [6, 5];
/// Fewest matches that must agree on the pose. Pictures of other rooms reach about half as many by chance.
const LEAST_AGREEING: usize = 20;
/// Fewest cells of the grid that must hold an agreeing match: more than a pose has unknowns.
const LEAST_CELLS: usize = 8;
/// Largest standard deviation of the camera's position, metres, so that two of them are 3 cm, …
const MOST_SIGMA_M: f64 = 0.015;
/// … or, where everything is far away, as a share of the landmarks' median distance.
const MOST_SIGMA_SHARE: f64 = 0.005;
/// Largest standard deviation of the camera's orientation, degrees: two of them are the turn that makes a camera another.
const MOST_SIGMA_DEG: f64 = 0.15;

/// Depth of the scene along a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneDepth {
    /// Depth along the camera's z, metres.
    pub z_m: f64,
    /// Its standard deviation, metres.
    pub sigma_m: f64,
}

/// Keypoints of a picture that was taken at a known pose, and the scene's points behind them.
#[derive(Debug, Clone)]
pub struct Landmarks {
    keypoints: Keypoints,
    places: Vec<Landmark>,
}

/// A point of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Landmark {
    world: Point3<f64>,
    /// Displacement of the point by one standard deviation of its depth.
    depth_step: Vector3<f64>,
    /// Cell of the reference picture's grid.
    cell: u32,
}

impl Landmarks {
    /// Landmarks of a picture of `camera`, whose intrinsics are those of the picture's size. `depth` has the scene's
    /// depth along a ray of the camera, whose z is 1; keypoints without depth are left out.
    ///
    /// # Errors
    /// [`crate::Error::OpenCv`].
    pub fn of(
        picture: &GrayImage,
        camera: &Camera,
        depth: impl Fn(&Vector3<f64>) -> Option<SceneDepth>,
    ) -> Result<Self> {
        let keypoints = Keypoints::find(picture, MOST_KEYPOINTS, CONTRAST)?;
        let world_from_camera = camera.camera_from_world.inverse();
        let (mut kept, mut places) = (Vec::new(), Vec::new());
        for (index, pixel) in keypoints.pixels.iter().enumerate() {
            let Some(ray) = camera.intrinsics.unproject(pixel) else { continue };
            let Some(SceneDepth { z_m, sigma_m }) = depth(&ray) else { continue };
            kept.push(index);
            places.push(Landmark {
                world: world_from_camera * Point3::from(ray * z_m),
                depth_step: world_from_camera * (ray * sigma_m),
                cell: cell(pixel, picture.dimensions()),
            });
        }
        Ok(Self { keypoints: keypoints.chosen(&kept), places })
    }

    /// Number of landmarks.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Tells whether there is no landmark.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }
}

/// A camera's pose from one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Relocation {
    /// The pose, `X_camera = camera_from_world · X_world`.
    pub camera_from_world: Isometry3<f64>,
    /// Standard deviation of the camera's position, metres: the root of the sum of the three variances.
    pub sigma_m: f64,
    /// Standard deviation of the camera's orientation, degrees: the root of the sum of the three variances.
    pub sigma_deg: f64,
    /// Number of landmarks that were recognised by their descriptors.
    pub matches: usize,
    /// Number of matches that agree with the pose.
    pub agreeing: usize,
    /// Root mean square residual of the agreeing matches, pixels.
    pub rms_px: f64,
}

/// Reason for which a picture tells no pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Doubt {
    /// Too few matches agree on one pose.
    Unrecognised {
        /// Number of matches that agree.
        agreeing: usize,
        /// Number of matches.
        matches: usize,
    },
    /// The matches that agree lie in too small a part of the picture.
    Crowded {
        /// Number of matches that agree.
        agreeing: usize,
    },
    /// The pose is too uncertain.
    Uncertain {
        /// Standard deviation of the position, metres.
        sigma_m: f64,
        /// Standard deviation of the orientation, degrees.
        sigma_deg: f64,
    },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unrecognised { agreeing, matches } => write!(
                f,
                "only {agreeing} of {matches} points that look alike agree on a pose, and {LEAST_AGREEING} are needed"
            ),
            Self::Crowded { agreeing } => write!(
                f,
                "the {agreeing} points that agree on a pose lie in a small part of the picture, which does not fix it"
            ),
            Self::Uncertain { sigma_m, sigma_deg } => write!(
                f,
                "the pose would be uncertain by {:.1} cm and {sigma_deg:.2}°, which is too much",
                100.0 * sigma_m
            ),
        }
    }
}

/// Pose at which most matches agree, before it is judged.
#[derive(Debug, Clone)]
pub struct Recognised {
    /// The pose, `X_camera = camera_from_world · X_world`.
    pub camera_from_world: Isometry3<f64>,
    /// Number of landmarks that were recognised by their descriptors.
    pub matches: usize,
    sightings: Vec<Sighting>,
}

impl Recognised {
    /// The pose with its uncertainty.
    ///
    /// # Errors
    /// [`Doubt`] of a pose that is not certain enough.
    pub fn judged(&self, intrinsics: &Intrinsics) -> std::result::Result<Relocation, Doubt> {
        let (found, distance_m) =
            adjustment::judged(intrinsics, &self.sightings, &self.camera_from_world, self.matches)?;
        found.certain(distance_m)
    }
}

impl Relocation {
    /// The pose itself where it is certain enough; `distance_m` is the median distance of what it was estimated from.
    ///
    /// # Errors
    /// [`Doubt::Uncertain`].
    pub fn certain(self, distance_m: f64) -> std::result::Result<Self, Doubt> {
        let (sigma_m, sigma_deg) = (self.sigma_m, self.sigma_deg);
        let most_m = MOST_SIGMA_M.max(MOST_SIGMA_SHARE * distance_m);
        if sigma_m <= most_m && sigma_deg <= MOST_SIGMA_DEG {
            Ok(self)
        } else {
            Err(Doubt::Uncertain { sigma_m, sigma_deg })
        }
    }
}

/// Estimates the pose at which a camera with these intrinsics took a picture of their size, from the landmarks of one or
/// more reference pictures. The same pictures give the same pose.
///
/// # Errors
/// [`crate::Error::OpenCv`].
pub fn relocate(
    picture: &GrayImage,
    intrinsics: &Intrinsics,
    references: &[Landmarks],
) -> Result<std::result::Result<Relocation, Doubt>> {
    Ok(recognise(picture, intrinsics, references)?.and_then(|found| found.judged(intrinsics)))
}

/// Cell of a pixel in the grid over a reference picture of some size, for [`Sighting::cell`]; those of further reference
/// pictures need other numbers.
pub fn cell(pixel: &Point2<f64>, (width, height): (u32, u32)) -> u32 {
    let along = |position: f64, side: u32, count: u32| {
        ((position + 0.5) / f64::from(side) * f64::from(count)).clamp(0.0, f64::from(count - 1)) as u32
    };
    along(pixel.x, width, GRID[0]) + GRID[0] * along(pixel.y, height, GRID[1])
}

/// Pose of least weighted residuals near `start`, and the median distance of what it was estimated from; for sightings that
/// are more precise than keypoints. How precise they are is estimated with the pose: from a quarter to one and a half times their
/// [`Sighting::pixel_sigma_px`]. The pose's uncertainty holds errors of depth that the sightings of a cell share, but not those that
/// several cells share: where both halves of a picture are wrong by some percent each, it is several times too small.
/// `matches` is the number of landmarks that were recognised.
///
/// # Errors
/// [`Doubt`] where too few sightings agree, or too few parts of the picture; an uncertain pose is no error, see
/// [`Relocation::certain`].
pub fn refined(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    start: &Isometry3<f64>,
    matches: usize,
) -> std::result::Result<(Relocation, f64), Doubt> {
    let factors = &adjustment::OF_CORNERS;
    let (pose, weighted) = adjustment::adjusted_with_uncertainties(intrinsics, sightings, start, factors);
    let (found, distance_m) = adjustment::judged(intrinsics, &weighted, &pose, matches)?;
    let (sigma_m, sigma_deg) = adjustment::left_out_sigmas(intrinsics, &weighted, &pose);
    let sigmas = (found.sigma_m.max(sigma_m), found.sigma_deg.max(sigma_deg));
    Ok((Relocation { sigma_m: sigmas.0, sigma_deg: sigmas.1, ..found }, distance_m))
}

/// Pose of [`relocate`], however uncertain.
///
/// # Errors
/// [`crate::Error::OpenCv`].
pub fn recognise(
    picture: &GrayImage,
    intrinsics: &Intrinsics,
    references: &[Landmarks],
) -> Result<std::result::Result<Recognised, Doubt>> {
    let keypoints = Keypoints::find(picture, MOST_KEYPOINTS, CONTRAST)?;
    let seen = |reference: usize, pairs: Vec<(usize, usize)>| {
        let landmarks = &references[reference];
        pairs
            .into_iter()
            .map(move |(landmark, keypoint)| (reference, landmark, keypoint, landmarks.places[landmark]))
    };
    let sighting = |(reference, _, keypoint, place): (usize, usize, usize, Landmark)| Sighting {
        world: place.world,
        depth_step: place.depth_step,
        pixel: keypoints.pixels[keypoint],
        pixel_sigma_px: KEYPOINT_SIGMA_PX,
        cell: reference as u32 * GRID[0] * GRID[1] + place.cell,
    };
    let by_looks: Vec<Sighting> = references
        .iter()
        .enumerate()
        .flat_map(|(i, landmarks)| seen(i, landmarks.keypoints.matches(&keypoints, RATIO)))
        .map(sighting)
        .collect();
    let matches = by_looks.len();
    let Some(start) = consensus::pose(intrinsics, &by_looks) else {
        return Ok(Err(Doubt::Unrecognised { agreeing: 0, matches }));
    };
    let rough = adjustment::adjusted(intrinsics, &by_looks, &start);
    let camera = Camera { intrinsics: intrinsics.clone(), camera_from_world: rough };
    let by_place: Vec<Sighting> = references
        .iter()
        .enumerate()
        .flat_map(|(i, landmarks)| {
            let predicted: Vec<_> =
                landmarks.places.iter().map(|place| camera.project(&place.world)).collect();
            seen(i, landmarks.keypoints.matches_near(&keypoints, &predicted, NEAR_PX, NEAR_RATIO))
        })
        .map(sighting)
        .collect();
    let factors = &adjustment::OF_KEYPOINTS;
    let (camera_from_world, sightings) =
        adjustment::adjusted_with_uncertainties(intrinsics, &by_place, &rough, factors);
    let agreeing = adjustment::agreeing(intrinsics, &sightings, &camera_from_world);
    if agreeing < LEAST_AGREEING {
        return Ok(Err(Doubt::Unrecognised { agreeing, matches }));
    }
    Ok(Ok(Recognised { camera_from_world, matches, sightings }))
}
