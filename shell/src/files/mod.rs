//! Files that programs write: inputs are never overwritten, old content stays until the new one is whole, and one
//! process writes to a folder at a time.
//!
//! * [`StagedFile`] — a file that takes its name once it is complete and on the disk. Start here.
//! * [`Outputs`] — the check that no output is, or holds, an input.
//! * [`FolderLock`] — the lock of a folder of results.

mod lock;
mod outputs;
mod staged;

pub use lock::{FolderLock, LockError};
pub use outputs::{OutputError, Outputs};
pub use staged::{StagedFile, readable_by_all, sync_folder};
