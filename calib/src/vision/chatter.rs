//! Keeps the libraries below OpenCV from writing over a program's own messages.
//!
//! libav and OpenCV print to the process's standard error on their own account, past every log level that can be set
//! from outside. A program that promises one clear line on standard error takes the stream for itself.

use std::fs::File;
use std::io;
use std::os::fd::AsFd;

/// Takes standard error for the program alone: returns it as a file to write to, and sends whatever else is written to
/// the process's standard error to nowhere. `std::io::stderr` and `eprintln!` write to nowhere after this, too.
///
/// # Errors
/// When the system refuses to duplicate the stream.
pub fn take_stderr() -> io::Result<File> {
    let own = io::stderr().as_fd().try_clone_to_owned()?;
    let nowhere = File::options().write(true).open("/dev/null")?;
    rustix::stdio::dup2_stderr(&nowhere)?;
    Ok(File::from(own))
}

/// Silences OpenCV's own log, without touching standard error.
///
/// # Errors
/// When OpenCV refuses.
pub fn silence_opencv() -> crate::Result<()> {
    opencv::core::set_log_level(opencv::core::LogLevel::LOG_LEVEL_SILENT)
        .map(|_| ())
        .map_err(super::adapter::refused("setting its log level"))
}
