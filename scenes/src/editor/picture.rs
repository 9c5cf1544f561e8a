//! Pictures on which a person draws: the floor plan, and an image for each camera.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, Rgb, RgbImage};

use crate::plan::{FloorPlan, Mapping, PlanOptions};
use crate::raycast::RayScene;
use crate::room::{Drawing, Room, RoomCamera};
use crate::view::{View, ViewOptions};
use crate::walkable::WalkableMap;
use crate::{Error, Result};

/// Largest width of pictures rendered here; the page shows them no larger.
const WIDEST_PX: u32 = 960;
/// Colour of pixels for which there is neither an image nor geometry.
const GREY: Rgb<u8> = Rgb([128; 3]);

/// An encoded picture.
pub(super) struct Picture {
    /// PNG or JPEG.
    pub bytes: Vec<u8>,
    /// Media type of the bytes, as HTTP names it.
    pub media_type: &'static str,
}

/// A floor plan, and the mapping of the floor to its pixels.
pub(super) struct PlanPicture {
    pub picture: Picture,
    pub width: u32,
    pub height: u32,
    pub mapping: Mapping,
}

/// Plan of a room without its drawing, which the page draws, but with the floor that it covers. The rim of the walkable
/// floor is on it where that is derived.
pub(super) fn plan(
    dir: &Path,
    room: &Room,
    drawing: &Drawing,
    walkable: &WalkableMap,
) -> Result<PlanPicture> {
    let polygons = drawing.zones.iter().map(|zone| &zone.polygon);
    let polygons = polygons.chain(drawing.regions.iter().map(|region| &region.polygon)).chain(&drawing.floor);
    let corners = polygons.flat_map(|polygon| &polygon.0);
    let is_derived = drawing.floor.is_empty();
    let options = PlanOptions {
        walkable: Some(if is_derived { walkable.clone() } else { WalkableMap::everywhere() }),
        places: corners.chain(drawing.lines.iter().flat_map(|line| &line.points)).copied().collect(),
        room_dir: Some(dir.to_owned()),
        ..PlanOptions::default()
    };
    let plan = FloorPlan::new(room, &options)?;
    let mapping = plan.mapping();
    let image = plan.into_image();
    Ok(PlanPicture { width: image.width(), height: image.height(), mapping, picture: png(&image)? })
}

/// Reference image of a camera; where there is none that can be shown, a rendering of the room from the camera.
///
/// # Errors
/// [`Error::Room`] when a picture cannot be encoded.
pub(super) fn of_camera(
    dir: &Path,
    room: &Room,
    scene: Option<&RayScene>,
    camera: &RoomCamera,
) -> Result<Picture> {
    if let Some(picture) = camera.reference.as_ref().and_then(|path| reference(&dir.join(path))) {
        return Ok(picture);
    }
    let k = &camera.camera.intrinsics;
    let width = k.width.min(WIDEST_PX);
    let height = (u64::from(k.height) * u64::from(width) / u64::from(k.width)).max(1) as u32;
    let image = match (&room.geometry, scene) {
        (Some(geometry), Some(scene)) => {
            let small = calib::Camera { intrinsics: k.resized(width, height), ..camera.camera.clone() };
            View::new(geometry, scene, &small, &ViewOptions::default()).image()
        }
        _ => RgbImage::from_pixel(width, height, GREY),
    };
    png(&image)
}

/// Picture of a file, upright. `None` if it cannot be shown.
fn reference(path: &Path) -> Option<Picture> {
    let bytes = std::fs::read(path).ok()?;
    let picture = calib::picture::read(path).ok()?;
    match image::guess_format(&bytes) {
        Ok(ImageFormat::Png) if calib::picture::is_upright(path).ok()? => {
            Some(Picture { bytes, media_type: "image/png" })
        }
        Ok(ImageFormat::Jpeg) if calib::picture::is_upright(path).ok()? => {
            Some(Picture { bytes, media_type: "image/jpeg" })
        }
        // Browsers differ in what they turn, and in the formats that they show.
        _ => {
            let mut bytes = Cursor::new(Vec::new());
            picture.into_rgb8().write_to(&mut bytes, ImageFormat::Jpeg).ok()?;
            Some(Picture { bytes: bytes.into_inner(), media_type: "image/jpeg" })
        }
    }
}

fn png(image: &RgbImage) -> Result<Picture> {
    let mut bytes = Cursor::new(Vec::new());
    image
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|e| Error::Room { place: "picture".into(), problem: e.to_string() })?;
    Ok(Picture { bytes: bytes.into_inner(), media_type: "image/png" })
}
