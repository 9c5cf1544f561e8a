//! Films out: an MP4 that browsers and players open, whole or not at all.

use std::path::{Path, PathBuf};

use image::RgbImage;
use opencv::core::{Mat, Size};
use opencv::prelude::*;
use opencv::{imgproc, videoio};

use super::adapter;
use crate::{Error, Result};

/// Writes an MP4 film, frame by frame, under a temporary name until [`FilmWriter::finish`].
pub struct FilmWriter {
    target: PathBuf,
    partial: PathBuf,
    size: (u32, u32),
    writer: videoio::VideoWriter,
    bgr: Mat,
}

impl FilmWriter {
    /// Starts a film of `width` × `height` pixels (even numbers) at `rate` frames a second.
    ///
    /// H.264 where this OpenCV's ffmpeg has an encoder for it, MPEG-4 otherwise.
    ///
    /// # Errors
    /// When the folder cannot be made or no encoder opens.
    pub fn create(target: &Path, width: u32, height: u32, rate: f64) -> Result<Self> {
        if let Some(folder) = target.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|source| Error::Io { path: folder.to_owned(), source })?;
        }
        let partial = target.with_extension("partial.mp4");
        let opening = adapter::refused("opening a film for writing");
        let size = Size::new(width as i32, height as i32);
        for code in [['a', 'v', 'c', '1'], ['m', 'p', '4', 'v']] {
            let fourcc =
                videoio::VideoWriter::fourcc(code[0], code[1], code[2], code[3]).map_err(&opening)?;
            let writer = videoio::VideoWriter::new_with_backend(
                &partial,
                videoio::CAP_FFMPEG,
                fourcc,
                rate,
                size,
                true,
            )
            .map_err(&opening)?;
            if writer.is_opened().map_err(&opening)? {
                return Ok(Self {
                    target: target.to_owned(),
                    partial,
                    size: (width, height),
                    writer,
                    bgr: Mat::default(),
                });
            }
        }
        Err(Error::Content {
            path: target.to_owned(),
            place: format!("{width} × {height} at {rate} frames/s"),
            problem: "this OpenCV has no encoder that opens it; run with --no-film".into(),
        })
    }

    /// Appends one frame.
    ///
    /// # Errors
    /// A frame of another size than the film's.
    pub fn write(&mut self, frame: &RgbImage) -> Result<()> {
        if frame.dimensions() != self.size {
            return Err(Error::Invalid(format!(
                "a film of {:?} pixels was given a frame of {:?}",
                self.size,
                frame.dimensions()
            )));
        }
        let writing = adapter::refused("writing a film's frame");
        imgproc::cvt_color_def(&adapter::rgb(frame)?, &mut self.bgr, imgproc::COLOR_RGB2BGR)
            .map_err(&writing)?;
        self.writer.write(&self.bgr).map_err(&writing)
    }

    /// Closes the film and gives it its name.
    ///
    /// # Errors
    /// [`Error::Io`] when it cannot be renamed.
    pub fn finish(mut self) -> Result<()> {
        self.writer.release().map_err(adapter::refused("closing a film"))?;
        std::fs::rename(&self.partial, &self.target)
            .map_err(|source| Error::Io { path: self.target.clone(), source })
    }
}

impl Drop for FilmWriter {
    fn drop(&mut self) {
        // After `finish` nothing is left under this name; after an error or a panic a torn film is.
        let _ = std::fs::remove_file(&self.partial);
    }
}
