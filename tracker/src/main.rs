//! `tracker`: follow everyone in a room, and measure how well.
//!
//! OpenCV's video reader brings more than two hundred libraries, and a process needs 0.1 s to load them: longer than it
//! takes to link or to evaluate a recording. So `eval` and `link` of files are done here, in a program without them, and
//! everything else becomes `tracker-all`, which lies beside this one.
//!
//! Exit status: 0, or 2 when anything cannot be done; then one line on standard error says what and where.
#![forbid(unsafe_code)]

#[path = "cli/eval.rs"]
mod eval;
#[path = "cli/link.rs"]
mod link;

use std::ffi::OsString;
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::process::ExitCode;

use calib::console::{CANNOT, Console};
use clap::{ArgAction, Parser};

/// The name of the program with every subcommand.
const ALL: &str = "tracker-all";

/// What is done without pictures.
#[derive(Debug, Parser)]
#[command(name = "tracker", version, max_term_width = 110)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Tell more (-vv: everything, with what the video libraries print).
    #[arg(short, long, action = ArgAction::Count, global = true)]
    verbose: u8,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Link(Box<link::LinkArgs>),
    Eval(eval::EvalArgs),
}

fn main() -> ExitCode {
    let words: Vec<OsString> = std::env::args_os().skip(1).collect();
    if !needs_no_pictures(&words) {
        return become_all(&words);
    }
    let arguments = Arguments::parse();
    let console = Console::start(1 + arguments.verbose);
    let printed = match &arguments.command {
        Command::Link(args) => link::link(args, &console, None),
        Command::Eval(args) => eval::eval(args),
    };
    let written = printed.and_then(|text| Ok(std::io::stdout().write_all(text.as_bytes())?));
    console.end(written, CANNOT)
}

/// Whether the words name work that is done here.
fn needs_no_pictures(words: &[OsString]) -> bool {
    let is_flag = |word: &OsString| word.to_str().is_some_and(|w| w.starts_with("-v") || w == "--verbose");
    let command = words.iter().find(|word| !is_flag(word));
    let is_video =
        |word: &OsString| word.to_str().is_some_and(|w| w == "--video" || w.starts_with("--video="));
    command.is_some_and(|word| word == "link" || word == "eval") && !words.iter().any(is_video)
}

/// Goes on as the program beside this one; comes back only where that is not there.
fn become_all(words: &[OsString]) -> ExitCode {
    let failed = std::env::current_exe().map(|here| {
        let program = here.with_file_name(ALL);
        let error = std::process::Command::new(&program).arg0("tracker").args(words).exec();
        anyhow::anyhow!("{}: {error}; build it with `cargo build -p tracker --bins`", program.display())
    });
    // Not before: the console takes standard error for itself, and the other program needs it.
    Console::start(1).end(failed.map_err(anyhow::Error::from).and_then(Err), CANNOT)
}
