//! The crate's error type. Each variant names the file or option, the place in it, and how to mend it.

use std::path::{Path, PathBuf};

/// Failure of an operation of `tracker`.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// A file was read, but its content cannot be used.
    #[error("{path}: {place}: {problem}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The place in it: a line, a key or a frame.
        place: String,
        /// Description of the defect and of its mend.
        problem: String,
    },
    /// An invalid option, or an invalid combination of options.
    #[error("{option}: {problem}")]
    Option {
        /// Name of the field of the options, or of the thing at fault, such as a camera. The command line prints its flag
        /// in place of a field.
        option: String,
        /// Description of the defect and of its mend.
        problem: String,
    },
    /// A camera's image or mask whose size differs from that of the camera in the room.
    #[error(
        "camera `{camera}`: frame {frame} is {found_width} × {found_height} pixels, but the room says {width} × {height}"
    )]
    FrameSize {
        /// The camera's name.
        camera: String,
        /// The frame's number, from 1.
        frame: u32,
        /// Width of the image, pixels.
        found_width: u32,
        /// Height of the image, pixels.
        found_height: u32,
        /// Width of the camera in the room, pixels.
        width: u32,
        /// Height of the camera in the room, pixels.
        height: u32,
    },
    /// An error of the room, its geometry or its files.
    #[error(transparent)]
    Scenes(#[from] scenes::Error),
    /// An error of a camera model, of OpenCV or of a file below this crate.
    #[error(transparent)]
    Calib(#[from] calib::Error),
    /// A folder of results that cannot be locked.
    #[error(transparent)]
    Lock(#[from] shell::files::LockError),
    /// An address at which the page cannot be served.
    #[error(transparent)]
    Listen(#[from] shell::loopback::ListenError),
}

impl Error {
    /// Builds an [`Error::Content`].
    pub fn content(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), place: place.into(), problem: problem.into() }
    }

    /// Builds an [`Error::Option`].
    pub fn option(option: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Option { option: option.into(), problem: problem.into() }
    }

    /// Returns a function for `map_err` that builds an [`Error::Io`].
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
