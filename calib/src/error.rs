//! Error type of the crate. Each variant names what is wrong, the place, and what to do.

use shell::files::FileError;

/// Errors of the crate `calib`; each names file, place and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read, written or used.
    #[error(transparent)]
    File(#[from] FileError),
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

shell::file_error_constructors!(Error);

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
