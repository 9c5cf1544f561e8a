//! The command line: a family of commands for each of the four short programs, and the program's own documents.

use std::path::PathBuf;

use clap::{CommandFactory, Parser, Subcommand};
use roomtrack::NAME;

/// Reconstructs a room once from what its cameras film, then follows every person in it, in metres on its floor.
#[derive(Parser)]
#[command(
    name = NAME,
    version,
    max_term_width = 110,
    after_help = "Examples:
  recon build room.toml --out myroom        # the room, from each camera's capture
  scenes edit myroom                        # zones, regions and lines, in the browser
  tracker run myroom --video cam1=cam1.mp4 --video cam2=cam2.mp4 --out out
  tracker report out --room myroom --out report.html

Each command has --help with examples of its own."
)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) family: Family,
}

#[derive(Subcommand)]
pub(crate) enum Family {
    /// Rooms from captures: each camera is filmed while it is moved to its final pose.
    Recon(recon::cli::Arguments),
    /// The room model: show, check and edit a room, take it from other programs and give it to them.
    Scenes(scenes::cli::Arguments),
    /// Everyone in a room: follow, evaluate, report, publish, day after day.
    Tracker(tracker::cli::Arguments),
    /// Camera calibration: intrinsics and pose of a camera.
    Calib(calib::cli::Arguments),
    /// Print the completions of a shell.
    #[command(after_help = "Example:
  roomtrack completions bash > ~/.local/share/bash-completion/completions/roomtrack")]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write a manual page of each command.
    #[command(after_help = "Example:
  roomtrack man --out ~/.local/share/man/man1 && man roomtrack-tracker-run")]
    Man {
        /// Folder of the pages; made where it is missing.
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

/// The whole command line; its texts name commands as this program has them.
pub(crate) fn command() -> clap::Command {
    roomtrack::with_called_commands(Arguments::command())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The commands of the short programs, `tracker run` and its like.
    fn short_commands() -> Vec<String> {
        let programs = [
            recon::cli::Arguments::command(),
            scenes::cli::Arguments::command(),
            tracker::cli::Arguments::command(),
            calib::cli::Arguments::command(),
        ];
        let commands_of = |program: &clap::Command| {
            let name = program.get_name().to_owned();
            let commands = program.get_subcommands().filter(|command| !command.is_hide_set());
            commands.map(|command| format!("{name} {}", command.get_name())).collect::<Vec<_>>()
        };
        programs.iter().flat_map(commands_of).collect()
    }

    #[test]
    fn the_list_of_commands_is_whole() {
        assert_eq!(roomtrack::SHORT_COMMANDS.to_vec(), short_commands());
    }

    fn commands_below(command: &clap::Command) -> Vec<&clap::Command> {
        let below = command.get_subcommands().filter(|command| !command.is_hide_set());
        below.flat_map(|command| [vec![command], commands_below(command)].concat()).collect()
    }

    #[test]
    fn the_families_are_whole_and_consistent() {
        let command = Arguments::command();
        command.clone().debug_assert();
        assert!(commands_below(&command).len() > 25);
    }

    #[test]
    fn examples_begin_with_the_programs_own_name() {
        roomtrack::join();
        let mut command = command();
        command.build();
        let mut examples = 0;
        for command in commands_below(&command) {
            let Some(text) = command.get_after_help() else { continue };
            for line in text.to_string().lines() {
                let line = line.trim_start();
                let short =
                    ["recon ", "scenes ", "tracker ", "calib "].iter().any(|name| line.starts_with(name));
                assert!(!short, "{}: {line}", command.get_name());
                examples += usize::from(line.starts_with("roomtrack "));
            }
        }
        assert!(examples > 30, "{examples}");
    }
}
