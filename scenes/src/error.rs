//! The crate's one error type. Each variant names the file, the place in it and the mend.

use std::path::{Path, PathBuf};

/// What can go wrong in `scenes`.
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
    /// A file that is to be changed is no longer the one that the changes were made to.
    #[error("{path}: it has changed on disk since it was loaded; load it again, then make the change again")]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// A camera was asked for that the room does not have.
    #[error("no camera is called `{name}`; the room has {known}")]
    UnknownCamera {
        /// The name asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A room that cannot be used or written.
    #[error("room: {place}: {problem}")]
    Room {
        /// The part of the room: a camera, a zone, the geometry.
        place: String,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// An address at which no page can be served.
    #[error(transparent)]
    Listen(#[from] shell::loopback::ListenError),
    /// Geometry that cannot be intersected.
    #[error("geometry: {0}")]
    Geometry(String),
    /// A camera model or a file below this crate.
    #[error(transparent)]
    Calib(#[from] calib::Error),
}

impl Error {
    /// [`Error::Content`] with less writing.
    pub fn content(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), place: place.into(), problem: problem.into() }
    }
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
