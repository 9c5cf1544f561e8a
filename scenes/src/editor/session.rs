//! The room that is edited: loading, queries for places and outlines, saving.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use nalgebra::{Point2, Point3, Vector2};
use serde::{Deserialize, Serialize};

use super::outline::{ImageOutline, OutlineDrawer};
use super::picture::{self, Picture, PlanPicture};
use super::walls::{self, Wall};
use crate::Result;
use crate::polygon::Polygon;
use crate::raycast::RayScene;
use crate::room::{Drawing, EditedDrawing, OnConflict, Room, RoomCamera, SceneVersion, save_drawing};
use crate::space::{CameraPlace, surfaces};
use crate::visibility::{floor_under, is_hidden};
use crate::walkable::{self, unreachable};

/// A room directory while its drawing is edited. Several pages may show it, and other programs may change it: what each
/// saves is merged with what the others did.
pub struct Session {
    dir: PathBuf,
    state: Mutex<SessionState>,
}

/// State that was last read or written.
struct SessionState {
    version: SceneVersion,
    drawing: Drawing,
    editor_room: Arc<EditorRoom>,
}

/// The part of the room that is drawn on and does not change.
pub(super) struct EditorRoom {
    dir: PathBuf,
    /// The room without its drawing.
    room: Room,
    scene: Option<RayScene>,
    walls: Vec<Wall>,
    plan: PlanPicture,
    /// Pictures by camera, made at the first request.
    pictures: Mutex<HashMap<String, Arc<Picture>>>,
    /// Surfaces for the 3-D view, made at the first request.
    surfaces: OnceLock<Vec<u8>>,
}

/// Description of a room for the page.
#[derive(Serialize)]
pub(super) struct RoomReply {
    name: String,
    version: SceneVersion,
    cameras: Vec<CameraReply>,
    drawing: Drawing,
    /// Whether the walkable floor is derived from a geometry where it is not drawn.
    has_geometry: bool,
    walls: Vec<Wall>,
    plan: PlanReply,
}

#[derive(Serialize)]
struct CameraReply {
    #[serde(flatten)]
    place: CameraPlace,
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

/// A polygon, or an open line while it is being drawn.
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
    /// Number of corners of all polygons together.
    pub(super) fn corners(&self) -> usize {
        self.zones.iter().map(|zone| zone.polygon.0.len()).sum()
    }
}

/// Outlines in a camera, in the order of the request.
#[derive(Serialize)]
pub(super) struct OutlinesReply {
    camera: String,
    outlines: Vec<ImageOutline>,
}

/// A place: a pixel of a camera, or metres on the floor.
#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub(super) enum PlaceRequest {
    Pixel { camera: String, pixel: Point2<f64> },
    Floor { floor: Point2<f64> },
}

/// A place of the floor, and its pixel in each camera; `None` where the pixel shows no floor.
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

/// A drawing to save, and the one that it was made from.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SaveRequest {
    base: Drawing,
    edited: EditedDrawing,
    #[serde(default)]
    on_conflict: OnConflict,
}

/// Version now on disk, and warnings about it.
#[derive(Serialize)]
pub(super) struct SaveReply {
    version: SceneVersion,
    /// Whether the drawing has changes of other programs besides.
    merged: bool,
    /// Whether other programs had changed the file, so that the page should load it.
    changed: bool,
    warnings: Vec<String>,
}

impl Session {
    /// Reads a room and prepares the pictures that it is drawn on; they are kept in the room's cache.
    ///
    /// # Errors
    /// As [`Room::read`]; [`crate::Error::Geometry`] when the geometry cannot be intersected.
    pub fn open(dir: &Path) -> Result<Self> {
        Ok(Self { dir: dir.to_owned(), state: Mutex::new(SessionState::load(dir)?) })
    }

    /// Describes the room as it is on disk; reads it again if another program has changed it.
    pub(super) fn room(&self) -> Result<RoomReply> {
        let mut state = self.state();
        if SceneVersion::of(&self.dir)? != state.version {
            *state = SessionState::load(&self.dir)?;
        }
        let EditorRoom { room, plan, walls, .. } = &*state.editor_room;
        let camera = |entry: &RoomCamera| {
            let (width, height) = (entry.camera.intrinsics.width, entry.camera.intrinsics.height);
            CameraReply { place: CameraPlace::of(entry), width, height }
        };
        Ok(RoomReply {
            name: name_of(&self.dir),
            version: state.version.clone(),
            cameras: room.cameras.iter().map(camera).collect(),
            drawing: state.drawing.clone(),
            has_geometry: room.geometry.is_some(),
            walls: walls.clone(),
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

    /// The part of the room that is drawn on.
    pub(super) fn editor_room(&self) -> Arc<EditorRoom> {
        Arc::clone(&self.state().editor_room)
    }

    /// Writes a drawing into the room's `scene.toml`.
    ///
    /// # Errors
    /// As [`save_drawing`]; as [`Self::open`] where other programs have changed the room.
    pub(super) fn save(&self, request: &SaveRequest) -> Result<SaveReply> {
        // The lock is held until the file is written: pages save one after the other.
        let mut state = self.state();
        let version_before = SceneVersion::of(&self.dir)?;
        let saved = save_drawing(&self.dir, &request.base, &request.edited, request.on_conflict)?;
        let is_changed = version_before != state.version;
        if is_changed {
            *state = SessionState::load(&self.dir)?;
        } else {
            state.version = saved.version.clone();
            state.drawing.clone_from(&saved.drawing);
        }
        // The same room and the same map as the tracker reads.
        let mut room = state.editor_room.room.clone();
        saved.drawing.put(&mut room);
        let warnings = unreachable(&room, &walkable::cached(&self.dir, &room)?);
        Ok(SaveReply { version: saved.version, merged: saved.is_merged, changed: is_changed, warnings })
    }

    /// Warnings of sizes that no room is likely to have, as [`Room::odd_sizes`].
    pub fn odd_sizes(&self) -> Vec<String> {
        let state = self.state();
        let mut room = state.editor_room.room.clone();
        state.drawing.clone().put(&mut room);
        room.odd_sizes()
    }

    fn state(&self) -> MutexGuard<'_, SessionState> {
        // A thread that panics leaves no half-changed state: each change is one assignment of whole values.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Name of the directory, for the page's title.
fn name_of(dir: &Path) -> String {
    let whole = dir.canonicalize().unwrap_or_else(|_| dir.to_owned());
    whole.file_name().map_or_else(|| whole.display().to_string(), |name| name.to_string_lossy().into_owned())
}

impl SessionState {
    fn load(dir: &Path) -> Result<Self> {
        // The version is read first: a change between the two reads is then noticed when a drawing is saved.
        let version = SceneVersion::of(dir)?;
        let mut room = Room::read(dir)?;
        let walkable = walkable::cached(dir, &room)?;
        let drawing = Drawing::take(&mut room);
        let scene = room.geometry.as_ref().map(RayScene::new).transpose()?;
        let walls = room.geometry.as_ref().map(walls::walls).unwrap_or_default();
        let plan = picture::plan(dir, &room, &drawing, &walkable)?;
        let (dir, pictures, surfaces) = (dir.to_owned(), Mutex::default(), OnceLock::new());
        let editor_room = EditorRoom { dir, room, scene, walls, plan, pictures, surfaces };
        Ok(Self { version, drawing, editor_room: Arc::new(editor_room) })
    }
}

impl EditorRoom {
    /// The plan's picture.
    pub(super) fn plan(&self) -> &Picture {
        &self.plan.picture
    }

    /// The room's surfaces for the 3-D view; empty without geometry.
    pub(super) fn surfaces(&self) -> &[u8] {
        self.surfaces.get_or_init(|| surfaces::of_room(&self.room).unwrap_or_default())
    }

    /// Picture of the camera of that name.
    ///
    /// # Errors
    /// [`crate::Error::UnknownCamera`]; [`crate::Error::Room`] when the picture cannot be encoded.
    pub(super) fn picture(&self, camera: &str) -> Result<Arc<Picture>> {
        let entry = self.room.camera(camera)?;
        // The lock is held while a picture is made: rendering keeps all cores busy by itself.
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
            let drawer = OutlineDrawer::new(&camera.camera, self.scene.as_ref());
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
