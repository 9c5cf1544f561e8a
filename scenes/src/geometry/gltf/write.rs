//! Writing of GLB: one mesh with colours, turned to the Y up of the format by its node.

use serde_json::json;

use super::{BINARY_CHUNK, JSON_CHUNK, MAGIC};
use crate::geometry::Mesh;
use crate::geometry::texture::light_of_level;
use crate::{Error, Result};

/// Columns of the turn from the room's Z up to Y up: x stays, y becomes −z, z becomes y.
const Y_UP_FROM_Z_UP: [f32; 16] =
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// Encodes a mesh as a GLB file.
///
/// # Errors
/// [`Error::Geometry`] for a mesh too large for the format (4 GiB).
pub fn encode(mesh: &Mesh) -> Result<Vec<u8>> {
    let too_large =
        || Error::Geometry("the mesh is too large for a GLB file (4 GiB); export it as ply".into());
    let mut binary: Vec<u8> = Vec::with_capacity(20 * mesh.vertices.len() + 12 * mesh.triangles.len());
    mesh.vertices.iter().flat_map(glam::Vec3::to_array).for_each(|value| binary.extend(value.to_le_bytes()));
    let colors_at = binary.len();
    for color in &mesh.colors {
        // The format has amounts of light, of which 8 bits would be too few for dark colours.
        let light = color.map(|level| (65_535.0 * light_of_level(f32::from(level) / 255.0)).round() as u16);
        light.into_iter().chain([u16::MAX]).for_each(|value| binary.extend(value.to_le_bytes()));
    }
    let indices_at = binary.len();
    mesh.triangles.iter().flatten().for_each(|index| binary.extend(index.to_le_bytes()));
    let (low, high) =
        mesh.vertices.iter().fold((glam::Vec3::INFINITY, glam::Vec3::NEG_INFINITY), |(low, high), vertex| {
            (low.min(*vertex), high.max(*vertex))
        });
    let (count, corners) = (mesh.vertices.len(), 3 * mesh.triangles.len());
    let document = json!({
        "asset": {"version": "2.0", "generator": concat!("roomtrack ", env!("CARGO_PKG_VERSION"))},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "room", "mesh": 0, "matrix": Y_UP_FROM_Z_UP}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}]}],
        // Seen from both sides: a room is looked at from outside, too.
        "materials": [{"doubleSided": true, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}],
        "buffers": [{"byteLength": binary.len()}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": colors_at, "target": 34962},
            {"buffer": 0, "byteOffset": colors_at, "byteLength": indices_at - colors_at, "target": 34962},
            {"buffer": 0, "byteOffset": indices_at, "byteLength": binary.len() - indices_at, "target": 34963},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3", "min": low.to_array(), "max": high.to_array()},
            {"bufferView": 1, "componentType": 5123, "normalized": true, "count": count, "type": "VEC4"},
            {"bufferView": 2, "componentType": 5125, "count": corners, "type": "SCALAR"},
        ],
    });
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let total = u32::try_from(total).map_err(|_| too_large())?;
    let mut bytes = Vec::with_capacity(total as usize);
    bytes.extend(MAGIC);
    bytes.extend(2_u32.to_le_bytes());
    bytes.extend(total.to_le_bytes());
    for (kind, chunk) in [(JSON_CHUNK, &json), (BINARY_CHUNK, &binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(chunk);
    }
    Ok(bytes)
}
