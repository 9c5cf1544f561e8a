//! Serialised form of `scene.toml`. Unknown keys are an error: most are misspelt known ones.

use std::path::PathBuf;

use calib::files::{matrix_from_rows, rows_of_matrix};
use calib::{Camera, Distortion, Intrinsics, LensModel};
use nalgebra::{Isometry3, Translation3};
use serde::{Deserialize, Serialize};

use super::{Geo, Line, Region, Room, RoomCamera, Source, Zone};
use crate::polygon::Polygon;

/// The only version of the format.
pub(super) const FORMAT: i64 = 1;

/// Version of the format, parsed before everything else, so that a newer format is not reported as a misspelt key.
#[derive(Deserialize)]
pub(super) struct Version {
    pub(super) format: i64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    pub(super) format: i64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) geometry: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) floor: Option<FloorTable>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) geo: Option<Geo>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) source: Option<Source>,
    #[serde(default)]
    pub(super) camera: Vec<CameraTable>,
    // An empty `zone = []` would forbid that a table is appended by hand.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) zone: Vec<Zone>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) region: Vec<Region>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) line: Vec<Line>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FloorTable {
    pub(super) walkable: Option<Vec<Polygon>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CameraTable {
    pub(super) name: String,
    width: u32,
    height: u32,
    matrix: [[f64; 3]; 3],
    #[serde(default, skip_serializing_if = "LensModel::is_default")]
    lens: LensModel,
    distortion: Option<Vec<f64>>,
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<PathBuf>,
}

impl CameraTable {
    /// Converts to a camera, or names the invalid key and its problem.
    pub(super) fn camera(self) -> Result<RoomCamera, (&'static str, String)> {
        let distortion = Distortion::from_file(self.lens, self.distortion.as_deref())
            .map_err(|problem| ("lens, distortion", problem))?;
        let intrinsics =
            Intrinsics::from_matrix(self.width, self.height, &matrix_from_rows(&self.matrix), distortion)
                .map_err(|e| ("width, height, matrix, distortion", e.to_string()))?;
        let rotation = calib::rotation::from_matrix(&matrix_from_rows(&self.rotation))
            .map_err(|e| ("rotation", e.to_string()))?;
        let camera_from_world = Isometry3::from_parts(Translation3::from(self.translation), rotation);
        let camera = Camera { intrinsics, camera_from_world };
        Ok(RoomCamera { name: self.name, camera, reference: self.reference })
    }

    fn of(camera: &RoomCamera) -> Self {
        let RoomCamera { name, camera: Camera { intrinsics, camera_from_world }, reference } = camera;
        Self {
            name: name.clone(),
            width: intrinsics.width,
            height: intrinsics.height,
            matrix: rows_of_matrix(&intrinsics.matrix()),
            lens: intrinsics.distortion.model(),
            distortion: Some(intrinsics.distortion.coefficients()),
            rotation: rows_of_matrix(camera_from_world.rotation.to_rotation_matrix().matrix()),
            translation: camera_from_world.translation.vector.into(),
            reference: reference.clone(),
        }
    }
}

impl SceneFile {
    /// File of a room whose geometry, if it has any, is in the file `geometry`.
    pub(super) fn of(room: &Room, geometry: &str) -> Self {
        Self {
            format: FORMAT,
            geometry: room.geometry.as_ref().map(|_| geometry.into()),
            floor: room.walkable.clone().map(|polygons| FloorTable { walkable: Some(polygons) }),
            camera: room.cameras.iter().map(CameraTable::of).collect(),
            zone: room.zones.clone(),
            region: room.regions.clone(),
            line: room.lines.clone(),
            geo: room.geo,
            source: room.source,
        }
    }
}
