//! Where the data and the programs are.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The office shipped with the sources: captures, videos, truth.
pub fn office() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("office")
}

/// A data set that is too large or not ours to ship; `None`, with a line that says so, where it is not at hand.
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
/// When it has not been built: `make test` builds all programs first.
#[allow(clippy::panic)] // A test cannot go on without the program; the message says what to do.
pub fn program(name: &str) -> Command {
    let built = std::env::current_exe().ok().and_then(|exe| {
        // target/PROFILE/deps/test-binary → target/PROFILE/program
        let program = exe.parent()?.parent()?.join(name);
        program.is_file().then_some(program)
    });
    let Some(program) = built else {
        panic!("`{name}` is not built; run `cargo build --workspace --bins` first")
    };
    Command::new(program)
}

/// The folder that an example is to write, from its first argument.
///
/// # Errors
/// When there is none, or an option in its place: `--help` would become a folder.
pub fn folder_to_write(given: Option<String>) -> Result<String, String> {
    match given {
        Some(folder) if !folder.starts_with('-') => Ok(folder),
        Some(option) => {
            Err(format!("{option}: no folder; the top of the example's source says how to call it"))
        }
        None => Err("which folder to write?".into()),
    }
}
