//! Conversion between the `image` crate's pictures and OpenCV's matrices. Views where OpenCV only reads; copies where
//! it owns the result.

use image::{GrayImage, RgbImage};
use opencv::boxed_ref::{BoxedRef, BoxedRefMut};
use opencv::core::{Mat, Vec3b};

use crate::{Error, Result};

/// Converts an OpenCV error, naming the operation under way.
pub(super) fn refused(doing: &'static str) -> impl Fn(opencv::Error) -> Error {
    move |e| Error::OpenCv { doing, message: e.message.replace('\n', " ") }
}

/// View of a grey image's bytes as a matrix, without a copy.
pub(super) fn gray(image: &GrayImage) -> Result<BoxedRef<'_, Mat>> {
    Mat::new_rows_cols_with_bytes::<u8>(image.height() as i32, image.width() as i32, image.as_raw())
        .map_err(refused("looking at a grey image"))
}

/// View of a grey image's bytes as a matrix that can be written to.
pub(super) fn gray_mut(image: &mut GrayImage) -> Result<BoxedRefMut<'_, Mat>> {
    let (width, height) = image.dimensions();
    Mat::new_rows_cols_with_bytes_mut::<u8>(height as i32, width as i32, image.as_mut())
        .map_err(refused("looking at a grey image"))
}

/// View of a colour image's bytes (red first) as a matrix, without a copy.
pub(super) fn rgb(image: &RgbImage) -> Result<BoxedRef<'_, Mat>> {
    Mat::new_rows_cols_with_bytes::<Vec3b>(image.height() as i32, image.width() as i32, image.as_raw())
        .map_err(refused("looking at a colour image"))
}

/// View of a colour image's bytes (red first) as a matrix that can be written to.
pub(super) fn rgb_mut(image: &mut RgbImage) -> Result<BoxedRefMut<'_, Mat>> {
    let (width, height) = image.dimensions();
    Mat::new_rows_cols_with_bytes_mut::<Vec3b>(height as i32, width as i32, image.as_mut())
        .map_err(refused("looking at a colour image"))
}
