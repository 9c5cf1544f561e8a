//! The crate's one error type. Each variant names the file or option, the place in it and the mend.

use std::path::{Path, PathBuf};

/// What can go wrong in `tracker`.
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
    /// An option, or a combination of options, that makes no sense.
    #[error("{option}: {problem}")]
    Option {
        /// The option as the user writes it.
        option: String,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// A camera's image or mask does not have the size its camera has.
    #[error(
        "camera `{camera}`: frame {frame} is {found_width} × {found_height} pixels, but the room says {width} × {height}"
    )]
    FrameSize {
        /// The camera's name.
        camera: String,
        /// The frame, from 1.
        frame: u32,
        /// What came.
        found_width: u32,
        /// What came.
        found_height: u32,
        /// What the room says.
        width: u32,
        /// What the room says.
        height: u32,
    },
    /// The room, its geometry or its files.
    #[error(transparent)]
    Scenes(#[from] scenes::Error),
    /// A camera model, OpenCV or a file below this crate.
    #[error(transparent)]
    Calib(#[from] calib::Error),
    /// An address at which the page cannot be served.
    #[error(transparent)]
    Listen(#[from] shell::loopback::ListenError),
}

impl Error {
    /// [`Error::Content`] with less writing.
    pub fn content(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Content { path: path.to_owned(), place: place.into(), problem: problem.into() }
    }

    /// [`Error::Option`] with less writing.
    pub fn option(option: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Option { option: option.into(), problem: problem.into() }
    }

    /// [`Error::Io`] as a function to `map_err` with.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Io { path, source }
    }
}

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
