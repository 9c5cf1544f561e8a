//! `roomtrack` and `roomtrack-vision`: a command gives the same output from both executables.

use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Output;

use tests::data::{office, program};

/// Runs an executable under the name that people call.
fn run(name: &str, arguments: &[&str]) -> Output {
    program(name).arg0("roomtrack").args(arguments).output().unwrap()
}

#[test]
fn commands_that_need_numbers_alone_answer_as_the_executable_with_all_commands_does() {
    let room = office().join("room");
    let room = room.to_str().unwrap();
    for arguments in [
        &["--version"][..],
        &["scenes", "--help"],
        &["scenes", "check", "--help"],
        &["scenes", "check", room],
        &["scenes", "chek", room],
        &["tracker", "eval", "--help"],
        &["tracker", "link", "--help"],
        &["tracker", "link", "none.txt", "--out", "tracks.txt"],
        &["tracker", "eval", "--truth", "none.txt", "--tracks", "none.txt", "--gate", "-1"],
        &["tracker", "link", "none.txt", "--out", "tracks.txt", "--max-gap", "0"],
    ] {
        let [front, whole] = ["roomtrack", "roomtrack-vision"].map(|name| run(name, arguments));
        assert_eq!(front, whole, "{arguments:?}");
    }
}

#[test]
fn other_commands_go_to_the_executable_with_all_commands() {
    let help = run("roomtrack", &["tracker", "run", "--help"]);
    assert!(help.status.success());
    assert!(String::from_utf8(help.stdout).unwrap().contains("roomtrack tracker run"));
    // Without the other executable the program names the missing file.
    let alone = tempfile::tempdir().unwrap();
    let copy = alone.path().join("roomtrack");
    std::fs::copy(Path::new(program("roomtrack").get_program()), &copy).unwrap();
    let refused = std::process::Command::new(&copy).args(["tracker", "run"]).output().unwrap();
    let line = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{line}");
    assert!(
        line.contains("lib/roomtrack/roomtrack-vision: is missing") && line.lines().count() == 1,
        "{line}"
    );
    // Commands that need numbers alone work without the other executable.
    let version = std::process::Command::new(&copy).arg("--version").output().unwrap();
    assert!(version.status.success() && version.stdout.starts_with(b"roomtrack "), "{version:?}");
}
