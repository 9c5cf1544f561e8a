//! Films against the room's reference pictures.

use std::path::Path;

use calib::video::FrameSource;
use calib::{Camera, Intrinsics};
use image::{GrayImage, RgbImage};
use rayon::prelude::*;
use scenes::room::Room;

use super::agreement::{Agreement, Landmarks};
use super::{Finding, still_people};
use crate::Result;

/// Larger side to which pictures are brought, pixels.
const SIDE_PX: u32 = 640;
/// Fewest matches that agree by more than chance.
const LEAST_AGREEING: usize = 12;
/// Fewest matches for a finding about the camera's pose or another camera's view.
const CLEARLY_AGREEING: usize = 25;
/// Number of matches from which on no other camera's reference picture is looked at.
const SURELY_AGREEING: usize = 250;
/// Least share of the matches that agree with the view of a camera that has turned; two cameras of one room share walls.
const TURNED_SHARE: f64 = 0.5;
/// Factor by which another camera's reference picture must agree better, and by which a reference picture has more keypoints than a
/// film that shows next to nothing.
const MUCH_BETTER: usize = 3;
/// Turn of a camera that is told, degrees.
pub(super) const TURNED_DEG: f64 = 0.3;
/// Share of the agreeing matches that would agree without a turn, too, of a camera that has not turned.
const UNMOVED_SHARE: f64 = 0.5;
/// Fewest keypoints of a picture that can be recognised, or that can recognise another.
const LEAST_KEYPOINTS: usize = 150;

/// A film's empty scene.
#[derive(Debug, Clone)]
pub struct EmptyScene {
    /// The camera's name in the room.
    pub camera: String,
    /// Path of the film as it was given.
    pub film: String,
    /// Its picture, with the lens's distortion, at any size.
    pub picture: RgbImage,
}

/// Agreement of a film with the reference picture of its camera.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewReport {
    /// The camera's name in the room.
    pub camera: String,
    /// Number of points that agree with the reference picture; `None` where the room has none.
    pub agreeing: Option<usize>,
}

/// Size at which a camera's pictures are compared, pixels.
pub fn compared_size(intrinsics: &Intrinsics) -> (u32, u32) {
    let (width, height) = (intrinsics.width, intrinsics.height);
    let side = width.max(height);
    if side <= SIDE_PX {
        return (width, height);
    }
    let scaled = |length: u32| ((u64::from(length) * u64::from(SIDE_PX)) / u64::from(side)).max(1) as u32;
    (scaled(width), scaled(height))
}

/// A reference picture that could be read.
struct Reference {
    picture: GrayImage,
    landmarks: Landmarks,
}

/// Compares films with the reference pictures of a room that was read from `room_dir`.
///
/// Films of cameras without a reference picture, and reference pictures that cannot be read, are left out.
///
/// # Errors
/// An error of OpenCV.
pub fn compare(
    room: &Room,
    room_dir: &Path,
    films: &[EmptyScene],
) -> Result<(Vec<ViewReport>, Vec<Finding>)> {
    let references: Vec<Option<Reference>> = room
        .cameras
        .par_iter()
        .map(|camera| {
            let Some(path) = &camera.reference else { return Ok(None) };
            let (width, height) = compared_size(&camera.camera.intrinsics);
            let Some(picture) = read(&room_dir.join(path), (width, height)) else { return Ok(None) };
            let landmarks = Landmarks::of(&picture, &camera.camera.intrinsics.resized(width, height))?;
            Ok(Some(Reference { picture, landmarks }))
        })
        .collect::<Result<_>>()?;
    let compared: Vec<(ViewReport, Option<Finding>)> =
        films.par_iter().map(|film| compare_one(room, &references, film)).collect::<Result<_>>()?;
    let (reports, findings): (Vec<_>, Vec<_>) = compared.into_iter().unzip();
    Ok((reports, findings.into_iter().flatten().collect()))
}

fn compare_one(
    room: &Room,
    references: &[Option<Reference>],
    film: &EmptyScene,
) -> Result<(ViewReport, Option<Finding>)> {
    let nothing = || (ViewReport { camera: film.camera.clone(), agreeing: None }, None);
    let Some(own) = room.cameras.iter().position(|camera| camera.name == film.camera) else {
        return Ok(nothing());
    };
    let Some(reference) = &references[own] else { return Ok(nothing()) };
    // The film is looked at as if each camera had filmed it, since its lens belongs to its rays.
    let agreement = |camera: usize, reference: &Reference| -> Result<(Agreement, usize)> {
        let intrinsics = &room.cameras[camera].camera.intrinsics;
        let (width, height) = compared_size(intrinsics);
        let picture = scaled(&film.picture, (width, height));
        let seen = Landmarks::of(&picture, &intrinsics.resized(width, height))?;
        Ok((reference.landmarks.agreement(&seen), seen.len()))
    };
    let (here, keypoints) = agreement(own, reference)?;
    let report = ViewReport { camera: film.camera.clone(), agreeing: Some(here.agreeing) };
    let finding = |text: String| {
        Ok((report.clone(), Some(Finding { camera: film.camera.clone(), film: film.film.clone(), text })))
    };
    if here.agreeing < SURELY_AGREEING {
        let mut best: Option<(usize, usize)> = None;
        for (other, reference) in references.iter().enumerate().filter(|(other, _)| *other != own) {
            let Some(reference) = reference else { continue };
            let (there, _) = agreement(other, reference)?;
            if best.is_none_or(|(_, agreeing)| there.agreeing > agreeing) {
                best = Some((other, there.agreeing));
            }
        }
        if let Some((other, agreeing)) = best
            && agreeing >= CLEARLY_AGREEING
            && agreeing >= MUCH_BETTER * here.agreeing
        {
            let name = &room.cameras[other].name;
            return finding(format!(
                "shows what camera `{name}` sees ({agreeing} points agree with its reference picture, {} with that of `{}`): are \
                 two films swapped? Give it as {name}={}",
                here.agreeing, film.camera, film.film
            ));
        }
    }
    if here.agreeing < LEAST_AGREEING {
        let expected = reference.landmarks.len();
        if expected < LEAST_KEYPOINTS {
            return Ok((report, None));
        }
        if keypoints < LEAST_KEYPOINTS && keypoints * MUCH_BETTER < expected {
            return finding(format!(
                "shows next to nothing ({keypoints} points where the room's reference picture of camera `{}` has {expected}): is its \
                 lens covered or out of focus, is it dark, or was the camera moved? Film again, or build the room from a capture that \
                 ends at the camera's present pose",
                film.camera
            ));
        }
        return finding(format!(
            "shows nothing of the room's reference picture of camera `{}` ({} of {keypoints} points agree): is it of another \
             room, or was the camera moved? Build the room from a capture that ends at the camera's present pose",
            film.camera, here.agreeing
        ));
    }
    if is_turned(&here) {
        return finding(format!(
            "camera `{}` has turned by {:.1}° since the room's reference picture, {} ({} points agree): turn it back, or build \
             the room from a capture that ends at its present pose",
            film.camera,
            here.angle_deg(),
            direction(&here),
            here.agreeing
        ));
    }
    if is_elsewhere(&here) {
        return finding(format!(
            "camera `{}` was moved since the room's reference picture ({} of {} points that are recognised agree with a turn of \
             {:.1}°, {} with none): put it back, let `recon relocate` find its present pose, or build the room from a capture that \
             ends there",
            film.camera,
            here.agreeing,
            here.matches,
            here.angle_deg(),
            here.unmoved
        ));
    }
    if here.unmoved >= CLEARLY_AGREEING {
        let intrinsics = room.cameras[own]
            .camera
            .intrinsics
            .resized(reference.picture.width(), reference.picture.height());
        let camera = Camera { intrinsics, ..room.cameras[own].camera.clone() };
        let scene = scaled(&film.picture, reference.picture.dimensions());
        if let Some(person) = still_people::find(&reference.picture, &scene, &camera).first() {
            let full = room.cameras[own].camera.intrinsics.width;
            let scale = f64::from(full) / f64::from(reference.picture.width());
            return finding(format!(
                "its empty scene holds what the reference picture does not, {:.1} m high, at pixel ({:.0}, {:.0}): somebody who \
                 stands still for most of the film? Give --background {}=CLIP, a clip or picture of the empty room",
                person.height_m,
                person.foot.x * scale,
                person.foot.y * scale,
                film.camera
            ));
        }
    }
    Ok((report, None))
}

/// Whether a camera has turned: most matches agree on one rotation, and few without it.
pub(super) fn is_turned(agreement: &Agreement) -> bool {
    agreement.agreeing >= CLEARLY_AGREEING
        && agreement.agreeing as f64 >= TURNED_SHARE * agreement.matches as f64
        && agreement.angle_deg() >= TURNED_DEG
        && (agreement.unmoved as f64) < UNMOVED_SHARE * agreement.agreeing as f64
}

/// Whether a camera stands elsewhere: near and far surfaces have moved by different angles, so no rotation explains most
/// matches, but next to none are where they were.
fn is_elsewhere(agreement: &Agreement) -> bool {
    agreement.agreeing >= CLEARLY_AGREEING
        && agreement.angle_deg() >= TURNED_DEG
        && agreement.unmoved * MUCH_BETTER < agreement.agreeing
}

/// Direction in which the camera has turned, in words.
fn direction(agreement: &Agreement) -> &'static str {
    // Rays turn against the camera: a camera that turns right (about its y axis, which points down) moves them left.
    let turn = agreement.film_from_reference.scaled_axis();
    let [x, y, z] = [turn.x, turn.y, turn.z];
    if z.abs() > x.abs().max(y.abs()) {
        if z > 0.0 { "counter-clockwise" } else { "clockwise" }
    } else if y.abs() >= x.abs() {
        if y < 0.0 { "to the right" } else { "to the left" }
    } else if x < 0.0 {
        "upwards"
    } else {
        "downwards"
    }
}

/// A picture file, grey, at the given size; `None` where it cannot be read or has not the shape of the size.
fn read(path: &Path, size: (u32, u32)) -> Option<GrayImage> {
    let mut source = FrameSource::open(path.to_str()?).ok()?;
    let mut picture = RgbImage::default();
    source.read(&mut picture).ok()?.then_some(())?;
    Some(scaled(&picture, size))
}

fn scaled(picture: &RgbImage, (width, height): (u32, u32)) -> GrayImage {
    let grey = image::imageops::grayscale(picture);
    if grey.dimensions() == (width, height) {
        return grey;
    }
    image::imageops::resize(&grey, width, height, image::imageops::FilterType::Triangle)
}
