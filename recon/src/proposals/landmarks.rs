//! Keypoints of a reference view with their positions in space, and matches between two views.

use calib::vision::Keypoints;
use image::GrayImage;
use nalgebra::{Point2, Point3};
use rand_pcg::Pcg64Mcg;

use super::flat;
use crate::Result;
use crate::surface::Surface;

/// Number of keypoints of a picture, and their least contrast: rooms are plain, and rectified pictures smooth.
const KEYPOINTS: usize = 4000;
const CONTRAST: f64 = 0.02;
const CONTRAST_SQUARE_ON: f64 = 0.01;
/// Largest ratio of a match's distance to that of the second nearest.
const RATIO: f32 = 0.85;

/// A keypoint in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Landmark {
    /// Pixel in the pinhole picture of its camera.
    pub(super) pixel: Point2<f64>,
    /// Position in its camera's frame.
    pub(super) position: Point3<f64>,
}

/// Candidate correspondence: a landmark of one camera and one of another.
pub(super) type Candidate = [Landmark; 2];

/// Landmarks of a view.
pub(super) struct Landmarks {
    /// Landmarks from the picture as it is, and from its planes' frontal pictures: a place may be among both.
    kinds: [(Vec<Landmark>, Keypoints); 2],
}

impl Landmarks {
    /// # Errors
    /// [`crate::error::Error::Calib`] when OpenCV refuses.
    pub(super) fn of(surface: &Surface, rng: &mut Pcg64Mcg) -> Result<Self> {
        let gray = image::imageops::grayscale(&surface.picture);
        Ok(Self { kinds: [as_seen(surface, &gray)?, square_on(surface, &gray, rng)?] })
    }

    /// Candidate correspondences by similar descriptors.
    pub(super) fn candidates(&self, other: &Self) -> Vec<Candidate> {
        let mut candidates: Vec<Candidate> = Vec::new();
        for ((here, keypoints), (there, others)) in self.kinds.iter().zip(&other.kinds) {
            for (i, j) in keypoints.matches(others, RATIO) {
                let candidate = [here[i], there[j]];
                // A place with two orientations, or found in both kinds, counts once.
                let same =
                    |c: &Candidate| c.iter().zip(&candidate).all(|(p, q)| (p.pixel - q.pixel).norm() < 1.5);
                if !candidates.iter().any(same) {
                    candidates.push(candidate);
                }
            }
        }
        candidates
    }
}

fn as_seen(surface: &Surface, gray: &GrayImage) -> Result<(Vec<Landmark>, Keypoints)> {
    let keypoints = Keypoints::find(gray, KEYPOINTS, CONTRAST)?;
    let place = |(index, pixel): (usize, &Point2<f64>)| {
        Some((index, Landmark { pixel: *pixel, position: surface.point_at(pixel)? }))
    };
    let (chosen, landmarks): (Vec<_>, Vec<_>) = keypoints.pixels.iter().enumerate().filter_map(place).unzip();
    Ok((landmarks, keypoints.chosen(&chosen)))
}

fn square_on(surface: &Surface, gray: &GrayImage, rng: &mut Pcg64Mcg) -> Result<(Vec<Landmark>, Keypoints)> {
    let (mut landmarks, mut all) = (Vec::new(), Keypoints::default());
    for flat in flat::find(surface, rng) {
        let Some(seen) = flat.square_on(surface, gray) else { continue };
        let keypoints = Keypoints::find(&seen.picture, KEYPOINTS, CONTRAST_SQUARE_ON)?;
        let mut chosen = Vec::new();
        for (index, pixel) in keypoints.pixels.iter().enumerate() {
            let position = seen.position(pixel);
            let Some(pixel) = surface.intrinsics.project(&position) else { continue };
            if flat.holds(surface, &pixel) {
                chosen.push(index);
                landmarks.push(Landmark { pixel, position });
            }
        }
        all.append(keypoints.chosen(&chosen));
    }
    Ok((landmarks, all))
}
