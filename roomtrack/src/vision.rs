//! The executable with the commands that need OpenCV or FFmpeg.

use std::ffi::OsString;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::Context;
use shell::console::{CANNOT, Console};

/// Name of the executable.
const VISION: &str = "roomtrack-vision";

/// Puts it in the place of this process. Returns the exit status of a failure to do so.
pub(crate) fn become_it(words: &[OsString]) -> ExitCode {
    let failed = found().and_then(|program| {
        let mut command = Command::new(&program);
        if let Some(own_name) = std::env::args_os().next() {
            command.arg0(own_name);
        }
        let error = command.args(words).exec();
        Err(error).with_context(|| format!("{}: cannot be started", program.display()))
    });
    Console::start(0).end(failed, CANNOT)
}

/// The executable: beside this one in a build's folder, in the library folder of an installation.
fn found() -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe().context("the program's own file cannot be found")?;
    let folder = own.parent().unwrap_or(Path::new("/"));
    let places = [folder.join(VISION), folder.join("../lib/roomtrack").join(VISION)];
    let found = places.iter().find(|place| place.is_file()).cloned();
    found.with_context(|| format!("{}: is missing; install roomtrack again", places[1].display()))
}
