//! The program as a person has called it: one of the four short programs (`tracker run …`), or all of them in one
//! (`roomtrack tracker run …`). Texts of the libraries name commands in the short form.

use std::borrow::Cow;
use std::path::Path;
use std::sync::OnceLock;

/// The program that has the commands of all others.
struct Joint {
    name: &'static str,
    /// Its commands, as the short programs have them: `tracker run`.
    commands: Vec<String>,
}

static JOINT: OnceLock<Joint> = OnceLock::new();

/// States that the commands of the short programs, each of the form `tracker run`, are commands of the program `name`.
/// The first call counts.
pub fn join(name: &'static str, commands: Vec<String>) {
    JOINT.get_or_init(|| Joint { name, commands });
}

/// `text` with each command in the form in which this program is called.
pub fn as_called(text: &str) -> Cow<'_, str> {
    match JOINT.get() {
        Some(joint) => Cow::Owned(joint.as_called(text)),
        None => Cow::Borrowed(text),
    }
}

/// Arguments before those of the short program `program`, where this process starts itself again.
pub fn arguments_before(program: &'static str) -> Option<&'static str> {
    JOINT.get().map(|_| program)
}

/// The command as it was called, without its arguments: `tracker run`, `roomtrack tracker run`.
pub fn command() -> String {
    command_of(std::env::args(), JOINT.get().is_some())
}

/// The command of a program with these arguments, of which the first is the program's path.
fn command_of(mut arguments: impl Iterator<Item = String>, is_joint: bool) -> String {
    let program = arguments.next().unwrap_or_default();
    let name = Path::new(&program).file_name().map_or(program.clone(), |name| name.to_string_lossy().into());
    let words = arguments.filter(|word| !word.starts_with('-')).take(if is_joint { 2 } else { 1 });
    std::iter::once(name).chain(words).collect::<Vec<_>>().join(" ")
}

impl Joint {
    fn as_called(&self, text: &str) -> String {
        let mut called = String::with_capacity(text.len() + 64);
        let mut rest = text;
        while let Some(next) = rest.chars().next() {
            let starts_word = called.chars().next_back().is_none_or(|c| !is_word(c));
            let command = self.commands.iter().find(|command| {
                starts_word
                    && rest
                        .strip_prefix(command.as_str())
                        .is_some_and(|after| after.chars().next().is_none_or(|c| !is_word(c)))
            });
            let taken = command.map_or(next.len_utf8(), String::len);
            if command.is_some() && !called.ends_with(&format!("{} ", self.name)) {
                called.push_str(self.name);
                called.push(' ');
            }
            called.push_str(&rest[..taken]);
            rest = &rest[taken..];
        }
        called
    }
}

/// Whether a command's word goes on with `c`; a path's does.
fn is_word(c: char) -> bool {
    c.is_alphanumeric() || "_-/".contains(c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_named_as_the_program_is_called() {
        let joint = Joint { name: "roomtrack", commands: vec!["tracker run".into(), "recon build".into()] };
        for (short, called) in [
            ("tracker run room --out out", "roomtrack tracker run room --out out"),
            (
                "`recon build` makes it; then\n  tracker run x",
                "`roomtrack recon build` makes it; then\n  roomtrack tracker run x",
            ),
            ("roomtrack tracker run room", "roomtrack tracker run room"),
            (
                "the tracker runs; tracker running; my-tracker run",
                "the tracker runs; tracker running; my-tracker run",
            ),
            ("target/release/tracker run; ünder tracker", "target/release/tracker run; ünder tracker"),
            ("", ""),
        ] {
            assert_eq!(joint.as_called(short), called);
        }
    }

    #[test]
    fn a_command_is_named_without_its_arguments() {
        for (line, is_joint, command) in [
            ("/usr/bin/tracker run room --out out", false, "tracker run"),
            ("/usr/bin/roomtrack tracker -v run room", true, "roomtrack tracker run"),
            ("tracker", false, "tracker"),
        ] {
            assert_eq!(command_of(line.split(' ').map(str::to_owned), is_joint), command);
        }
    }

    #[test]
    fn a_short_program_changes_nothing() {
        assert_eq!(as_called("tracker run"), "tracker run");
        assert_eq!(arguments_before("tracker"), None);
    }
}
