//! Errors of files, the same in all crates.

use std::io;
use std::path::{Path, PathBuf};

/// A file that cannot be read, written or used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// A file that could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// A file that was read, but whose content cannot be used.
    #[error("{path}: {place}: {problem}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The place in it: a line, a key, an element or a frame.
        place: String,
        /// Description of the defect and of its mend.
        problem: String,
    },
}

impl FileError {
    /// Builds a [`FileError::Content`]. Lines of a library's message, or of a name in the file, become one.
    pub fn content(path: &Path, place: impl Into<String>, problem: impl Into<String>) -> Self {
        let joined = |text: String| if text.contains('\n') { text.replace('\n', " ") } else { text };
        Self::Content { path: path.to_owned(), place: joined(place.into()), problem: joined(problem.into()) }
    }

    /// Returns a function for `map_err` that builds a [`FileError::Io`].
    pub fn io(path: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}

/// Gives the error type of a crate, which has a variant `From<FileError>`, the constructors of [`FileError`].
#[macro_export]
macro_rules! file_error_constructors {
    ($error:ty) => {
        impl $error {
            /// Builds the error of a file that was read, but whose content cannot be used.
            pub fn content(
                path: &std::path::Path,
                place: impl Into<String>,
                problem: impl Into<String>,
            ) -> Self {
                $crate::files::FileError::content(path, place, problem).into()
            }

            /// Returns a function for `map_err` that builds the error of a file that cannot be read or written.
            pub fn io(path: &std::path::Path) -> impl Fn(std::io::Error) -> Self + Copy {
                move |source| $crate::files::FileError::io(path)(source).into()
            }
        }
    };
}
