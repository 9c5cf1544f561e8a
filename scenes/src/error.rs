//! Error type of the crate. Each variant names the file, the place in it and what to do.

use std::path::PathBuf;

use shell::files::FileError;

/// Errors of the crate `scenes`; each names file, place and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read, written or used.
    #[error(transparent)]
    File(#[from] FileError),
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

shell::file_error_constructors!(Error);

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
