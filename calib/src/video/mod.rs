//! Pictures in and films out: the project's one door to FFmpeg.
//!
//! Pictures cross this door as the `image` crate's [`image::RgbImage`]; no FFmpeg type appears in any signature.
//!
//! * [`FrameSource`] — frames from whatever a user points at: a video, a folder of images, a printf pattern, the URL of
//!   a stream, the number of a device.
//! * [`FrameStamp`] — times of a frame on its source's clock, the sender's and ours.
//! * [`FilmWriter`] — an MP4 film, whole or not at all.

use std::path::Path;
use std::sync::Once;

use crate::Error;

mod container;
mod decoder;
#[cfg(target_os = "linux")]
mod device;
mod extent;
mod images;
mod pixels;
mod source;
mod stamp;
#[cfg(test)]
mod tests;
mod writer;

pub use source::FrameSource;
pub use stamp::FrameStamp;
pub use writer::FilmWriter;

/// Makes FFmpeg ready, the first time; without this its errors have no words.
fn start_ffmpeg() -> Result<(), ffmpeg::Error> {
    static STARTED: Once = Once::new();
    let mut started = Ok(());
    STARTED.call_once(|| started = ffmpeg::init());
    started
}

/// A source that was found, but cannot be used.
fn content(path: &Path, place: &str, problem: &str) -> Error {
    Error::Content { path: path.to_owned(), place: place.to_owned(), problem: problem.to_owned() }
}
