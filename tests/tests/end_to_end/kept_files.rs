//! Results survive full disks, killed programs and a second program that writes to the same folder.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use image::{Rgb, RgbImage};
use tests::data::{office, program};
use tests::full_disk::limited;

use crate::folder::Folder;
use crate::refusal::refused;

/// Runs a program in a folder in which no file may grow beyond so many bytes: what a full disk does to it.
fn on_a_full_disk(folder: &Folder, bytes: u64, name: &str, arguments: &[&str]) -> Output {
    let mut command = limited(name, bytes);
    command.args(arguments).current_dir(folder.path(".")).output().expect("the program starts")
}

/// Asserts that no file is empty and none is left half-written under a name of its own.
fn assert_whole(folder: &Folder, line: &str) {
    for (path, content) in folder.files().into_iter().filter(|(path, _)| path.is_file()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let is_text = path.extension().is_some_and(|extension| extension == "txt");
        assert!(!content.is_empty() || is_text, "{line}: {name} is empty");
        assert!(!name.contains(".writing") && !name.contains("partial"), "{line}: {name} was left");
    }
}

#[test]
fn a_full_disk_is_told_and_takes_nothing_away() {
    let folder = Folder::new();
    let noisy = |seed: u32| move |u: u32, v: u32| Rgb([(u * u * 31 + v * 57 + u * v * seed) as u8; 3]);
    for frame in 1..=6 {
        folder.picture(&format!("a/{frame}.png"), &RgbImage::from_fn(320, 240, noisy(frame)));
    }
    let rows = (1..400).fold(String::new(), |rows, frame| rows + &format!("{frame},-1,10,10,30,60,0.9\n"));
    folder.write("det.txt", rows);
    folder.write("older.txt", "as it was\n");
    let room = office().join("room");
    let room = room.to_str().unwrap();
    for arguments in [
        &["scenes", "plan", room, "--out", "older.txt"][..],
        &["scenes", "depth", room, "--camera", "cam0", "--out", "older.txt"],
        &["scenes", "export", room, "--format", "colmap", "--out", "sparse"],
        &["tracker", "link", "det.txt", "--out", "older.txt"],
        &["tracker", "masks", "--video", "a=a", "--out", "masks", "--outlines"],
    ] {
        let output = on_a_full_disk(&folder, 2048, arguments[0], &arguments[1..]);
        refused(&output, &["File too large"]);
        assert_whole(&folder, &arguments.join(" "));
        assert_eq!(fs::read(folder.path("older.txt")).unwrap(), b"as it was\n");
    }
}

/// A run of a minute of two cameras in the office.
fn run(out: &Path, more: &[&str]) -> Command {
    let mut command = program("tracker");
    command.arg("run").arg(office().join("room")).arg("--out").arg(out).args([
        "--steps",
        "40",
        "--threads",
        "1",
    ]);
    for camera in ["cam0", "cam1"] {
        let film = office().join(format!("video/{camera}.mp4"));
        command.arg("--video").arg(format!("{camera}={}", film.display()));
    }
    command.args(more).stdout(Stdio::null());
    command
}

/// Waits until the run writes, at most a minute.
fn wait_for_lines(out: &Path, run: &mut Child) {
    for _ in 0..600 {
        if fs::metadata(out.join("tracks.jsonl")).is_ok_and(|file| file.len() > 0) {
            return;
        }
        assert!(run.try_wait().unwrap().is_none(), "the run has ended");
        std::thread::sleep(Duration::from_millis(100));
    }
    panic!("the run writes nothing");
}

#[test]
fn a_second_run_into_a_folder_is_told_of_the_first_and_a_killed_one_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let mut first = run(&out, &["--no-film"]).stderr(Stdio::null()).spawn().unwrap();
    wait_for_lines(&out, &mut first);
    let second = run(&out, &["--no-film"]).output().unwrap();
    refused(&second, &["out", &format!("process {}", first.id()), "tracker run", "another folder"]);
    // SIGKILL.
    first.kill().unwrap();
    first.wait().unwrap();
    let text = fs::read_to_string(out.join("tracks.jsonl")).unwrap();
    assert!(text.is_empty() || text.ends_with('\n'));
    // The lock of the dead is taken over; a hang-up ends a run with all of its results.
    // Lines that come after this are the third run's, however slowly it starts.
    fs::remove_file(out.join("tracks.jsonl")).unwrap();
    let mut third = run(&out, &["--no-film"]).stderr(Stdio::null()).spawn().unwrap();
    wait_for_lines(&out, &mut third);
    let hung_up = Command::new("kill").args(["-HUP", &third.id().to_string()]).status().unwrap();
    assert!(hung_up.success() && third.wait().unwrap().success());
    assert!(out.join("timings.json").is_file() && out.join("plan.png").is_file());
    let names: Vec<String> = fs::read_dir(&out)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    assert!(names.iter().all(|name| !name.starts_with('.')), "{names:?}");
}
