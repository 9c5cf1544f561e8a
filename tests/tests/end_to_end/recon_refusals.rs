//! `recon build` with every kind of wrong input: one clear line, exit status 2, no panic, and the room directory as it
//! was before.

use std::fs;
use std::ops::Deref;
use std::process::Output;

use image::{Rgb, RgbImage};
use tests::data::office;

use crate::folder::Folder;
use crate::refusal::refused;

const LENS: &str = "width = 64
height = 48
matrix = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]
distortion = [0.0, 0.0, 0.0, 0.0, 0.0]
";

const PROJECT: &str = r#"
[[camera]]
name = "left"
capture = "capture/left"
reference = "last"
intrinsics = "lens.toml"

[[camera]]
name = "right"
capture = "capture/right"
reference = 2
intrinsics = "lens.toml"

[[point]]
left = [10.0, 11.0]
right = [12.0, 13.0]

[[point]]
left = [40.0, 12.0]
right = [44.0, 17.0]

[[point]]
left = [20.0, 40.0]
right = [23.0, 42.0]

[scale]
camera = "left"
from = [5.0, 5.0]
to = [50.0, 30.0]
metres = 1.2
"#;

const ZONES: &str = "[[zone]]
name = \"door\"
polygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
";

const ROOM: &str = r#"
format = 1

[[camera]]
name = "left"
width = 64
height = 48
matrix = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]
rotation = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
translation = [0.0, 1.2, 3.0]

[[zone]]
name = "drawn by hand"
polygon = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
"#;

/// A valid capture project whose films are plain grey: it fails only after everything has been read.
struct GreyProject {
    folder: Folder,
}

impl Deref for GreyProject {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.folder
    }
}

fn grey(width: u32, height: u32) -> RgbImage {
    RgbImage::from_pixel(width, height, Rgb([90, 100, 110]))
}

impl GreyProject {
    fn new() -> Self {
        let project = Self { folder: Folder::new() };
        project.write("room.toml", PROJECT);
        project.write("zones.toml", ZONES);
        project.write("lens.toml", LENS);
        for camera in ["left", "right"] {
            for frame in 1..=4 {
                project.picture(&format!("capture/{camera}/{frame}.png"), &grey(64, 48));
            }
        }
        project
    }

    fn build(&self, more: &[&str]) -> Output {
        let out = if more.contains(&"--out") { &[][..] } else { &["--out", "out/room"] };
        self.run_program("recon", &[&["build", "room.toml", "--zones", "zones.toml"], out, more].concat())
    }

    /// Asserts that the build is refused with these words and writes nothing, neither the room nor a file beside it.
    fn refuses(&self, more: &[&str], words: &[&str]) {
        let before = self.files();
        refused(&self.build(more), words);
        assert_eq!(self.files(), before, "the files beside the project changed");
    }

    /// Asserts that the project file with a change is refused.
    fn refuses_changed(&self, from: &str, to: &str, words: &[&str]) {
        assert!(PROJECT.contains(from), "{from}");
        self.write("room.toml", PROJECT.replacen(from, to, 1));
        self.refuses(&[], words);
        self.write("room.toml", PROJECT);
    }
}

#[test]
fn the_same_project_is_read_whole_before_its_films_are_found_wanting() {
    GreyProject::new().refuses(&[], &["`left`", "0 features", "more light"]);
}

#[test]
fn the_project_file() {
    let project = GreyProject::new();
    for (text, words) in [
        ("", &["room.toml", "[[camera]]"][..]),
        (&PROJECT[..PROJECT.len() / 2], &["room.toml"]),
        (PROJECT.trim_end().trim_end_matches("1.2"), &["room.toml", "line"]),
        (&PROJECT.replace("[[camera]]", "[[kamera]]"), &["room.toml", "line 2", "kamera"]),
        (&PROJECT.replace("[scale]", "[size]"), &["room.toml", "line", "size"]),
    ] {
        project.write("room.toml", text);
        project.refuses(&[], words);
    }
    project.write("room.toml", [0xff, 0xfe, 0x00]);
    project.refuses(&[], &["room.toml", "UTF-8"]);
    fs::remove_file(project.path("room.toml")).expect("the file");
    project.refuses(&[], &["room.toml", "No such file"]);
    fs::create_dir(project.path("room.toml")).expect("a folder");
    project.refuses(&[], &["room.toml"]);
}

#[test]
fn names_numbers_and_picks() {
    let project = GreyProject::new();
    for (from, to, words) in [
        ("\"right\"\ncapture", "\"left\"\ncapture", &["[[camera]] 2, name", "taken"][..]),
        ("\"left\"\ncapture", "\"a/b\"\ncapture", &["[[camera]] 1, name", "file name"]),
        ("reference = 2", "reference = 0", &["[[camera]] 2, reference"]),
        ("reference = 2", "reference = \"middle\"", &["[[camera]] 2, reference", "middle"]),
        ("left = [40.0, 12.0]", "middle = [40.0, 12.0]", &["[[point]] 2, middle", "`left`, `right`"]),
        ("left = [40.0, 12.0]", "left = [nan, 12.0]", &["[[point]] 2, left", "NaN"]),
        ("left = [40.0, 12.0]", "left = [64.0, 12.0]", &["[[point]] 2, left", "64 × 48"]),
        ("left = [40.0, 12.0]\n", "", &["[[point]] 2", "two or more"]),
        (
            "left = [40.0, 12.0]\nright = [44.0, 17.0]",
            "left = [15.0, 25.5]\nright = [17.5, 27.5]",
            &["on a line"],
        ),
        ("[[point]]\nleft = [10.0, 11.0]\nright = [12.0, 13.0]\n", "", &["[[point]]", "share 2 points", "3"]),
        ("camera = \"left\"", "camera = \"middle\"", &["[scale], camera", "`left`, `right`"]),
        ("to = [50.0, 30.0]", "to = [5.0, 5.0]", &["[scale]", "no length"]),
        ("to = [50.0, 30.0]", "to = [5.0, 48.0]", &["[scale], to", "outside"]),
        ("metres = 1.2", "metres = 0.0", &["[scale], metres", "positive"]),
        ("metres = 1.2", "metres = nan", &["[scale], metres", "NaN"]),
        ("metres = 1.2", "", &["[scale]", "either"]),
    ] {
        project.refuses_changed(from, to, &[&["room.toml"], words].concat());
    }
}

#[test]
fn intrinsics() {
    let project = GreyProject::new();
    for (text, words) in [
        (String::new(), &["lens.toml"][..]),
        (LENS[..LENS.len() / 2].to_owned(), &["lens.toml", "line 3"]),
        (LENS.replace("31.5", "nan"), &["lens.toml", "matrix"]),
        (LENS.replace("[[60.0", "[[-60.0"), &["lens.toml", "matrix"]),
        (LENS.replace("height = 48", "height = 0"), &["lens.toml", "empty"]),
        (LENS.replace("distortion = [0.0", "distortion = [inf"), &["lens.toml", "distortion"]),
        (LENS.replace("64", "640"), &["capture/left", "64 × 48", "640 × 48"]),
    ] {
        project.write("lens.toml", text);
        project.refuses(&[], words);
    }
    fs::remove_file(project.path("lens.toml")).expect("the file");
    project.refuses(&[], &["lens.toml", "No such file"]);
}

#[test]
fn captures() {
    let project = GreyProject::new();
    let whole = fs::read(project.path("capture/right/3.png")).expect("a picture");
    for (content, words) in [
        (&whole[..whole.len() / 2], &["capture/right/3.png", "whole"][..]),
        (&[], &["capture/right/3.png"]),
        (b"this is no picture", &["capture/right/3.png"]),
    ] {
        project.write("capture/right/3.png", content);
        project.refuses(&[], words);
    }
    project.picture("capture/right/3.png", &grey(32, 24));
    project.refuses(&[], &["capture/right/3.png", "32 × 24", "64 × 48"]);
    fs::remove_file(project.path("capture/right/3.png")).expect("the picture");
    fs::remove_file(project.path("capture/right/4.png")).expect("the picture");
    project.refuses(&[], &["capture/right", "2 frames", "3"]);
    project.refuses_changed("reference = 2", "reference = 9", &["capture/right"]);
    fs::remove_dir_all(project.path("capture/right")).expect("the folder");
    project.refuses(&[], &["room.toml", "[[camera]] 2, capture", "capture/right"]);
    fs::create_dir(project.path("capture/right")).expect("a folder");
    project.refuses(&[], &["capture/right", "no .jpg"]);
}

#[test]
fn a_capture_without_its_reference() {
    GreyProject::new().refuses_changed(
        "reference = 2",
        "reference = 9",
        &["capture/right", "reference", "frame 9", "there are 4"],
    );
}

#[test]
fn films() {
    let project = GreyProject::new();
    project.write("empty.mp4", "");
    project.write("text.mp4", "this is no video");
    let whole = fs::read(office().join("capture/cam0.mp4")).expect("the office");
    project.write("torn.mp4", &whole[..whole.len() / 2]);
    for (film, words) in [
        ("empty.mp4", &["empty.mp4", "empty"][..]),
        ("text.mp4", &["text.mp4", "decoded"]),
        ("torn.mp4", &["torn.mp4", "frame", "promises"]),
    ] {
        project.refuses_changed("capture/right", film, words);
    }
}

#[test]
fn zones() {
    let project = GreyProject::new();
    for (text, words) in [
        (String::new(), &["zones.toml", "[[zone]]"][..]),
        (ZONES[..ZONES.len() - 4].to_owned(), &["zones.toml", "line"]),
        (ZONES.replace("[1.0, 1.0]", "[nan, 1.0]"), &["zones.toml", "zone 1 (`door`)", "finite"]),
        (ZONES.replace(", [1.0, 1.0]", ""), &["zones.toml", "zone 1 (`door`)", "3 corners"]),
        (ZONES.replace("polygon", "poligon"), &["zones.toml", "line", "poligon"]),
    ] {
        project.write("zones.toml", text);
        project.refuses(&[], words);
    }
    fs::remove_file(project.path("zones.toml")).expect("the file");
    project.refuses(&[], &["zones.toml", "No such file"]);
}

#[test]
fn places_for_the_room() {
    let project = GreyProject::new();
    project.write("thesis/chapter1.txt", "years of work");
    project.refuses(&["--out", "thesis"], &["thesis", "--out", "no room"]);
    project.refuses(&["--out", "thesis/chapter1.txt"], &["chapter1.txt", "is a file"]);
    project.refuses(&["--out", "thesis/chapter1.txt/room"], &["chapter1.txt", "--out"]);
    // A room that cannot be read may hold zones that a person drew.
    project.write("old/scene.toml", ROOM.replace("[1.0, 1.0]]", "[1.0,"));
    project.refuses(&["--out", "old"], &["old", "scene.toml: line", "mend it"]);
    // A room that can be read stays as it is when the new one fails.
    project.write("old/scene.toml", ROOM);
    project.refuses(&["--out", "old"], &["`left`", "features"]);
}

#[test]
fn options() {
    let project = GreyProject::new();
    for arguments in
        [&["--threads", "0"][..], &["--seed", "x"], &["--quality", "best"], &["--zones"], &["--wrong"]]
    {
        let output = project.build(arguments);
        assert_eq!(output.status.code(), Some(2));
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(said.starts_with("error: ") && said.contains(arguments[0]), "{said}");
    }
}
