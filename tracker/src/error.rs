//! The crate's error type. Each variant names the file or option, the place in it, and how to mend it.

use shell::files::FileError;
use shell::options::OptionError;

/// Failure of an operation of `tracker`.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read, written or used.
    #[error(transparent)]
    File(#[from] FileError),
    /// An invalid option, or an invalid combination of options.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// An error of tracks after the fact: their files, evaluation, linking.
    #[error(transparent)]
    Mot(#[from] mot::Error),
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

shell::file_error_constructors!(Error);
shell::option_error_constructor!(Error);

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
