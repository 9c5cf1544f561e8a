//! Pictures in and films out: the only module that calls FFmpeg.
//!
//! Pictures cross this boundary as the `image` crate's [`image::RgbImage`]; no FFmpeg type appears in any signature.
//!
//! * [`FrameSource`] — frames from any source that a user names: a video, a folder of images, a printf pattern, the URL
//!   of a stream, the number of a device.
//! * [`FrameStamp`] — times of a frame on its source's clock, the sender's and ours.
//! * [`creation_time`] — time at which a video was recorded, as its container states it.
//! * [`FilmWriter`] — an MP4 film, under a temporary name until it is finished; [`complete_film`] completes that of a
//!   program that was killed.

use std::sync::Once;

mod container;
mod creation;
mod decoder;
#[cfg(target_os = "linux")]
mod device;
mod extent;
mod images;
mod name_order;
mod pixels;
mod remux;
mod source;
mod stamp;
#[cfg(test)]
mod tests;
mod writer;

pub use creation::creation_time;
pub use source::FrameSource;
pub use stamp::FrameStamp;
pub use writer::{FilmWriter, complete_film};

/// Initialises FFmpeg on the first call; without it FFmpeg's errors have no text.
fn start_ffmpeg() -> Result<(), ffmpeg::Error> {
    static STARTED: Once = Once::new();
    let mut started = Ok(());
    STARTED.call_once(|| started = ffmpeg::init());
    started
}
