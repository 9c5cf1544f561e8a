//! Paths of the data and the programs.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The office shipped with the sources: captures, videos, truth.
pub fn office() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("office")
}

/// Path of a data set that is too large or not licensed to ship; `None`, with a visible line, where it is not
/// available.
pub fn shared(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: {} is not here", folder.display());
    None
}

/// One of the project's programs, built with the same profile as the running test.
///
/// # Panics
/// Panics when the program has not been built: `make test` builds all programs first.
#[allow(clippy::panic)] // A test cannot go on without the program; the message says what to do.
pub fn program(name: &str) -> Command {
    let built = std::env::current_exe().ok().and_then(|exe| {
        // target/PROFILE/deps/test-binary → target/PROFILE/program.
        let program = exe.parent()?.parent()?.join(name);
        program.is_file().then_some(program)
    });
    let Some(program) = built else {
        panic!("`{name}` is not built; run `cargo build --workspace --bins` first")
    };
    Command::new(program)
}

/// Folder that an example writes, from its first argument.
///
/// # Errors
/// A missing argument, or an option in its place: `--help` would become a folder.
pub fn folder_to_write(given: Option<String>) -> Result<String, String> {
    match given {
        Some(folder) if !folder.starts_with('-') => Ok(folder),
        Some(option) => {
            Err(format!("{option}: no folder; the top of the example's source says how to call it"))
        }
        None => Err("which folder to write?".into()),
    }
}
