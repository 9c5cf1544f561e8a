//! Error type of the crate. Each variant names the file, the place in it and what to do.

use std::path::{Path, PathBuf};

/// Errors of the crate `scenes`; each names file, place and what to do.
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
    /// Another program has changed in the file the same items that the editor is about to save.
    #[error("{path}: {conflicts}; load it again and make the change again, or save over it")]
    Conflict {
        /// The file.
        path: PathBuf,
        /// The parts that were changed on both sides.
        conflicts: String,
    },
    /// A camera was asked for that the room does not have.
    #[error("no camera is called `{name}`; the room has {known}")]
    UnknownCamera {
        /// Requested name.
        name: String,
        /// Names of the cameras that exist.
        known: String,
    },
    /// A room that cannot be used or written.
    #[error("room: {place}: {problem}")]
    Room {
        /// The part of the room: a camera, a zone, the geometry.
        place: String,
        /// Problem, and what to do about it.
        problem: String,
    },
    /// An address at which no page can be served.
    #[error(transparent)]
    Listen(#[from] shell::loopback::ListenError),
    /// Geometry that cannot be intersected.
    #[error("geometry: {0}")]
    Geometry(String),
    /// Error of a camera model or a file from the crate `calib`.
    #[error(transparent)]
    Calib(#[from] calib::Error),
}

impl Error {
    /// Builds an [`Error::Content`].
    pub fn content(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), place: place.into(), problem: problem.into() }
    }
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
