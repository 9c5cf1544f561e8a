//! The crate's one error type. Each variant says what is wrong, where, and how to mend it.

use std::path::PathBuf;

/// What can go wrong in `calib`.
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
        /// The place in it: a line, a key, a frame.
        place: String,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// Numbers that make no camera, no rotation or no transform.
    #[error("{0}")]
    Invalid(String),
    /// Point sets that do not determine what was asked of them.
    #[error("degenerate points: {0}")]
    Degenerate(String),
    /// OpenCV refused.
    #[cfg(feature = "vision")]
    #[error("OpenCV: {doing}: {message}")]
    OpenCv {
        /// What was being done.
        doing: &'static str,
        /// OpenCV's own words.
        message: String,
    },
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
