//! `scenes`: shows, checks and edits a room directory, and renders its cameras' views.
//!
//! Exit status: 0, or 1 when `check` finds a defect in the room, or 2 for any other failure. A reader who closes the
//! pipe early is no failure.
#![forbid(unsafe_code)]

mod cli;

use std::io::Write;
use std::process::ExitCode;

use shell::console::Console;

fn main() -> ExitCode {
    let arguments: cli::Arguments = shell::console::arguments();
    let console = Console::start(arguments.verbose);
    let mut out = shell::console::stdout();
    let done = arguments.command.run(&mut out).and_then(|()| Ok(out.flush()?));
    console.end(done, arguments.command.failure())
}
