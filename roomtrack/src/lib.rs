//! The names under which the one program has the commands of the four short ones, for both of its executables.
#![forbid(unsafe_code)]

use shell::program::as_called;

/// Name of the program.
pub const NAME: &str = "roomtrack";

/// The commands of the short programs; a test compares them with the command lines.
pub const SHORT_COMMANDS: &[&str] = &[
    "recon build",
    "recon picks",
    "recon relocate",
    "recon export",
    "scenes check",
    "scenes depth",
    "scenes plan",
    "scenes edit",
    "scenes import",
    "scenes export",
    "tracker run",
    "tracker check",
    "tracker serve",
    "tracker station",
    "tracker watch",
    "tracker detect",
    "tracker link",
    "tracker agents",
    "tracker eval",
    "tracker events",
    "tracker stats",
    "tracker masks",
    "tracker report",
    "tracker export",
    "tracker weightmap",
    "calib intrinsics",
    "calib pose",
];

/// Makes texts of this process name commands as `roomtrack` has them.
pub fn join() {
    shell::program::join(NAME, SHORT_COMMANDS.iter().map(|command| (*command).to_owned()).collect());
}

/// A command line whose texts name commands as `roomtrack` has them; [`join`] comes first.
#[must_use]
pub fn with_called_commands(mut command: clap::Command) -> clap::Command {
    let called = |text: &clap::builder::StyledStr| as_called(&text.to_string()).into_owned();
    if let Some(text) = command.get_about().map(called) {
        command = command.about(text);
    }
    if let Some(text) = command.get_long_about().map(called) {
        command = command.long_about(text);
    }
    if let Some(text) = command.get_after_help().map(called) {
        command = command.after_help(text);
    }
    if let Some(text) = command.get_after_long_help().map(called) {
        command = command.after_long_help(text);
    }
    command
        .mut_args(|mut argument| {
            if let Some(text) = argument.get_help().map(called) {
                argument = argument.help(text);
            }
            if let Some(text) = argument.get_long_help().map(called) {
                argument = argument.long_help(text);
            }
            argument
        })
        .mut_subcommands(with_called_commands)
}
