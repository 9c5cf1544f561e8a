//! The commands that need numbers alone, no pictures.

use std::ffi::OsString;
use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use roomtrack::NAME;

#[derive(Parser)]
#[command(name = NAME, version, max_term_width = 110)]
struct Arguments {
    #[command(subcommand)]
    family: Family,
}

#[derive(Subcommand)]
enum Family {
    /// The room model: show, check and edit a room, take it from other programs and give it to them.
    Scenes(scenes::cli::Arguments),
    /// Everyone in a room: follow, evaluate, report, publish, day after day.
    Tracker(mot::cli::Arguments),
}

/// Whether these words are a command that needs numbers alone.
pub(crate) fn suffice(words: &[OsString]) -> bool {
    let word = |i: usize| words.get(i).and_then(|word| word.to_str()).unwrap_or_default();
    let has_film = || words.iter().any(|word| word.to_string_lossy().starts_with("--video"));
    match (word(0), word(1)) {
        ("--version" | "-V", _) => words.len() == 1,
        ("scenes", _) | ("tracker", "eval") => true,
        ("tracker", "link") => !has_film(),
        _ => false,
    }
}

/// Runs the command of this process. Returns the exit status.
pub(crate) fn run() -> ExitCode {
    roomtrack::join();
    let command = roomtrack::with_called_commands(Arguments::command());
    match shell::console::parsed(command, Arguments::from_arg_matches).family {
        Family::Scenes(arguments) => scenes::cli::run(&arguments),
        Family::Tracker(arguments) => mot::cli::run(&arguments),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_for_the_other_program() {
        let suffice = |line: &str| suffice(&line.split_whitespace().map(OsString::from).collect::<Vec<_>>());
        for line in
            ["--version", "scenes", "scenes check room", "tracker eval --json", "tracker link a --out b"]
        {
            assert!(suffice(line), "{line}");
        }
        for line in
            ["", "--help", "help scenes", "tracker", "tracker -v eval", "tracker run room", "recon build x"]
        {
            assert!(!suffice(line), "{line}");
        }
        assert!(
            !suffice("tracker link a --video film.mp4 --out b") && !suffice("tracker link a --video=a.mp4")
        );
    }
}
