//! `tracker`: follow everyone in a room, and measure how well.
#![forbid(unsafe_code)]

mod cli;

use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::Arc;

use clap::Parser;

fn main() -> ExitCode {
    let arguments = cli::Arguments::parse();
    // libav prints to standard error on its own account; with -vv that is part of what was asked for.
    let own = if arguments.verbose < 2 { calib::vision::chatter::take_stderr().ok() } else { None };
    let console = cli::Console::new(own.map(Arc::new));
    console.start_log(arguments.verbose);
    let printed = cli::run(&arguments, &console).and_then(|text| {
        match std::io::stdout().write_all(text.as_bytes()) {
            // Whoever reads may stop early: `tracker eval … | head -1`.
            Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(error.into()),
            _ => Ok(()),
        }
    });
    match printed {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let line = format!("{error:#}").replace('\n', " ");
            // Nobody is left to tell when standard error is closed.
            let _ = writeln!(console.writer(), "error: {line}");
            ExitCode::from(2)
        }
    }
}
