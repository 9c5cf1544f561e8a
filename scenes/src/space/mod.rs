//! A room in 3-D on a page: its surfaces as points that a graphics card draws, its cameras, and the scripts that show both
//! and whatever else a page has in the room (WebGL 2). The zone editor's page and that of a run have it.
//!
//! * [`surfaces`] — the room's geometry in few bytes.
//! * [`CameraPlace`] — a camera as it stands in the room.
//! * [`SPACE_SCRIPT`], [`SOLIDS_SCRIPT`], [`SPACE_STYLE`] — the page's files; `space.js` says what a page gives it.

pub mod surfaces;

use nalgebra::{Point2, Point3};
use serde::Serialize;
use shell::loopback::PageFile;

use crate::room::RoomCamera;

/// Script of the 3-D view.
pub const SPACE_SCRIPT: PageFile = PageFile::script("/space.js", include_str!("page/space.js"));
/// Script of the matrices and meshes that the view needs.
pub const SOLIDS_SCRIPT: PageFile = PageFile::script("/solids.js", include_str!("page/solids.js"));
/// Style sheet of the view.
pub const SPACE_STYLE: PageFile = PageFile::css("/space.css", include_str!("page/space.css"));
/// Media type of the surfaces.
pub const SURFACES_TYPE: &str = "application/octet-stream";

/// Distance of a frustum's base from the camera, metres.
const FRUSTUM_M: f64 = 0.5;

/// Place of a camera in the room, for the page.
#[derive(Debug, Serialize)]
pub struct CameraPlace {
    name: String,
    center: Point3<f64>,
    /// Places of the image's corners before the camera, from the top left clockwise; fewer where the lens has no image.
    frustum: Vec<Point3<f64>>,
}

impl CameraPlace {
    /// Place of a room's camera.
    pub fn of(RoomCamera { name, camera, .. }: &RoomCamera) -> Self {
        let (center, k) = (camera.center(), &camera.intrinsics);
        let (right, bottom) = (f64::from(k.width) - 1.0, f64::from(k.height) - 1.0);
        let corners = [(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)];
        let rays = corners.into_iter().filter_map(|(u, v)| camera.ray(&Point2::new(u, v)));
        Self {
            name: name.clone(),
            center,
            frustum: rays.map(|ray| center + ray.into_inner() * FRUSTUM_M).collect(),
        }
    }
}
