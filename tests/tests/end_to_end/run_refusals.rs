//! `tracker run` with every kind of wrong input: one clear line, exit status 2, no panic.

use std::fs;
use std::ops::Deref;
use std::path::Path;
use std::process::Output;

use image::{Rgb, RgbImage};
use tests::data::{office, program};

use crate::folder::{Folder, camera_table};
use crate::refusal::refused;

const ROOM: &str = concat!("\nformat = 1\n", camera_table!("left", "0.0"), camera_table!("right", "0.5"));

/// A room, a folder of pictures for each of its two cameras, and masks for them.
struct Small {
    folder: Folder,
}

impl Deref for Small {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.folder
    }
}

/// Pictures in which nothing moves, with a little noise.
fn noise(width: u32, height: u32, level: u8) -> RgbImage {
    let noisy = |u: u32, v: u32| level + ((u * 7 + v * 13) % 5) as u8;
    RgbImage::from_fn(width, height, |u, v| Rgb([noisy(u, v); 3]))
}

impl Small {
    fn new() -> Self {
        let small = Self { folder: Folder::new() };
        small.write("room/scene.toml", ROOM);
        for (folder, color) in [("left", 90), ("right", 120), ("masks", 0)] {
            for frame in 1..=6_u8 {
                small.picture(&format!("{folder}/{frame:02}.png"), &noise(64, 48, color));
            }
        }
        small
    }

    /// Runs with both cameras' pictures and more arguments.
    fn run(&self, more: &[&str]) -> Output {
        let mut all = vec!["--video", "left=left", "--video", "right=right"];
        all.extend(more);
        self.run_only(&all)
    }

    fn run_only(&self, arguments: &[&str]) -> Output {
        self.run_program("tracker", &[&["run", "room", "--out", "out", "--no-film"], arguments].concat())
    }
}

#[test]
fn the_same_small_run_succeeds() {
    let small = Small::new();
    for arguments in [&["--video", "left=left", "--video", "right=right"][..], &["--masks", "left=masks"]] {
        let output = small.run_only(arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{said}");
        let frames = fs::read_to_string(small.path("out/tracks.jsonl")).expect("the tracks").lines().count();
        assert_eq!(frames, 6);
        assert!(small.path("out/timings.json").is_file() && small.path("out/boxes/left.txt").is_file());
    }
}

#[test]
fn rooms() {
    let small = Small::new();
    let missing = small.path("nowhere");
    let output = program("tracker")
        .args(["run".as_ref(), missing.as_os_str()])
        .args(["--video", "left=left", "--out", "out"])
        .output()
        .expect("the program starts");
    refused(&output, &["nowhere"]);
    for (text, words) in [
        ("", &["scene.toml"][..]),
        (&ROOM[..ROOM.len() / 2], &["scene.toml", "line"]),
        (&ROOM.replace("3.0]", "nan]"), &["scene.toml"]),
        (&ROOM.replace("format = 1", "format = 1\ngeometry = \"room.ply\""), &["room.ply"]),
    ] {
        small.write("room/scene.toml", text);
        refused(&small.run(&[]), words);
    }
    assert!(!small.path("out").exists(), "something was written before everything was read");
}

#[test]
fn boxes() {
    let small = Small::new();
    small.write("left.txt", "1,-1,20,10,8,20,1\n6,-1,21,10,8,20,1\n");
    small.write("empty.txt", "");
    // The detector of the other camera found no person; the run has the frames of the longer file.
    let output = small.run_only(&["--detections", "left=left.txt", "--detections", "right=empty.txt"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(fs::read_to_string(small.path("out/tracks.jsonl")).expect("the tracks").lines().count(), 6);

    let of_left = |more: &[&str]| small.run_only(&[&["--detections", "left=left.txt"], more].concat());
    refused(&of_left(&["--detections", "middle=left.txt"]), &["--detections middle", "`left`, `right`"]);
    refused(&of_left(&["--detections", "left=empty.txt"]), &["--detections left", "already"]);
    refused(&of_left(&["--method", "condensation"]), &["--detections", "mcmc and agents"]);
    let twice = small.run_only(&["--detections", "left=-", "--detections", "right=-"]);
    refused(&twice, &["--detections right=-", "its own"]);
    refused(&small.run_only(&["--detections", "left=empty.txt"]), &["--detections", "empty.txt", "no box"]);
    refused(&small.run_only(&["--detections", "left=nowhere.txt"]), &["nowhere.txt"]);
    small.write("left.txt", "1,-1,20,10,nan,20,1\n");
    refused(&of_left(&[]), &["left.txt", "line 1", "width is nan"]);
    small.write("left.txt", "1,-1,20,10,8\n");
    refused(&of_left(&[]), &["left.txt", "line 1", "5 columns"]);
}

#[test]
fn names_and_options() {
    let small = Small::new();
    refused(&small.run_only(&[]), &["--video", "NAME=PATH", "left, right"]);
    refused(&small.run(&["--masks", "middle=masks"]), &["middle", "left", "right"]);
    refused(&small.run(&["--video", "left=right"]), &["left", "already"]);
    refused(&small.run(&["--threads", "0"]), &["--threads"]);
    refused(&small.run(&["--rate", "0"]), &["--rate"]);
    refused(&small.run(&["--rate", "NaN"]), &["--rate"]);
    refused(&small.run(&["--steps", "1"]), &["--steps"]);
    refused(&small.run(&["--steps", "2000000000"]), &["--steps", "1000000"]);
    refused(&small.run(&["--most-people", "0"]), &["--most-people", "1 to 31"]);
    refused(&small.run(&["--most-people", "32"]), &["--most-people", "1 to 31"]);
    refused(&small.run(&["--lag=-1"]), &["--lag", "0 to 20 seconds"]);
    refused(&small.run(&["--lag", "NaN"]), &["--lag"]);
    refused(&small.run(&["--offset", "middle=1"]), &["middle", "left, right"]);
    refused(&small.run(&["--offset", "left=1", "--offset", "left=2"]), &["left", "already"]);
    refused(&small.run(&["--offset", "left=1000"]), &["--offset", "no moment"]);
    refused(&small.run(&["--mask-width", "5"]), &["--mask-width", "32 or more"]);
    refused(&small.run(&["--latency=-1"]), &["--latency", "seconds"]);
    refused(&small.run(&["--stations", "host:7447"]), &["--stations", "takes the place of --video"]);
    refused(&small.run(&["--allow", "somebody"]), &["--allow", "--stations"]);
    refused(&small.run(&["--times", "left=nowhere.txt"]), &["nowhere.txt"]);
    refused(&small.run(&["--times", "a.txt", "--times", "b.txt"]), &["b.txt", "already"]);
    refused(&small.run(&["--absorb", "0"]), &["--absorb"]);
    refused(&small.run(&["--background", "left=nowhere"]), &["nowhere"]);
    refused(&small.run(&["--background", "middle=left"]), &["middle", "left, right"]);
    small.picture("large.png", &noise(80, 60, 50));
    refused(
        &small.run(&["--background", "right=large.png"]),
        &["large.png", "`right`", "80 × 60", "64 × 48"],
    );
    let masked = ["--masks", "left=masks", "--background", "left=nowhere.mp4"];
    refused(&small.run(&masked), &["--background left=nowhere.mp4", "--masks"]);
    assert!(!small.path("out").exists(), "something was written before everything was read");
    small.write("out", "a file where the folder should be");
    refused(&small.run(&[]), &["out"]);
}

#[test]
fn videos() {
    let small = Small::new();
    small.write("empty.mp4", "");
    small.write("text.mp4", "this is no video");
    fs::create_dir(small.path("bare")).expect("a folder");
    small.picture("large/1.png", &noise(80, 60, 50));
    for (source, words) in [
        ("left=nowhere.mp4", &["nowhere.mp4"][..]),
        ("left=empty.mp4", &["empty.mp4", "empty"]),
        ("left=text.mp4", &["text.mp4", "decoded"]),
        ("left=bare", &["bare", "no .jpg"]),
        ("left=large", &["large", "80 × 60", "64 × 48"]),
    ] {
        refused(&small.run_only(&["--video", source]), words);
        refused(&small.run_only(&["--masks", source]), words);
    }
    assert!(!small.path("out").exists(), "something was written before everything was read");
}

#[test]
fn pictures_in_the_middle_of_a_folder() {
    for (name, words) in
        [("left/04.png", &["04.png", "decoded"][..]), ("masks/03.png", &["03.png", "decoded"])]
    {
        let small = Small::new();
        let whole = fs::read(small.path(name)).expect("a picture");
        small.write(name, &whole[..whole.len() / 2]);
        refused(&small.run(&["--masks", "right=masks"]), words);
        small.write(name, "");
        refused(&small.run(&["--masks", "right=masks"]), words);
        small.picture(name, &noise(32, 24, 9));
        refused(&small.run(&["--masks", "right=masks"]), &[words[0], "32 × 24"]);
    }
}

#[test]
fn a_film_that_ends_too_early() {
    let small = Small::new();
    let whole = fs::read(office().join("video/cam0.mp4")).expect("the office");
    small.write("torn.mp4", &whole[..whole.len() / 20]);
    let room = office().join("room");
    let torn = format!("cam0={}", small.path("torn.mp4").display());
    let output = program("tracker")
        .args(["run".as_ref(), room.as_os_str(), "--out".as_ref(), small.path("out").as_os_str()])
        .args(["--no-film", "--video", &torn])
        .output()
        .expect("the program starts");
    refused(&output, &["torn.mp4", "frame", "promises 300"]);
    assert_whole_lines(&small.path("out/tracks.jsonl"));
}

/// All results of the frames before an error are written, and no file is half-written.
#[test]
fn films_plan_and_times_of_the_frames_before_an_error() {
    let small = Small::new();
    small.write("left/04.png", "torn");
    let arguments = ["run", "room", "--out", "out", "--video", "left=left", "--video", "right=right"];
    refused(&small.run_program("tracker", &arguments), &["04.png"]);
    let frames = fs::read_to_string(small.path("out/tracks.jsonl")).expect("the tracks").lines().count();
    let timings = fs::read_to_string(small.path("out/timings.json")).expect("the times");
    assert!(frames == 3 && timings.contains("\"frames\":3"), "{timings}");
    assert!(small.path("out/plan.png").is_file());
    let films: Vec<String> = fs::read_dir(small.path("out/overlay"))
        .expect("the films")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    assert!(films.len() == 2 && films.iter().all(|name| !name.contains("partial")), "{films:?}");
}

/// Asserts that the lines written before the error are complete.
fn assert_whole_lines(path: &Path) {
    if let Ok(text) = fs::read_to_string(path) {
        assert!(text.is_empty() || text.ends_with('\n'), "{} ends in the middle of a line", path.display());
    }
}

#[test]
fn times() {
    let small = Small::new();
    let refuses = |text: &str, words: &[&str]| {
        small.write("times.txt", text);
        refused(&small.run(&["--times", "times.txt"]), words);
    };
    refused(&small.run(&["--times", "nowhere.txt"]), &["nowhere.txt"]);
    refuses("", &["times.txt", "no times"]);
    refuses("0\n0.1\nabc\n", &["times.txt", "line 3", "abc"]);
    refuses("0\nNaN\n", &["times.txt", "line 2"]);
    refuses("0\n0.2\n0.2\n", &["times.txt", "line 3", "grow"]);
    refuses("0\n0.2\n", &["times.txt", "line 3", "missing"]);
    small.write("all.txt", "0\n0.2\n0.4\n0.6\n0.8\n1.0\n");
    small.write("few.txt", "0\n0.2\n");
    refused(
        &small.run(&["--times", "left=all.txt", "--times", "right=few.txt"]),
        &["few.txt", "line 3", "missing"],
    );
    small.write("times.txt", [0xff, 0xfe, 0x00]);
    refused(&small.run(&["--times", "times.txt"]), &["times.txt"]);
    assert!(!small.path("out").exists(), "something was written before everything was read");
}
