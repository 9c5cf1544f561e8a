//! Between the `image` crate's pictures and OpenCV's matrices. Views where OpenCV only reads; copies where it
//! owns the result.

use image::{GrayImage, RgbImage};
use opencv::boxed_ref::{BoxedRef, BoxedRefMut};
use opencv::core::{Mat, Vec3b};

use crate::{Error, Result};

/// Names what was being done when OpenCV refuses.
pub(super) fn refused(doing: &'static str) -> impl Fn(opencv::Error) -> Error {
    move |e| Error::OpenCv { doing, message: e.message.replace('\n', " ") }
}

/// The same bytes as OpenCV sees them, without a copy.
pub(super) fn gray(image: &GrayImage) -> Result<BoxedRef<'_, Mat>> {
    Mat::new_rows_cols_with_bytes::<u8>(image.height() as i32, image.width() as i32, image.as_raw())
        .map_err(refused("looking at a grey image"))
}

/// The same bytes as OpenCV sees them, to be written into.
pub(super) fn gray_mut(image: &mut GrayImage) -> Result<BoxedRefMut<'_, Mat>> {
    let (width, height) = image.dimensions();
    Mat::new_rows_cols_with_bytes_mut::<u8>(height as i32, width as i32, image.as_mut())
        .map_err(refused("looking at a grey image"))
}

/// The same bytes as OpenCV sees them (red first), without a copy.
pub(super) fn rgb(image: &RgbImage) -> Result<BoxedRef<'_, Mat>> {
    Mat::new_rows_cols_with_bytes::<Vec3b>(image.height() as i32, image.width() as i32, image.as_raw())
        .map_err(refused("looking at a colour image"))
}

/// The same bytes as OpenCV sees them (red first), to be written into.
pub(super) fn rgb_mut(image: &mut RgbImage) -> Result<BoxedRefMut<'_, Mat>> {
    let (width, height) = image.dimensions();
    Mat::new_rows_cols_with_bytes_mut::<Vec3b>(height as i32, width as i32, image.as_mut())
        .map_err(refused("looking at a colour image"))
}
