//! Error type of the crate. Each variant names the file or camera, the place in it and what to do.

use std::path::PathBuf;

use shell::files::FileError;

/// Errors of the crate `recon`; each names file or camera, place and what to do.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read, written or used.
    #[error(transparent)]
    File(#[from] FileError),
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
    /// Builds an [`Error::Capture`].
    pub fn capture(camera: &str, problem: impl Into<String>) -> Self {
        Self::Capture { camera: camera.to_owned(), problem: problem.into() }
    }
}

shell::file_error_constructors!(Error);

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
