//! Cache of a plan's ground, which rays render and which stays the same from run to run.

use std::path::Path;

use image::RgbImage;

use super::ground::{self, Raster};
use crate::geometry::Geometry;
use crate::{Result, cache};

/// Part of the key: change it when the drawing changes.
const DRAWING: &[u8] = b"plan 1";
const NAME: &str = "plan";

/// [`ground::picture`], from the cache of the room directory where that is up to date.
pub(super) fn picture(room_dir: &Path, geometry: &Geometry, raster: &Raster, cut_m: f32) -> Result<RgbImage> {
    let key = key(geometry, raster, cut_m);
    let cached = cache::read(room_dir, NAME, &key);
    if let Some(picture) = cached.and_then(|bytes| RgbImage::from_raw(raster.width, raster.height, bytes)) {
        return Ok(picture);
    }
    let picture = ground::picture(geometry, raster, cut_m)?;
    cache::write(room_dir, NAME, &key, picture.as_raw());
    Ok(picture)
}

fn key(geometry: &Geometry, raster: &Raster, cut_m: f32) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(DRAWING).update(geometry.shape_hash().as_bytes());
    match geometry {
        Geometry::Mesh(mesh) => {
            hasher.update(mesh.colors.as_flattened());
        }
        Geometry::Discs(discs) => {
            let colors: Vec<u8> = discs.iter().flat_map(|d| d.color).collect();
            hasher.update(&colors);
        }
    }
    hasher.update(&raster.width.to_le_bytes()).update(&raster.height.to_le_bytes());
    for value in [raster.origin.x, raster.origin.y, raster.pixel_m, cut_m] {
        hasher.update(&value.to_le_bytes());
    }
    hasher.finalize()
}
