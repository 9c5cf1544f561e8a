//! Depth maps as 16-bit PNG: millimetres along the camera's z, 0 = nothing.

use std::io::Cursor;
use std::path::Path;

use image::{DynamicImage, ImageBuffer, ImageFormat, Luma};
use shell::files::FileError;

use super::DepthMap;
use crate::{Error, Result};

/// Writes a depth map, rounded to the millimetre and clamped to 1 mm … 65.535 m, so that a surface never becomes an
/// empty pixel; the file is replaced in one step.
///
/// # Errors
/// [`Error::Calib`] when the file cannot be written.
pub fn write(path: &Path, map: &DepthMap) -> Result<()> {
    let millimetres = |&z: &f32| if z > 0.0 { (z * 1000.0).round().clamp(1.0, 65_535.0) as u16 } else { 0 };
    let pixels: Vec<u16> = map.z_m.iter().map(millimetres).collect();
    let picture = ImageBuffer::<Luma<u16>, _>::from_raw(map.width, map.height, pixels)
        .ok_or_else(|| Error::content(path, "image", "the depth map's size and its numbers do not agree"))?;
    let mut bytes = Cursor::new(Vec::new());
    DynamicImage::ImageLuma16(picture)
        .write_to(&mut bytes, ImageFormat::Png)
        .map_err(|e| Error::content(path, "image", e.to_string()))?;
    Ok(calib::files::write_atomic(path, bytes.get_ref())?)
}

/// Reads a depth map written by [`write()`].
///
/// # Errors
/// [`Error::File`] when it is no 16-bit grey PNG.
pub fn read(path: &Path) -> Result<DepthMap> {
    let bytes = std::fs::read(path).map_err(Error::io(path))?;
    let decoded = calib::picture::decode(path, &bytes).map_err(|e| match e {
        calib::Error::File(FileError::Content { problem, .. }) => {
            Error::content(path, "image", format!("this is no PNG that can be read: {problem}"))
        }
        other => other.into(),
    })?;
    let DynamicImage::ImageLuma16(picture) = decoded else {
        return Err(Error::content(path, "image", "a depth map is a 16-bit grey PNG (millimetres)"));
    };
    let (width, height) = picture.dimensions();
    Ok(DepthMap { width, height, z_m: picture.iter().map(|&mm| f32::from(mm) / 1000.0).collect() })
}
