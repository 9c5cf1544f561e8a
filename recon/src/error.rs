//! The crate's one error type. Each variant names the file or camera, the place in it and the mend.

use std::path::{Path, PathBuf};

/// What can go wrong in `recon`.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file was read, but what it says cannot be used.
    #[error("{path}: {place}: {problem}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The place in it: a line, a key, an element.
        place: String,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// A capture from which no motion or structure can be had.
    #[error("camera `{camera}`: {problem}")]
    Capture {
        /// The camera's name in `room.toml`.
        camera: String,
        /// What is wrong and what to film instead.
        problem: String,
    },
    /// Cameras that cannot be brought into one room: picks, scale, floor.
    #[error("{0}")]
    Room(String),
    /// A camera model, a video or an image below this crate.
    #[error(transparent)]
    Calib(#[from] calib::Error),
    /// The room's own files and geometry.
    #[error(transparent)]
    Scenes(#[from] scenes::Error),
}

impl Error {
    /// [`Error::Content`] with less writing.
    pub fn content(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), place: place.into(), problem: problem.into() }
    }

    /// [`Error::Capture`] with less writing.
    pub fn capture(camera: &str, problem: impl Into<String>) -> Self {
        Self::Capture { camera: camera.to_owned(), problem: problem.into() }
    }
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
