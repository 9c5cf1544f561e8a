//! Files that programs write: inputs are never overwritten, old content stays until the new one is whole, and one
//! process writes to a folder at a time.
//!
//! * [`StagedFile`] — a file that takes its name once it is complete and on the disk. Start here.
//! * [`Outputs`] — the check that no output is, or holds, an input.
//! * [`FolderLock`] — the lock of a folder of results; [`OutputLock`] takes it when the folder exists.
//! * [`FileError`] — a file that cannot be read, written or used.

mod error;
mod lock;
mod output_lock;
mod outputs;
mod sources;
mod staged;

pub use error::FileError;
pub use lock::{FolderLock, LockError};
pub use output_lock::{OutputLock, lock};
pub use outputs::{OutputError, Outputs, refuse_inputs};
pub use sources::paths_of;
pub use staged::{StagedFile, readable_by_all, sync_folder};
