//! The room that is edited: loaded, asked about places and outlines, saved.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use nalgebra::{Point2, Point3, Vector2};
use serde::{Deserialize, Serialize};

use super::outline::{Drawer, Outline};
use super::picture::{self, Picture, Plan};
use crate::Result;
use crate::polygon::Polygon;
use crate::raycast::RayScene;
use crate::room::{Room, RoomCamera, SceneVersion, Zone, replace_zones};
use crate::sight::{floor_under, is_hidden};
use crate::walkable::WalkableMap;

/// A room directory while its zones are edited. Several pages may look at it; who saves first wins.
pub struct Session {
    dir: PathBuf,
    state: Mutex<State>,
}

/// What was last read or written.
struct State {
    version: SceneVersion,
    zones: Vec<Zone>,
    stage: Arc<Stage>,
}

/// What no zone changes, and zones are drawn on.
pub(super) struct Stage {
    dir: PathBuf,
    /// Without its zones.
    room: Room,
    scene: Option<RayScene>,
    /// Where people can stand as the room has it, whatever zones are drawn.
    walkable: WalkableMap,
    plan: Plan,
    /// By camera, made when somebody looks.
    pictures: Mutex<HashMap<String, Arc<Picture>>>,
}

/// What the page is told of a room.
#[derive(Serialize)]
pub(super) struct RoomReply {
    name: String,
    version: SceneVersion,
    cameras: Vec<CameraReply>,
    zones: Vec<Zone>,
    plan: PlanReply,
}

#[derive(Serialize)]
struct CameraReply {
    name: String,
    width: u32,
    height: u32,
}

/// Size in pixels; the pixel of a place (x, y) is `corner_px + ((x, y) − (low.x, high.y)) · (1, −1) · px_per_m`.
#[derive(Serialize)]
struct PlanReply {
    width: u32,
    height: u32,
    low: Point2<f64>,
    high: Point2<f64>,
    px_per_m: f64,
    corner_px: Vector2<f64>,
}

/// Outlines to draw in every camera.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct OutlinesRequest {
    zones: Vec<Drawn>,
}

/// A polygon, or while it is being drawn a line.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Drawn {
    polygon: Polygon,
    #[serde(default = "yes")]
    closed: bool,
}

fn yes() -> bool {
    true
}

impl OutlinesRequest {
    /// Corners of all polygons together.
    pub(super) fn corners(&self) -> usize {
        self.zones.iter().map(|zone| zone.polygon.0.len()).sum()
    }
}

/// The outlines in a camera, in the order they were asked for.
#[derive(Serialize)]
pub(super) struct OutlinesReply {
    camera: String,
    outlines: Vec<Outline>,
}

/// A place: a pixel of a camera, or metres on the floor.
#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub(super) enum PlaceRequest {
    Pixel { camera: String, pixel: Point2<f64> },
    Floor { floor: Point2<f64> },
}

/// A place of the floor, and where each camera has it; none where the pixel shows no floor.
#[derive(Serialize)]
pub(super) struct PlaceReply {
    floor: Option<Point2<f64>>,
    cameras: Vec<PixelReply>,
}

#[derive(Serialize)]
struct PixelReply {
    camera: String,
    pixel: Option<Point2<f64>>,
    hidden: bool,
}

/// Zones to save, and what they were made from.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ZonesRequest {
    zones: Vec<Zone>,
    version: SceneVersion,
}

/// What is on disk now, and what is odd about it.
#[derive(Serialize)]
pub(super) struct ZonesReply {
    version: SceneVersion,
    warnings: Vec<String>,
}

impl Session {
    /// Reads a room and prepares what zones are drawn on; that is kept in the room's cache.
    ///
    /// # Errors
    /// As [`Room::read`]; [`crate::Error::Geometry`] when the geometry cannot be intersected.
    pub fn open(dir: &Path) -> Result<Self> {
        Ok(Self { dir: dir.to_owned(), state: Mutex::new(State::load(dir)?) })
    }

    /// The room as it is on disk; read again if somebody else has changed it.
    pub(super) fn room(&self) -> Result<RoomReply> {
        let mut state = self.state();
        if SceneVersion::of(&self.dir)? != state.version {
            *state = State::load(&self.dir)?;
        }
        let Stage { room, plan, .. } = &*state.stage;
        let camera =
            |(name, width, height): (&String, u32, u32)| CameraReply { name: name.clone(), width, height };
        let sizes =
            room.cameras.iter().map(|c| (&c.name, c.camera.intrinsics.width, c.camera.intrinsics.height));
        Ok(RoomReply {
            name: name_of(&self.dir),
            version: state.version.clone(),
            cameras: sizes.map(camera).collect(),
            zones: state.zones.clone(),
            plan: PlanReply {
                width: plan.width,
                height: plan.height,
                low: plan.mapping.low,
                high: plan.mapping.high,
                px_per_m: plan.mapping.px_per_m,
                corner_px: plan.mapping.corner_px,
            },
        })
    }

    /// What zones are drawn on.
    pub(super) fn stage(&self) -> Arc<Stage> {
        Arc::clone(&self.state().stage)
    }

    /// Writes zones into the room's `scene.toml`.
    ///
    /// # Errors
    /// As [`replace_zones`].
    pub(super) fn save(&self, request: ZonesRequest) -> Result<ZonesReply> {
        // Held until the file is written: one page after the other.
        let mut state = self.state();
        let version = replace_zones(&self.dir, &request.zones, &request.version)?;
        let off_limits = |zone: &&Zone| !state.stage.walkable.reaches_into(&zone.polygon);
        let warning =
            |zone: &Zone| format!("zone `{}`: nobody can stand in it; move it, or mend [floor]", zone.name);
        let warnings = request.zones.iter().filter(off_limits).map(warning).collect();
        state.version = version.clone();
        state.zones = request.zones;
        Ok(ZonesReply { version, warnings })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // Nothing is left half changed by a thread that ended early: each change is one assignment of whole values.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The directory's own name, for the page's title.
fn name_of(dir: &Path) -> String {
    let whole = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    whole.file_name().map_or_else(|| whole.display().to_string(), |name| name.to_string_lossy().into_owned())
}

impl State {
    fn load(dir: &Path) -> Result<Self> {
        // The version first: a change between the two is then noticed when zones are saved.
        let version = SceneVersion::of(dir)?;
        let mut room = Room::read(dir)?;
        let zones = std::mem::take(&mut room.zones);
        let scene = room.geometry.as_ref().map(RayScene::new).transpose()?;
        let walkable = WalkableMap::of_room(&room)?;
        let plan = picture::plan(dir, &room, &zones, &walkable)?;
        let (dir, pictures) = (dir.to_owned(), Mutex::default());
        let stage = Stage { dir, room, scene, walkable, plan, pictures };
        Ok(Self { version, zones, stage: Arc::new(stage) })
    }
}

impl Stage {
    /// The plan's picture.
    pub(super) fn plan(&self) -> &Picture {
        &self.plan.picture
    }

    /// The picture of the camera of that name.
    ///
    /// # Errors
    /// [`crate::Error::UnknownCamera`]; [`crate::Error::Room`] when the picture cannot be encoded.
    pub(super) fn picture(&self, camera: &str) -> Result<Arc<Picture>> {
        let entry = self.room.camera(camera)?;
        // Held while a picture is made: rendering keeps all cores busy by itself.
        let mut pictures = self.pictures.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(picture) = pictures.get(camera) {
            return Ok(Arc::clone(picture));
        }
        let picture = Arc::new(picture::of_camera(&self.dir, &self.room, self.scene.as_ref(), entry)?);
        pictures.insert(camera.to_owned(), Arc::clone(&picture));
        Ok(picture)
    }

    /// Outlines in every camera, in the room's order.
    pub(super) fn outlines(&self, request: &OutlinesRequest) -> Vec<OutlinesReply> {
        let of_camera = |camera: &RoomCamera| {
            let drawer = Drawer::new(&camera.camera, self.scene.as_ref());
            let outlines = request.zones.iter().map(|zone| drawer.outline(&zone.polygon, zone.closed));
            OutlinesReply { camera: camera.name.clone(), outlines: outlines.collect() }
        };
        self.room.cameras.iter().map(of_camera).collect()
    }

    /// A place of the floor, in every camera.
    ///
    /// # Errors
    /// [`crate::Error::UnknownCamera`].
    pub(super) fn place(&self, request: &PlaceRequest) -> Result<PlaceReply> {
        let floor = match request {
            PlaceRequest::Pixel { camera, pixel } => floor_under(&self.room.camera(camera)?.camera, pixel),
            PlaceRequest::Floor { floor } => Some(*floor),
        };
        let scene = self.scene.as_ref();
        let seen = |entry: &RoomCamera, floor: Point2<f64>| PixelReply {
            camera: entry.name.clone(),
            pixel: entry.camera.project(&Point3::new(floor.x, floor.y, 0.0)),
            hidden: scene.is_some_and(|scene| is_hidden(scene, &entry.camera.center(), &floor)),
        };
        let cameras =
            floor.iter().flat_map(|floor| self.room.cameras.iter().map(|entry| seen(entry, *floor)));
        Ok(PlaceReply { floor, cameras: cameras.collect() })
    }
}
