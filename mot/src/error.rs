//! The crate's error type. Each variant names the file or option, the place in it, and how to mend it.

use shell::files::FileError;
use shell::options::OptionError;

/// Failure of an operation of `mot`.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A file that cannot be read, written or used.
    #[error(transparent)]
    File(#[from] FileError),
    /// An invalid option, or an invalid combination of options.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// An error of a room, or of its files.
    #[error(transparent)]
    Scenes(#[from] scenes::Error),
    /// An error of a file below this crate.
    #[error(transparent)]
    Calib(#[from] calib::Error),
}

shell::file_error_constructors!(Error);
shell::option_error_constructor!(Error);

/// `Result` with the crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;
