//! `recon relocate`: where a camera of a finished room stands now, from one picture.
//!
//! The landmarks are keypoints of the room's reference pictures, the camera's own and the others', lifted by the room's
//! depth; [`calib::relocation`] recognises the view by them. Then corners of the camera's own reference picture are
//! registered in the new one ([`registration`]), and the pose is adjusted to them.
//!
//! With the new pose, the new picture takes the place of the camera's reference picture, which shows the view from its pose. Depth
//! maps are rendered from the geometry and are kept under a hash of the pose, so they need no care; geometry, floor and zones are
//! the room's, not the camera's.

mod registration;

use std::path::{Path, PathBuf};

use calib::relocation::{self, Doubt, Landmarks, Relocation, SceneDepth};
use calib::video::FrameSource;
use calib::{Camera, Intrinsics, picture};
use image::imageops::{self, FilterType};
use image::{GrayImage, RgbImage};
use nalgebra::{Point3, Vector3};
use scenes::depth::{self, DepthMap};
use scenes::room::{MovedCamera, Room, RoomCamera, save_moved_camera};

use crate::{Error, Result};
use registration::ReferenceCorners;

/// Larger side to which pictures are brought, pixels: more tells keypoints no better and takes longer.
const SIDE_PX: u32 = 1600;
/// Distance and angle of two cameras that would stand in each other: the picture is the other camera's.
const SAME_PLACE_M: f64 = 0.05;
const SAME_DEG: f64 = 2.0;
/// Relative difference of two aspect ratios that counts as the same shape.
const SAME_SHAPE: f64 = 0.01;
/// Number of times that corners are registered, each time from the pose found last.
const REGISTRATIONS: usize = 2;

/// Present pose of a camera.
#[derive(Debug, Clone)]
pub struct Relocated {
    /// Pose, uncertainty and matches.
    pub found: Relocation,
    /// Distance from the pose that the room has, metres.
    pub moved_m: f64,
    /// Angle from the pose that the room has, degrees.
    pub turned_deg: f64,
    /// Present position, metres.
    pub position: Point3<f64>,
    picture: RgbImage,
}

impl Relocated {
    /// Tells whether the camera stands where the room has it, as far as the picture can tell.
    pub fn is_unmoved(&self) -> bool {
        self.moved_m <= 2.0 * self.found.sigma_m && self.turned_deg <= 2.0 * self.found.sigma_deg
    }
}

/// Estimates where a camera of a room stands now. `image` is a picture file, or whatever else pictures come from.
///
/// # Errors
/// One line for a room without geometry or reference pictures, a picture that cannot be read or has another size than
/// the camera's, and a pose that is not certain.
pub fn relocate(room_dir: &Path, room: &Room, camera_name: &str, image: &str) -> Result<Relocated> {
    let camera = room.camera(camera_name)?;
    if room.geometry.is_none() {
        return Err(Error::content(
            room_dir,
            "geometry",
            "the room has none, so its reference pictures have no depth; build it with `recon build`",
        ));
    }
    let picture = read_picture(image)?;
    let k = &camera.camera.intrinsics;
    let refused = |problem: String| Error::content(Path::new(image), "picture", problem);
    if picture.dimensions() != (k.width, k.height) {
        let (width, height) = picture.dimensions();
        return Err(refused(format!(
            "is {width} × {height} pixels, camera `{camera_name}` has {} × {}; give a picture as the camera takes it",
            k.width, k.height
        )));
    }
    let references = references(room_dir, room, camera)?;
    let grey = working_size(&picture);
    let found = pose(&grey, &k.resized(grey.width(), grey.height()), &references)?.map_err(|doubt| {
        refused(format!(
            "it is not certain where camera `{camera_name}` stands: {doubt}; take a sharp picture of the empty room, or build \
             the room from a new capture"
        ))
    })?;
    let after = Camera { intrinsics: k.clone(), camera_from_world: found.camera_from_world };
    let is_there = |other: &&RoomCamera| {
        let (of_room, now) = (&other.camera.camera_from_world, &after.camera_from_world);
        other.name != camera_name
            && (other.camera.center() - after.center()).norm() < SAME_PLACE_M
            && of_room.rotation.angle_to(&now.rotation).to_degrees() < SAME_DEG
    };
    if let Some(other) = room.cameras.iter().find(is_there) {
        return Err(refused(format!(
            "shows what camera `{}` sees; give the picture of camera `{camera_name}`",
            other.name
        )));
    }
    let turn = found.camera_from_world.rotation.angle_to(&camera.camera.camera_from_world.rotation);
    let position = after.center();
    let moved_m = (position - camera.camera.center()).norm();
    Ok(Relocated { found, moved_m, turned_deg: turn.to_degrees(), position, picture })
}

/// Writes a camera's present pose into the room, with the picture `image` as its reference picture. Returns the path of
/// the reference picture in the room directory.
///
/// # Errors
/// As [`save_moved_camera`].
pub fn write(room_dir: &Path, before: &RoomCamera, found: &Relocated, image: &str) -> Result<PathBuf> {
    let (picture, ending) = file_content(Path::new(image), &found.picture)?;
    let camera_from_world = found.found.camera_from_world;
    let moved = MovedCamera { before, camera_from_world, picture: &picture, ending };
    Ok(save_moved_camera(room_dir, &moved)?)
}

/// Bytes of a picture file, and the ending of its name: those of the file itself where it is an upright picture.
fn file_content(file: &Path, picture: &RgbImage) -> Result<(Vec<u8>, &'static str)> {
    let ending = file.extension().and_then(|ending| ending.to_str()).map(str::to_ascii_lowercase);
    let known = ["jpg", "png"].into_iter().find(|known| {
        ending.as_deref().is_some_and(|ending| ending == *known || (ending == "jpeg" && *known == "jpg"))
    });
    if let Some(ending) = known
        && file.is_file()
        && picture::is_upright(file)?
    {
        let bytes = std::fs::read(file).map_err(Error::io(file))?;
        return Ok((bytes, ending));
    }
    Ok((picture::encode(Path::new("reference.png"), picture)?, "png"))
}

/// Pose of a picture: recognised by keypoints, then adjusted by registered corners where enough of them are found.
fn pose(
    picture: &GrayImage,
    intrinsics: &Intrinsics,
    references: &References,
) -> Result<std::result::Result<Relocation, Doubt>> {
    let recognised = match relocation::recognise(picture, intrinsics, &references.landmarks)? {
        Ok(recognised) => recognised,
        Err(doubt) => return Ok(Err(doubt)),
    };
    // Corners of the camera's own picture alone: where the other cameras stand is not certain to a few millimetres.
    let Some(own) = &references.own_corners else { return Ok(recognised.judged(intrinsics)) };
    let now = registration::intensity(picture);
    let mut pose = recognised.camera_from_world;
    let mut refined = None;
    for _ in 0..REGISTRATIONS {
        let seen = own.found_in(&now, intrinsics, &pose);
        refined = relocation::refined(intrinsics, &seen, &pose, recognised.matches).ok();
        let Some((found, _)) = &refined else { break };
        pose = found.camera_from_world;
    }
    Ok(match refined {
        Some((found, distance_m)) => found.certain(distance_m),
        // The view has changed too much for patches, or only other cameras' pictures show it.
        None => recognised.judged(intrinsics),
    })
}

/// The reference pictures that can be used, the camera's own first.
struct References {
    landmarks: Vec<Landmarks>,
    own_corners: Option<ReferenceCorners>,
}

fn references(room_dir: &Path, room: &Room, own: &RoomCamera) -> Result<References> {
    let others = room.cameras.iter().filter(|other| other.name != own.name);
    let mut found = References { landmarks: Vec::new(), own_corners: None };
    for camera in std::iter::once(own).chain(others) {
        let Some(path) = &camera.reference else { continue };
        let path = room_dir.join(path);
        if !path.is_file() {
            continue; // `Room::read` has warned of it.
        }
        let picture = picture::read(&path)?.into_rgb8();
        let k = &camera.camera.intrinsics;
        let shape = |width: u32, height: u32| f64::from(width) / f64::from(height);
        let stretched = shape(picture.width(), picture.height()) / shape(k.width, k.height);
        if (stretched - 1.0).abs() > SAME_SHAPE {
            tracing::warn!("{}: has not the shape of camera `{}`'s pictures", path.display(), camera.name);
            continue;
        }
        let grey = working_size(&picture);
        let map = depth::cached(room_dir, room, &camera.name)?;
        let intrinsics = k.resized(grey.width(), grey.height());
        let view = Camera { intrinsics, camera_from_world: camera.camera.camera_from_world };
        let twin = k.pinhole();
        found.landmarks.push(Landmarks::of(&grey, &view, |ray| depth_along(&map, &twin, ray))?);
        if camera.name == own.name {
            let corners = ReferenceCorners::of(&grey, &view, |ray| depth_along(&map, &twin, ray))?;
            found.own_corners = Some(corners);
        }
    }
    if found.landmarks.is_empty() {
        return Err(Error::content(
            room_dir,
            "reference",
            "no camera of the room has a reference picture to compare with; build the room with `recon build`",
        ));
    }
    Ok(found)
}

/// Depth along a ray of a camera, from the map of its pinhole twin.
fn depth_along(map: &DepthMap, twin: &Intrinsics, ray: &Vector3<f64>) -> Option<SceneDepth> {
    let pixel = twin.project(&Point3::from(*ray))?;
    let surface = map.surface_at(&pixel)?;
    Some(SceneDepth { z_m: surface.z_m, sigma_m: surface.sigma_m })
}

fn read_picture(image: &str) -> Result<RgbImage> {
    let mut source = FrameSource::open(image)?;
    let (width, height) = source.size();
    let mut picture = RgbImage::new(width, height);
    if source.read(&mut picture)? {
        return Ok(picture);
    }
    Err(Error::content(Path::new(image), "picture", "there is none; is the file whole?"))
}

fn working_size(picture: &RgbImage) -> GrayImage {
    let grey = imageops::grayscale(picture);
    let (width, height) = grey.dimensions();
    let side = width.max(height);
    if side <= SIDE_PX {
        return grey;
    }
    let scaled = |length: u32| ((u64::from(length) * u64::from(SIDE_PX)) / u64::from(side)).max(1) as u32;
    imageops::resize(&grey, scaled(width), scaled(height), FilterType::Triangle)
}
