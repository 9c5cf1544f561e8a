//! Time at which a video was recorded, as its container states it.

use std::path::Path;

use ffmpeg::format;

use crate::{Error, Result};

/// Text of a video file's `creation_time`: RFC 3339, in UTC. `None` where the container states none.
///
/// # Errors
/// [`Error::File`] when FFmpeg cannot open the file.
pub fn creation_time(path: &Path) -> Result<Option<String>> {
    let fail = |e: ffmpeg::Error| {
        Error::content(path, "whole file", format!("is no video that FFmpeg can open ({e})"))
    };
    super::start_ffmpeg().map_err(fail)?;
    // The prefix keeps a name with a colon from being read as a protocol's.
    let input = format::input(&format!("file:{}", path.display())).map_err(fail)?;
    Ok(input.metadata().get("creation_time").map(str::to_owned))
}
