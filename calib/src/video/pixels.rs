//! Conversion of the decoders' pixel formats to red, green and blue, and back for the encoder.
//!
//! libswscale with the settings of OpenCV's `VideoCapture` (bicubic chroma, BT.601), so that a film has the same
//! colours here as in the tools that our users know.

use std::cell::RefCell;

use ffmpeg::format::Pixel;
use ffmpeg::frame;
use ffmpeg::software::scaling::{Context, Flags};
use image::{Rgb, RgbImage};

thread_local! {
    /// libswscale's tables for the last few kinds of conversion on this thread, the latest last. They cannot move
    /// between threads as film sources do, so film sources do not hold them.
    static CONVERTERS: RefCell<Vec<Context>> = const { RefCell::new(Vec::new()) };
}

/// Number of tables kept for a thread: enough for a rig of cameras of different makes, each at the size of its masks
/// and at that of a film.
const CONVERTERS_KEPT: usize = 32;

/// Number of sizes kept for one source: its own, that of the masks, that of a film, and one to spare.
const SIZES_KEPT: usize = 4;

/// Converts `from` into `to` at the size and format that `to` already has.
pub(super) fn convert(from: &frame::Video, to: &mut frame::Video) -> Result<(), ffmpeg::Error> {
    CONVERTERS.with_borrow_mut(|converters| {
        let found = converters.iter().position(|converter| {
            let (input, output) = (converter.input(), converter.output());
            (input.format, input.width, input.height) == (from.format(), from.width(), from.height())
                && (output.format, output.width, output.height) == (to.format(), to.width(), to.height())
        });
        let mut converter = match found {
            Some(place) => converters.remove(place),
            None => converter(from, to)?,
        };
        if converters.len() == CONVERTERS_KEPT {
            converters.remove(0);
        }
        let converted = converter.run(from, to);
        converters.push(converter);
        converted
    })
}

/// Chooses area averaging where a picture shrinks, bicubic otherwise; at the same size bicubic affects the chroma
/// only.
fn converter(from: &frame::Video, to: &frame::Video) -> Result<Context, ffmpeg::Error> {
    let ((w, h), (width, height)) = ((from.width(), from.height()), (to.width(), to.height()));
    let shrinks = (w, h) != (width, height) && width <= w && height <= h;
    let flags = if shrinks { Flags::AREA | Flags::ACCURATE_RND } else { Flags::BICUBIC };
    Context::get(from.format(), w, h, to.format(), width, height, flags)
}

/// Buffers through which a source's frames become images, one for each size that is asked for.
pub(super) struct RgbBuffers(Vec<frame::Video>);

impl RgbBuffers {
    pub(super) const fn new() -> Self {
        Self(Vec::new())
    }

    /// Converts `from` into `into` at the size of `into`, colours and size in one pass of libswscale, and brings it
    /// upright afterwards.
    pub(super) fn picture(
        &mut self,
        from: &frame::Video,
        orientation: Orientation,
        into: &mut RgbImage,
    ) -> Result<(), ffmpeg::Error> {
        let (width, height) = orientation.size(into.dimensions());
        let found = self.0.iter().position(|buffer| (buffer.width(), buffer.height()) == (width, height));
        let mut buffer = match found {
            Some(place) => self.0.remove(place),
            None => frame::Video::new(Pixel::RGB24, width, height),
        };
        if self.0.len() == SIZES_KEPT {
            self.0.remove(0);
        }
        let converted = convert(from, &mut buffer);
        if converted.is_ok() {
            copy_upright(&buffer, orientation, into);
        }
        self.0.push(buffer);
        converted
    }
}

/// Way in which a stored picture is shown: mirrored left to right if so, and then turned clockwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Orientation {
    pub(super) is_mirrored: bool,
    pub(super) quarter_turns: u8,
}

impl Orientation {
    /// As stored.
    pub(super) const UPRIGHT: Self = Self { is_mirrored: false, quarter_turns: 0 };

    /// Width and height of a picture as it is shown.
    pub(super) fn size(self, (width, height): (u32, u32)) -> (u32, u32) {
        if self.quarter_turns.is_multiple_of(2) { (width, height) } else { (height, width) }
    }
}

/// Copies a frame of [`Pixel::RGB24`], brought upright, into an image of the size that it then has.
fn copy_upright(frame: &frame::Video, orientation: Orientation, into: &mut RgbImage) {
    if orientation == Orientation::UPRIGHT {
        copy_rgb(frame, into);
        return;
    }
    let (width, height) = (frame.width(), frame.height());
    for (y, line) in (0..height).zip(frame.data(0).chunks(frame.stride(0))) {
        for (stored_x, pixel) in (0..width).zip(line.as_chunks::<3>().0) {
            let x = if orientation.is_mirrored { width - 1 - stored_x } else { stored_x };
            let (column, row) = match orientation.quarter_turns {
                0 => (x, y),
                1 => (height - 1 - y, x),
                2 => (width - 1 - x, height - 1 - y),
                _ => (y, width - 1 - x),
            };
            into.put_pixel(column, row, Rgb(*pixel));
        }
    }
}

/// Copies a frame of [`Pixel::RGB24`] into an image of its size.
fn copy_rgb(frame: &frame::Video, into: &mut RgbImage) {
    let row_bytes = 3 * frame.width() as usize;
    let lines = frame.data(0).chunks(frame.stride(0));
    for (row, line) in into.chunks_exact_mut(row_bytes).zip(lines) {
        row.copy_from_slice(&line[..row_bytes]);
    }
}

/// Copies an image into a frame of [`Pixel::RGB24`] of its size.
pub(super) fn paste_rgb(image: &RgbImage, into: &mut frame::Video) {
    let (row_bytes, stride) = (3 * image.width() as usize, into.stride(0));
    let lines = into.data_mut(0).chunks_mut(stride);
    for (row, line) in image.chunks_exact(row_bytes).zip(lines) {
        line[..row_bytes].copy_from_slice(row);
    }
}
