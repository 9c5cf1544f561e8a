//! `calib`: what a camera is (`intrinsics`) and where it stands (`pose`).
#![forbid(unsafe_code)]

mod cli;

use std::io::Write;
use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let mut errors: Box<dyn Write> = match calib::vision::chatter::take_stderr() {
        Ok(own) => Box::new(own),
        Err(_) => Box::new(std::io::stderr()),
    };
    let command = match cli::Command::try_parse() {
        Ok(command) => command,
        Err(asked) if !asked.use_stderr() => {
            let _ = asked.print(); // fails only when nobody reads any more
            return ExitCode::SUCCESS;
        }
        Err(wrong) => {
            let _ = write!(errors, "{}", wrong.render());
            return ExitCode::from(2);
        }
    };
    match command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(errors, "calib: {error:#}");
            ExitCode::from(2)
        }
    }
}
