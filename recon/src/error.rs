//! Error type of the crate. Each variant names the file or camera, the place in it and what to do.

use std::path::{Path, PathBuf};

/// Errors of the crate `recon`; each names file or camera, place and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// A file was read, but its content cannot be used.
    #[error("{path}: {place}: {problem}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The place in it: a line, a key, an element.
        place: String,
        /// Problem, and what to do about it.
        problem: String,
    },
    /// A project file that another program changed after it was read.
    #[error("{}: another program has changed it meanwhile; load it again, then save", .0.display())]
    Changed(PathBuf),
    /// A capture that determines no motion or structure.
    #[error("camera `{camera}`: {problem}")]
    Capture {
        /// The camera's name in `room.toml`.
        camera: String,
        /// Problem, and what to film instead.
        problem: String,
    },
    /// Cameras that cannot be brought into one room: picks, scale, floor.
    #[error("{0}")]
    Room(String),
    /// Error of a camera model, a video or an image from the crate `calib`.
    #[error(transparent)]
    Calib(#[from] calib::Error),
    /// Error of the room's files and geometry from the crate `scenes`.
    #[error(transparent)]
    Scenes(#[from] scenes::Error),
}

impl Error {
    /// Builds an [`Error::Content`].
    pub fn content(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), place: place.into(), problem: problem.into() }
    }

    /// Builds an [`Error::Capture`].
    pub fn capture(camera: &str, problem: impl Into<String>) -> Self {
        Self::Capture { camera: camera.to_owned(), problem: problem.into() }
    }
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
