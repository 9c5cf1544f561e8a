//! Description of a room for its page: plan, places, cameras, surfaces.

use std::io::Cursor;
use std::path::Path;

use axum::body::Bytes;
use image::codecs::jpeg::JpegEncoder;
use nalgebra::Point2;
use scenes::plan::{FloorPlan, PlanOptions};
use scenes::polygon::Polygon;
use scenes::room::{Line, Region, Room, Zone};
use scenes::space::{CameraPlace, surfaces};
use serde::Serialize;
use shell::canvas::Color;

use crate::Result;

/// Longest side of the plan's picture, pixels.
const LONGEST_SIDE_PX: u32 = 1400;
/// JPEG quality of the plan.
const JPEG_QUALITY: u8 = 85;
/// Number of colours of people: [`Color::of_id`] repeats after them.
const COLORS: u32 = 21;

/// Description of the room that the page fetches once.
#[derive(Debug, Clone, Default)]
pub struct RoomPage {
    /// JSON of the description.
    pub(super) description: Bytes,
    /// JPEG of the plan, empty without one.
    pub(super) plan: Bytes,
    /// Surfaces for the 3-D view, empty without geometry.
    pub(super) surfaces: Bytes,
}

#[derive(Serialize)]
struct Description<'a> {
    title: &'a str,
    /// Smallest and largest corner of the plan's picture, metres.
    plan: [Point2<f64>; 2],
    has_surfaces: bool,
    /// Polygons of the walkable floor, where the room states them.
    floor: &'a [Polygon],
    zones: &'a [Zone],
    regions: &'a [Region],
    lines: &'a [Line],
    cameras: Vec<CameraPlace>,
    /// Names of the counts that frames carry, in their order.
    places: Vec<&'a str>,
    /// Colours of people by id, repeating.
    colors: Vec<String>,
}

impl RoomPage {
    /// Page of a room that was read from `room_dir`, with these of its cameras. The plan's ground is kept in the room's
    /// cache.
    ///
    /// # Errors
    /// A camera that the room lacks; geometry that cannot be drawn; text that cannot be written as JSON.
    pub fn new(room: &Room, room_dir: &Path, title: &str, cameras: &[String]) -> Result<Self> {
        let (plan, corners) = plan(room, room_dir)?;
        let places = crate::events::Tally::new(room);
        let description = Description {
            title,
            plan: corners,
            has_surfaces: room.geometry.is_some(),
            floor: room.walkable.as_deref().unwrap_or_default(),
            zones: &room.zones,
            regions: &room.regions,
            lines: &room.lines,
            cameras: cameras
                .iter()
                .map(|name| Ok(CameraPlace::of(room.camera(name)?)))
                .collect::<Result<_>>()?,
            places: places.places().map(|(name, _)| name).collect(),
            colors: (0..COLORS).map(|id| hex(Color::of_id(id))).collect(),
        };
        let description = serde_json::to_vec(&description)
            .map_err(|e| crate::Error::option("view", format!("{e}; run without it")))?;
        let surfaces = surfaces::of_room(room).unwrap_or_default();
        Ok(Self { description: description.into(), plan, surfaces: surfaces.into() })
    }
}

/// Plan without marks as JPEG, cut to the shown floor, and that floor's smallest and largest corner, metres.
fn plan(room: &Room, room_dir: &Path) -> Result<(Bytes, [Point2<f64>; 2])> {
    let options = PlanOptions {
        longest_side_px: LONGEST_SIDE_PX,
        marks: false,
        room_dir: Some(room_dir.to_owned()),
        ..PlanOptions::default()
    };
    let plan = FloorPlan::new(room, &options)?;
    let mapping = plan.mapping();
    // Within the frame's line.
    let [left, top, right, bottom] = mapping.frame();
    let [left, top] = [left, top].map(|edge| edge.ceil() + 2.0);
    let [width, height] = [right - left, bottom - top].map(|size| (size.floor() - 2.0).max(1.0));
    let image = plan.into_image();
    let cut =
        image::imageops::crop_imm(&image, left as u32, top as u32, width as u32, height as u32).to_image();
    let mut bytes = Cursor::new(Vec::new());
    // A plan that is too large to encode leaves the page without one.
    let encoded = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY).encode_image(&cut).is_ok();
    let low = mapping.floor(&Point2::new(left - 0.5, top + height - 0.5));
    let high = mapping.floor(&Point2::new(left + width - 0.5, top - 0.5));
    Ok((if encoded { bytes.into_inner().into() } else { Bytes::new() }, [low, high]))
}

fn hex(color: Color) -> String {
    format!("#{:02x}{:02x}{:02x}", color.r, color.g, color.b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use calib::{Camera, Intrinsics};
    use nalgebra::Isometry3;
    use scenes::room::{RoomCamera, ZoneKind};
    use serde_json::Value;

    #[test]
    fn a_room_is_described() {
        let camera = Camera {
            intrinsics: Intrinsics::from_horizontal_fov(64, 48, 70.0),
            camera_from_world: Isometry3::translation(0.0, 0.0, 3.0),
        };
        let polygon = Polygon::rectangle(Point2::new(-2.0, -1.0), Point2::new(2.0, 1.0));
        let room = Room {
            cameras: vec![RoomCamera { name: "a".into(), camera, reference: None }],
            zones: vec![Zone { name: "door".into(), polygon: polygon.clone(), kind: ZoneKind::Both }],
            walkable: Some(vec![polygon]),
            ..Room::default()
        };
        let folder = tempfile::tempdir().unwrap();
        let page = RoomPage::new(&room, folder.path(), "hall", &["a".into()]).unwrap();
        let told: Value = serde_json::from_slice(&page.description).unwrap();
        assert_eq!((&told["title"], &told["places"]), (&"hall".into(), &serde_json::json!(["room", "door"])));
        assert_eq!(told["cameras"][0]["center"], serde_json::json!([0.0, 0.0, -3.0]));
        assert_eq!(told["cameras"][0]["frustum"].as_array().unwrap().len(), 4);
        assert_eq!(told["colors"].as_array().unwrap().len(), 21);
        assert!(page.surfaces.is_empty() && told["has_surfaces"] == false);
        // The picture has the aspect of the floor that it shows.
        let picture = image::load_from_memory(&page.plan).unwrap();
        let corner = |i: usize, axis: usize| told["plan"][i][axis].as_f64().unwrap();
        let (width_m, height_m) = (corner(1, 0) - corner(0, 0), corner(1, 1) - corner(0, 1));
        let scale = f64::from(picture.width()) / width_m;
        assert!((scale - f64::from(picture.height()) / height_m).abs() < 1e-6 * scale, "{told}");
        assert!(corner(0, 0) < -2.0 && corner(1, 1) > 1.0);
        assert!(RoomPage::new(&room, folder.path(), "hall", &["b".into()]).is_err());
    }
}
