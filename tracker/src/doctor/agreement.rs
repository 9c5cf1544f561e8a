//! Agreement of two pictures of one camera by their keypoints: how many are where a rotation of the camera puts them.
//!
//! A camera that turns in place moves each point's ray by the same rotation, whatever the scene's depth. The rotation is
//! found from pairs of matches at random (RANSAC: M. Fischler & R. Bolles, CACM 24, 1981) and fitted to the matches that
//! agree (W. Kabsch, Acta Crystallographica A 32, 1976). Matches of other scenes agree on no rotation.

use calib::Intrinsics;
use calib::vision::Keypoints;
use image::GrayImage;
use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use crate::Result;

/// Most keypoints of a picture.
const MOST_KEYPOINTS: usize = 900;
/// Least contrast of a keypoint; half of Lowe's, for plain walls.
const CONTRAST: f64 = 0.02;
/// Ratio of the distances to the nearest and second nearest descriptor of a match.
const RATIO: f32 = 0.85;
/// Distance within which a keypoint agrees with a rotation, pixels.
const AGREES_PX: f64 = 2.0;
/// Number of pairs of matches that are tried.
const TRIES: usize = 400;

/// A picture's keypoints and the rays through them.
pub(super) struct Landmarks {
    keypoints: Keypoints,
    /// `None` where the lens model has no ray.
    rays: Vec<Option<Vector3<f64>>>,
    intrinsics: Intrinsics,
}

/// Agreement of a film's picture with a reference picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Agreement {
    /// Number of keypoints whose descriptors match.
    pub(super) matches: usize,
    /// Number of matches that agree on one rotation.
    pub(super) agreeing: usize,
    /// Number of matches that agree with no rotation at all.
    pub(super) unmoved: usize,
    /// Rotation of rays from the reference's camera to the film's.
    pub(super) film_from_reference: UnitQuaternion<f64>,
}

impl Agreement {
    /// Angle of the rotation, degrees.
    pub(super) fn angle_deg(&self) -> f64 {
        self.film_from_reference.angle().to_degrees()
    }
}

impl Landmarks {
    /// Keypoints of a picture that a camera with these intrinsics filmed, at their size.
    ///
    /// # Errors
    /// An error of OpenCV.
    pub(super) fn of(picture: &GrayImage, intrinsics: &Intrinsics) -> Result<Self> {
        let keypoints = Keypoints::find(picture, MOST_KEYPOINTS, CONTRAST)?;
        let rays =
            keypoints.pixels.iter().map(|pixel| Some(intrinsics.unproject(pixel)?.normalize())).collect();
        Ok(Self { keypoints, rays, intrinsics: intrinsics.clone() })
    }

    /// Number of keypoints.
    pub(super) fn len(&self) -> usize {
        self.keypoints.pixels.len()
    }

    /// Agreement of a film with this reference, as pictures of one camera.
    pub(super) fn agreement(&self, film: &Self) -> Agreement {
        let matches: Vec<(usize, usize)> = self.keypoints.matches(&film.keypoints, RATIO);
        let pairs: Vec<(Vector3<f64>, usize, Vector3<f64>)> = matches
            .into_iter()
            .filter_map(|(here, there)| Some((self.rays[here]?, there, film.rays[there]?)))
            .collect();
        let agreeing = |rotation: &Rotation3<f64>| -> Vec<usize> {
            let is_near = |(ray, there, _): &(Vector3<f64>, usize, Vector3<f64>)| {
                let seen = film.intrinsics.project(&Point3::from(rotation * ray));
                seen.is_some_and(|seen| (seen - film.keypoints.pixels[*there]).norm() <= AGREES_PX)
            };
            (0..pairs.len()).filter(|i| is_near(&pairs[*i])).collect()
        };
        let fitted = |chosen: &[usize]| {
            let sum: Matrix3<f64> = chosen.iter().map(|i| pairs[*i].2 * pairs[*i].0.transpose()).sum();
            calib::rotation::nearest(&sum)
        };
        let unmoved = agreeing(&Rotation3::identity());
        let mut best = (unmoved.clone(), Rotation3::identity());
        // Pairs in a fixed order that looks random: the same pictures give the same findings.
        let mut state = 1u32;
        let mut draw = |below: usize| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as usize % below
        };
        if pairs.len() >= 2 {
            for _ in 0..TRIES {
                let (a, b) = (draw(pairs.len()), draw(pairs.len()));
                if pairs[a].0.angle(&pairs[b].0) < 0.02 {
                    continue;
                }
                let rotation = fitted(&[a, b]);
                let found = agreeing(&rotation);
                if found.len() > best.0.len() {
                    best = (found, rotation);
                }
            }
        }
        for _ in 0..3 {
            if best.0.len() >= 2 {
                let rotation = fitted(&best.0);
                let found = agreeing(&rotation);
                if found.len() < best.0.len() {
                    break;
                }
                best = (found, rotation);
            }
        }
        Agreement {
            matches: pairs.len(),
            agreeing: best.0.len(),
            unmoved: unmoved.len(),
            film_from_reference: UnitQuaternion::from_rotation_matrix(&best.1),
        }
    }
}
