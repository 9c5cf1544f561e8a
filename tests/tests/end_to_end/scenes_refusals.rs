//! `scenes` with every kind of invalid room directory: one clear line, no panic, nothing written; exit status 1 for
//! `check`, 2 otherwise.

use std::fs;
use std::ops::Deref;
use std::process::Output;

use image::RgbImage;

use crate::folder::{Folder, camera_table, door_table};
use crate::refusal::{refused, refused_with};

const SCENE: &str = concat!(
    "\nformat = 1\ngeometry = \"room.ply\"\n",
    camera_table!("left", "0.0"),
    "reference = \"left.png\"\n",
    door_table!()
);

/// A square of floor.
const GEOMETRY: &str = "ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
-3 -3 0
3 -3 0
3 3 0
-3 3 0
3 0 1 2
3 0 2 3
";

struct RoomFolder {
    folder: Folder,
}

impl Deref for RoomFolder {
    type Target = Folder;

    fn deref(&self) -> &Folder {
        &self.folder
    }
}

impl RoomFolder {
    fn new() -> Self {
        let room = Self { folder: Folder::new() };
        room.write("room/scene.toml", SCENE);
        room.write("room/room.ply", GEOMETRY);
        room.picture("room/left.png", &RgbImage::new(64, 48));
        room
    }

    fn scenes(&self, arguments: &[&str]) -> Output {
        self.run_program("scenes", arguments)
    }

    fn check(&self) -> Output {
        self.scenes(&["check", "room"])
    }

    fn depth(&self) -> Output {
        self.scenes(&["depth", "room", "--camera", "left", "--out", "depth.png"])
    }

    fn plan(&self) -> Output {
        self.scenes(&["plan", "room", "--out", "plan.png"])
    }

    /// Asserts that all three commands refuse the room with these words.
    fn refused(&self, words: &[&str]) {
        refused_with(1, &self.check(), words);
        refused(&self.depth(), words);
        refused(&self.plan(), words);
        assert!(!self.path("depth.png").exists() && !self.path("plan.png").exists(), "something was written");
    }

    fn refuses_scene(&self, from: &str, to: &str, words: &[&str]) {
        assert!(SCENE.contains(from), "{from}");
        self.write("room/scene.toml", SCENE.replacen(from, to, 1));
        self.refused(&[&["scene.toml"], words].concat());
        self.write("room/scene.toml", SCENE);
    }

    fn refuses_geometry(&self, content: impl AsRef<[u8]>, words: &[&str]) {
        self.write("room/room.ply", content);
        self.refused(&[&["room.ply"], words].concat());
    }
}

#[test]
fn the_same_room_is_right() {
    let room = RoomFolder::new();
    for output in [room.check(), room.depth(), room.plan()] {
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.is_empty(), "{said}");
    }
    let depth = image::open(room.path("depth.png")).expect("the depth").into_luma16();
    assert_eq!(depth.dimensions(), (64, 48));
    assert!(depth.pixels().any(|p| p.0[0] > 0), "the floor is not seen");
    assert!(room.path("plan.png").is_file());
}

#[test]
fn directories() {
    let room = RoomFolder::new();
    fs::remove_file(room.path("room/scene.toml")).expect("the file");
    room.refused(&["room", "no scene.toml", "recon build"]);
    fs::remove_dir_all(room.path("room")).expect("the folder");
    room.refused(&["room", "no such room directory", "recon build"]);
    fs::write(room.path("room"), "a file").expect("a file");
    room.refused(&["room", "file"]);
}

#[test]
fn scene_files() {
    let room = RoomFolder::new();
    room.write("room/scene.toml", "");
    room.refused(&["scene.toml", "empty"]);
    room.write("room/scene.toml", &SCENE[..SCENE.len() / 2]);
    room.refused(&["scene.toml", "line"]);
    room.write("room/scene.toml", [0xff, 0xfe, 0x00]);
    room.refused(&["scene.toml", "UTF-8"]);
    for (from, to, words) in [
        ("format = 1", "format = 2", &["format 2"][..]),
        ("format = 1", "", &["format"]),
        ("[[camera]]", "[[kamera]]", &["kamera", "line"]),
        ("width = 64", "width = 0", &["camera 1 (`left`)", "empty"]),
        ("width = 64", "width = -64", &["line 7"]),
        ("[[60.0", "[[nan", &["camera 1 (`left`)", "matrix"]),
        (
            "[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]",
            "[2.0, 0.0, 0.0], [0.0, 0.0, -1.0]",
            &["rotation", "orthonormal"],
        ),
        ("translation = [0.0", "translation = [nan", &["camera 1 (`left`)", "not finite"]),
        ("translation = [0.0, ", "translation = [", &["line 12"]),
        ("name = \"left\"", "name = \"../left\"", &["camera 1", "file names"]),
        ("[1.0, 1.0]]", "[nan, 1.0]]", &["zone 1 (`door`)", "finite"]),
        (", [1.0, 1.0]]", "]", &["zone 1 (`door`)", "3 corners"]),
        ("geometry = \"room.ply\"", "geometry = \"rom.ply\"", &["geometry", "rom.ply"]),
    ] {
        room.refuses_scene(from, to, words);
    }
}

#[test]
fn geometry() {
    let room = RoomFolder::new();
    room.refuses_geometry("", &["empty"]);
    room.refuses_geometry("a poem", &["header"]);
    room.refuses_geometry(&GEOMETRY[..GEOMETRY.len() / 4], &["header"]);
    room.refuses_geometry(&GEOMETRY[..GEOMETRY.len() - 10], &["element face, line 14", "properties: 1"]);
    room.refuses_geometry(
        GEOMETRY.replace("3 3 0\n-3", "nan 3 0\n-3"),
        &["element vertex, line 12", "properties: 3", "finite"],
    );
    room.refuses_geometry(GEOMETRY.replace("3 3 0\n-3", "1e99 3 0\n-3"), &["vertex 2", "finite"]);
    room.refuses_geometry(GEOMETRY.replace("property float z\n", ""), &["element vertex"]);
    room.refuses_geometry(GEOMETRY.replace("3 0 2 3", "3 0 2 4"), &["face 1", "vertex 4"]);
    room.refuses_geometry(GEOMETRY.replace("vertex 4", "vertex 4000000000000"), &["element vertex"]);
    fs::remove_file(room.path("room/room.ply")).expect("the file");
    room.refused(&["scene.toml", "geometry", "room.ply", "put it there"]);
}

#[test]
fn reference_images_that_are_wrong_are_worth_a_warning() {
    let room = RoomFolder::new();
    let warned = |words: &[&str]| {
        let output = room.check();
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{said}");
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(said.contains("WARN") && words.iter().all(|word| said.contains(word)), "{said}");
    };
    RgbImage::new(32, 48).save(room.path("room/left.png")).expect("a picture");
    warned(&["`left`", "32 × 48", "64 × 48"]);
    room.write("room/left.png", "this is no picture");
    warned(&["`left`", "left.png"]);
    room.write("room/left.png", "");
    warned(&["`left`", "left.png"]);
    fs::remove_file(room.path("room/left.png")).expect("the picture");
    warned(&["`left`", "left.png"]);
}

#[test]
fn names_and_places() {
    let room = RoomFolder::new();
    refused(
        &room.scenes(&["depth", "room", "--camera", "right", "--out", "depth.png"]),
        &["`right`", "`left`"],
    );
    room.write("room/in_the_way", "a file");
    for command in [&["depth", "room", "--camera", "left"][..], &["plan", "room"]] {
        let to = |out: &'static str| [command, &["--out", out]].concat();
        refused(&room.scenes(&to("room/in_the_way/picture.png")), &["in_the_way"]);
        refused(&room.scenes(&to("room")), &["room"]);
        let misused = room.scenes(command);
        assert_eq!(misused.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&misused.stderr).contains("--out"));
    }
    for size in ["0", "100", "1000000", "x"] {
        let output = room.scenes(&["plan", "room", "--out", "plan.png", "--size", size]);
        assert_eq!(output.status.code(), Some(2));
    }
    for cut in ["nan", "inf", "x"] {
        let output = room.scenes(&["plan", "room", "--out", "plan.png", "--cut", cut]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code() == Some(2) && said.contains("--cut") && said.contains("metres"),
            "{said}"
        );
    }
    assert!(!room.path("plan.png").exists());
}

#[test]
fn models_of_other_programs() {
    let room = RoomFolder::new();
    let succeeds = |arguments: &[&str]| {
        let output = room.scenes(arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    succeeds(&["export", "room", "--format", "nerfstudio", "--out", "transforms.json"]);
    succeeds(&["export", "room", "--format", "colmap", "--out", "model"]);
    let import = |more: &[&str]| room.scenes(&[&["import", "model", "--out", "copy"], more].concat());
    refused(&import(&["--geometry", "nowhere.ply"]), &["nowhere.ply"]);
    fs::write(room.path("torn.ply"), &GEOMETRY[..GEOMETRY.len() / 4]).expect("a file");
    refused(&import(&["--geometry", "torn.ply"]), &["torn.ply", "header"]);
    refused(&room.scenes(&["import", "room", "--out", "copy"]), &["room", "no COLMAP model"]);
    refused(&room.scenes(&["import", "nowhere", "--out", "copy"]), &["nowhere", "no COLMAP model"]);
    refused(&room.scenes(&["export", "nowhere", "--format", "colmap", "--out", "copy"]), &["nowhere"]);
    let lens = fs::read_to_string(room.path("model/cameras.txt")).expect("the lens");
    fs::write(room.path("model/cameras.txt"), lens.replace("PINHOLE", "FOV")).expect("a file");
    refused(&import(&[]), &["model/cameras.txt", "line 2", "5 parameters"]);
    fs::write(room.path("model/cameras.txt"), "").expect("a file");
    refused(&import(&[]), &["model/images.txt", "`left.png`", "no camera 1"]);
    assert!(!room.path("copy").exists(), "something was written");

    fs::write(room.path("model/cameras.txt"), lens).expect("a file");
    assert!(import(&["--geometry", "room/room.ply"]).status.success());
    succeeds(&["depth", "copy", "--camera", "left", "--out", "copy.png"]);
    succeeds(&["depth", "room", "--camera", "left", "--out", "room.png"]);
    let picture = |name: &str| image::open(room.path(name)).expect("a depth").into_luma16();
    assert_eq!(picture("copy.png"), picture("room.png"));
    refused(&import(&[]), &["copy", "a room already"]);
}
