//! From the decoders' pixel formats to red, green and blue, and back for the encoder.
//!
//! libswscale as OpenCV's `VideoCapture` uses it (bicubic chroma, BT.601), so that a film has the same colours here as in
//! the tools that our users know.

use std::cell::RefCell;

use ffmpeg::format::Pixel;
use ffmpeg::frame;
use ffmpeg::software::scaling::{Context, Flags};
use image::RgbImage;

thread_local! {
    /// libswscale's tables for the last few kinds of picture that this thread has converted. They cannot move between
    /// threads as film sources do, hence they do not live there.
    static CONVERTERS: RefCell<Vec<Context>> = const { RefCell::new(Vec::new()) };
}

/// As many as a thread may need by turns: a rig of cameras of different makes, and a film that is written.
const CONVERTERS_KEPT: usize = 8;

/// Converts `from` into `to`, which has the same size; an empty `to` is given one, in `format`.
pub(super) fn convert(
    from: &frame::Video,
    to: &mut frame::Video,
    format: Pixel,
) -> Result<(), ffmpeg::Error> {
    CONVERTERS.with_borrow_mut(|converters| {
        let (width, height) = (from.width(), from.height());
        let found = converters.iter().position(|converter| {
            let (input, output) = (converter.input(), converter.output());
            (input.format, input.width, input.height) == (from.format(), width, height)
                && output.format == format
        });
        let place = if let Some(place) = found {
            place
        } else {
            let made = Context::get(from.format(), width, height, format, width, height, Flags::BICUBIC)?;
            if converters.len() == CONVERTERS_KEPT {
                converters.remove(0);
            }
            converters.push(made);
            converters.len() - 1
        };
        converters[place].run(from, to)
    })
}

/// The pixels of a frame of [`Pixel::RGB24`] into an image of its size.
pub(super) fn copy_rgb(frame: &frame::Video, into: &mut RgbImage) {
    let row_bytes = 3 * frame.width() as usize;
    let lines = frame.data(0).chunks(frame.stride(0));
    for (row, line) in into.chunks_exact_mut(row_bytes).zip(lines) {
        row.copy_from_slice(&line[..row_bytes]);
    }
}

/// The pixels of an image into a frame of [`Pixel::RGB24`] of its size.
pub(super) fn paste_rgb(image: &RgbImage, into: &mut frame::Video) {
    let (row_bytes, stride) = (3 * image.width() as usize, into.stride(0));
    let lines = into.data_mut(0).chunks_mut(stride);
    for (row, line) in image.chunks_exact(row_bytes).zip(lines) {
        line[..row_bytes].copy_from_slice(row);
    }
}
