//! Error type of the crate. Each variant names what is wrong, the place, and what to do.

use std::path::PathBuf;

/// Errors of the crate `calib`; each names file, place and what to do.
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
        /// The place in it: a line, a key, a frame.
        place: String,
        /// Problem, and what to do about it.
        problem: String,
    },
    /// Numbers that make no camera, no rotation or no transform.
    #[error("{0}")]
    Invalid(String),
    /// Point sets that do not determine the quantity asked for.
    #[error("degenerate points: {0}")]
    Degenerate(String),
    /// OpenCV reported an error.
    #[cfg(feature = "vision")]
    #[error("OpenCV: {doing}: {message}")]
    OpenCv {
        /// Operation that was under way.
        doing: &'static str,
        /// Message of OpenCV.
        message: String,
    },
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
